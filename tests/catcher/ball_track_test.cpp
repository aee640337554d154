#include "controller/behaviours/ball_track.hpp"

#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <random>

#include "controller/config/catcher_config_yaml.hpp"
#include "tests/catcher/rig.hpp"

namespace stance::behaviours {
namespace {

constexpr double kFrame = 0.01;  // s
constexpr int kThrows = 200;

/// m, rms over random throws at about the aim: how far across its way a ball is from where it is said to come by it,
/// after `frames` by a camera of `sigma` [m], told of the aim and not.
struct Errors {
  double told = 0.0, not_told = 0.0;
};

Errors errors_after(int frames, double sigma) {
  const auto robot = test::catcher();
  CatcherConfig config = config::catcher_config(robot);
  config.filter.measurement_sigma = sigma;
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  const auto vector = [&](double by) { return Vector3(by * Vector3(normal(random), normal(random), normal(random))); };
  const double flight = 0.5;
  Errors sum;
  for (int k = 0; k < kThrows; ++k) {
    const Vector3 from(3.5, 0.5 * normal(random), 1.2), aim = config.track.aim + vector(config.track.aim_sigma);
    planning::BallState ball{from, (aim - from) / flight + 0.5 * flight * Vector3(0.0, 0.0, kGravity), 0.0};
    BallTrack track(config.track, config.filter);
    std::int64_t utime = 0;
    for (int i = 0; i < frames; ++i, utime += 10'000) {
      if (i > 0) ball.coast(kFrame);
      static_cast<void>(track.observe(utime, ball.p_A + vector(sigma)));
    }
    utime -= 10'000;
    const double left = flight - kFrame * (frames - 1);
    ball.coast(left);
    const auto off = [&](const estimation::BallFilter<7>::Estimate& estimate) {
      planning::BallState then{estimate.p(), estimate.v(), 0.0};
      then.coast(left);
      return (then.p_A - ball.p_A).cross(ball.v_A.normalized()).squaredNorm();
    };
    sum.told += off(track.thrown_at_aim(utime));
    sum.not_told += off(track.at(utime));
  }
  return {std::sqrt(sum.told / kThrows), std::sqrt(sum.not_told / kThrows)};
}

}  // namespace

TEST_CASE("ABallsAimTellsMuchBesideItsFirstFramesAndNothingBesideManyGoodOnes") {
  const Errors first = errors_after(10, 0.1), last = errors_after(35, 0.01);
  CHECK(first.told < 0.6 * first.not_told);
  CHECK(std::abs(last.told - last.not_told) < 0.05 * last.not_told);
}

TEST_CASE("WhatTheAimTellsOfABallStaysWhenTheBallPassesIt") {
  const CatcherConfig config = config::catcher_config(test::catcher());
  BallTrack track(config.track, config.filter);
  planning::BallState ball{{0.8, 0.1, 0.9}, {-5.0, 0.0, 1.0}, 0.0};
  std::int64_t utime = 0;
  for (int i = 0; i < 5; ++i, utime += 10'000, ball.coast(kFrame)) static_cast<void>(track.observe(utime, ball.p_A));
  // It passes the aim 15 ms from here.
  REQUIRE((track.thrown_at_aim(utime).p() - track.at(utime).p()).norm() > 1e-4);
  const auto before = track.thrown_at_aim(utime), after = track.thrown_at_aim(utime + 30'000);
  planning::BallState then{before.p(), before.v(), 0.0};
  then.coast(0.03);
  CHECK((then.p_A - after.p()).norm() < 1e-4);
}

TEST_CASE("ABallThatIsNowhereNearestToTheAimInTimeIsWhereItWasSeen") {
  const CatcherConfig config = config::catcher_config(test::catcher());
  BallTrack track(config.track, config.filter);
  planning::BallState ball{{0.6, 0.0, 60.0}, {0.0, 0.0, 0.0}, 0.0};  // it falls for 3.5 s
  std::int64_t utime = 0;
  for (int i = 0; i < 5; ++i, utime += 10'000, ball.coast(kFrame)) static_cast<void>(track.observe(utime, ball.p_A));
  CHECK(track.thrown_at_aim(utime).x == track.at(utime).x);
}

}  // namespace stance::behaviours
