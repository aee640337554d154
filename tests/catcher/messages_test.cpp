// What the catcher is told and tells, and its scenarios.
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <stance_msgs/ball_estimate_t.hpp>
#include <stance_msgs/controller_trace_t.hpp>

#include "sim/random_values.hpp"
#include "tests/catcher/rig.hpp"

namespace stance::test {
namespace {

std::string refusal(const std::string& from, const std::string& to) {
  std::string text = quiet().text;
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  text.replace(at, from.size(), to);
  try {
    static_cast<void>(sim::scenario_from_text(text, "quiet.yaml", catcher(), 1));
  } catch (const config::ConfigError& error) {
    return error.what();
  }
  return "";
}

stance_msgs::ball_observation_t observation(std::int64_t seq) {
  stance_msgs::ball_observation_t ball{};
  ball.utime = 10'000 * seq;
  ball.seq = seq;
  ball.run_id = 7;
  ball.valid = 1;
  ball.p_KBall[2] = 2.5;
  return ball;
}

}  // namespace

TEST_CASE("AnObservationAndCalibrationPointsAreDecodedWholeOrNotAtAll") {
  const auto bytes = io::bytes_of(observation(3));
  BallObservation ball;
  REQUIRE(io::decode(bytes, ball));
  CHECK(ball.seq == 3);
  CHECK(ball.utime == 30'000);
  CHECK(ball.valid);
  CHECK(ball.p_K == Vector3(0.0, 0.0, 2.5));
  CHECK_FALSE(io::decode(io::Bytes(bytes).first(bytes.size() - 1), ball));

  stance_msgs::calibration_points_t told{};
  told.seq = 2;
  told.num_points = 5;
  told.p_K[4][1] = 0.5;
  told.p_A[4][0] = -1.0;
  CalibrationPoints points;
  REQUIRE(io::decode(io::bytes_of(told), points));
  CHECK(points.num_points == 5);
  CHECK(points.p_K[4].y() == 0.5);
  CHECK(points.p_A[4].x() == -1.0);
  CHECK_FALSE(io::decode(bytes, points));
}

TEST_CASE("TheTraceSaysWhichObservationAndWhichPointsATickConsumed") {
  CatcherRig rig;
  const auto trace = [&] { return io::decoded<stance_msgs::controller_trace_t>(rig.ticker.trace().bytes()); };
  rig.tick();
  CHECK(trace().calibration_seq == 1);
  CHECK(trace().ball_seq == 0);  // the first frame is told a period later
  rig.tick();
  CHECK(trace().ball_seq == 1);
  const auto quiet_hash = [](bool with_ball) {
    loop::Ticker ticker(compose(catcher()));
    loop::NoClock clock;
    sim::Simulator simulator(catcher(), quiet(), {.seed = 1, .run_id = 7, .start_utime = 0, .plant = {}});
    if (with_ball) static_cast<void>(ticker.offer_ball(io::bytes_of(observation(1))));
    static_cast<void>(ticker.offer_state(io::bytes_of(simulator.state())));
    ticker.tick(1, clock);
    return io::decoded<stance_msgs::controller_trace_t>(ticker.trace().bytes()).consumed_hash;
  };
  CHECK(quiet_hash(true) != quiet_hash(false));
  CHECK(quiet_hash(true) == quiet_hash(true));
}

TEST_CASE("TheBallsEstimateGoesOutEachTickAndSaysWhetherItIsNew") {
  CatcherRig rig;
  rig.tick_until(1.3);
  const auto told = [&] {
    return io::decoded<stance_msgs::ball_estimate_t>(rig.ticker.published().front().message.bytes());
  };
  CHECK(std::isfinite(told().nis));
  const auto seq = told().observation_seq;
  rig.spoil_ball = [](auto& ball) { ball.valid = 0; };
  rig.tick();
  CHECK(std::isnan(told().nis));
  CHECK(told().observation_seq == seq);
  CHECK(io::tick_of(io::channel::kBallEstimate, rig.ticker.published().front().message.bytes()) == told().seq);
}

TEST_CASE("AScenarioWithACupAsksForBallCameraAndThrowsInOrder") {
  CHECK(refusal("robot: catcher", "robot: catcher").empty());
  CHECK(refusal("restitution: 0.1", "restitution: 1.5").find("ball.restitution") != std::string::npos);
  CHECK(refusal("latency: 0.01 ", "latency: 0.013").find("camera.latency") != std::string::npos);
  CHECK(refusal("points: 20", "points: 65").find("camera.calibration.points") != std::string::npos);
  CHECK(refusal("  sigma: 0.0 ", "  sigmas: 0.0 ").find("sigma") != std::string::npos);
  CHECK(refusal("throws:\n",
                "throws:\n  - {time: 0.5, flight_time: 0.8, distance: 3.5, azimuth: 0.0, height: 1.2, "
                "aim_W: [0.5, 0, 0.8]}\n")
            .find("throws must stand in the order of their times") != std::string::npos);
  config::RobotDescription cupless = catcher();
  cupless.cup.reset();
  try {
    static_cast<void>(sim::scenario_from_text(quiet().text, "quiet.yaml", cupless, 1));
    FAIL("a robot without a cup took a ball");
  } catch (const config::ConfigError& error) {
    CHECK(std::string(error.what()).find("ball is of robots with a cup") != std::string::npos);
  }
}

TEST_CASE("NormalRandomValuesHaveTheirMeanAndSpreadAndAreTheSeeds") {
  const std::string text = "x: {normal: [2.0, 0.5]}\n";
  double sum = 0.0, squares = 0.0;
  constexpr int draws = 4000;
  for (std::uint64_t seed = 1; seed <= draws; ++seed) {
    const double x = std::stod(sim::draw_random_values(text, "x.yaml", seed).values.at(0).value);
    sum += x;
    squares += (x - 2.0) * (x - 2.0);
  }
  CHECK(std::abs(sum / draws - 2.0) < 0.03);
  CHECK(std::abs(std::sqrt(squares / draws) - 0.5) < 0.03);
  CHECK(sim::draw_random_values(text, "x.yaml", 5).text == sim::draw_random_values(text, "x.yaml", 5).text);
  CHECK_THROWS_AS(sim::draw_random_values("x: {normal: [1, -1]}\n", "x.yaml", 1), config::ConfigError);
  CHECK_THROWS_AS(sim::draw_random_values("x: {normal: [1, 1], step: 1}\n", "x.yaml", 1), config::ConfigError);
}

}  // namespace stance::test
