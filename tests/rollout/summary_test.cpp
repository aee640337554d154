// What a rollout tells of itself.
#include "rollout/summary.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <numeric>

#include "tests/loop/biped_rig.hpp"

namespace stance::rollout {
namespace {

using sim::ScheduledCommand;

constexpr int kSecond = 100;  // periods

ScheduledCommand walk(int period, double vx, double yaw_rate = 0.0) {
  return {.period = period, .behaviour = Behaviour::kWalk, .velocity = {vx, 0.0}, .yaw_rate = yaw_rate};
}

/// Along a circle at 0.5 m/s, the trunk turned by `crab` [rad] from the way.
std::vector<Place> circle(int periods, double yaw_rate, double crab) {
  constexpr double speed = 0.5;
  std::vector<Place> path;
  for (int k = 0; k <= periods; ++k) {
    const double angle = yaw_rate * k * kControlPeriod;
    const double radius = speed / yaw_rate;
    path.push_back({{radius * std::sin(angle), radius * (1.0 - std::cos(angle))}, angle + crab});
  }
  return path;
}

/// A run of the rig that an observer looks at.
struct Run {
  explicit Run(const sim::Scenario& from)
      : scenario(from), rig(scenario), observer(rig.robot.model, scenario, rig.simulator) {}
  void ticks(int periods) {
    for (int k = 0; k < periods && !rig.simulator.fallen(); ++k) {
      rig.tick();
      observer.period(rig.ticker, 100.0 + k);
    }
  }
  sim::Scenario scenario;
  test::BipedRig rig;
  Observer observer;
};

}  // namespace

TEST_CASE("MeansAreInTheTrunksHeadingFrameAndTurnWithIt") {
  const auto path = circle(10 * kSecond, 0.8, 0.3);
  const auto found = segments({walk(0, 0.5, 0.8)}, path);
  REQUIRE(found.size() == 1);
  // Chords of 0.008 rad are shorter than their arcs by 3e-6.
  CHECK(std::abs(found[0].mean_velocity.x() - 0.5 * std::cos(0.3)) < 1e-5);
  CHECK(std::abs(found[0].mean_velocity.y() + 0.5 * std::sin(0.3)) < 1e-5);
  CHECK(std::abs(found[0].mean_yaw_rate - 0.8) < 1e-12);
  CHECK(std::abs(found[0].distance - path.back().p_WC.norm()) < 1e-12);
}

TEST_CASE("MeansLeaveOutThreeSecondsOrTheFirstHalf") {
  std::vector<Place> path(30 * kSecond + 1);
  // At rest in the part that counts, moving before it.
  for (int k = 0; k < 3 * kSecond; ++k) path[static_cast<std::size_t>(k)].p_WC.x() = k * 0.01 - 3.0;
  const auto found = segments({walk(0, 1.0), walk(20 * kSecond, 2.0), walk(24 * kSecond, 3.0)}, path);
  REQUIRE(found.size() == 3);
  CHECK(found[0].measured_from == 3.0);
  CHECK(found[0].mean_velocity.norm() < 1e-12);
  CHECK(std::abs(found[0].distance - 3.0) < 1e-12);
  CHECK(found[1].measured_from == 22.0);
  CHECK(found[2].measured_from == 27.0);
}

TEST_CASE("ASegmentEndsWhereAnotherWishBegins") {
  const std::vector<Place> path(10 * kSecond + 1);
  ScheduledCommand lower = walk(5 * kSecond, 0.3);
  lower.height_offset = -0.05;
  const auto found = segments(
      {walk(100, 0.3), walk(200, 0.3), walk(300, 0.3), lower, walk(800, 0.3), walk(1000, 0.4), walk(1200, 0.5)}, path);
  REQUIRE(found.size() == 3);
  CHECK(found[0].start == 1.0);
  CHECK(found[0].end == 5.0);
  CHECK(found[1].end == 8.0);
  CHECK(found[1].wanted.height_offset == -0.05);
  CHECK(found[2].end == 10.0);
  CHECK(segments({}, path).empty());
  const auto silence = [](int period) { return ScheduledCommand{.period = period, .silent = true}; };
  const auto ceased = segments({walk(0, 0.3), silence(300), silence(400), walk(700, 0.3)}, path);
  REQUIRE(ceased.size() == 3);
  CHECK(ceased[1].wanted.silent);
  CHECK(ceased[1].end == 7.0);
}

TEST_CASE("TicksAreCountedOnAGridWithTheirExactPercentiles") {
  std::vector<double> times(1000);
  std::iota(times.begin(), times.end(), 1.0);
  const TickCpu cpu = tick_cpu(times);
  CHECK(cpu.p50 == 500.0);
  CHECK(cpu.p99 == 990.0);
  CHECK(cpu.p99_9 == 999.0);
  CHECK(cpu.max == 1000.0);
  std::int64_t counted = 0;
  for (int i = 0; i < TickCpu::kBins; ++i) {
    const double from = std::pow(10.0, i / 20.0), to = std::pow(10.0, (i + 1) / 20.0);
    const auto within = std::count_if(times.begin(), times.end(), [&](double t) { return t >= from && t < to; });
    CHECK(cpu.counts[static_cast<std::size_t>(i)] == within);
    counted += cpu.counts[static_cast<std::size_t>(i)];
  }
  CHECK(counted == 1000);
  const TickCpu extremes = tick_cpu({0.01, 1e9});
  CHECK(extremes.counts.front() == 1);
  CHECK(extremes.counts.back() == 1);
  CHECK(tick_cpu({}).max == 0.0);
}

TEST_CASE("AWalkTellsItsStepsItsSegmentsAndItsTicks") {
  sim::Scenario scenario = test::quiet_stand();
  scenario.commands = {walk(0, 0.0), walk(kSecond, 0.4)};
  Run run(scenario);
  stance_msgs::user_command_t command{};
  command.seq = 1;
  command.behaviour = stance_msgs::user_command_t::WALK;
  command.velocity[0] = 0.4;
  run.rig.give(command);
  run.ticks(8 * kSecond);
  const Summary summary = run.observer.summary(3, 2.0);
  CHECK_FALSE(summary.fallen());
  CHECK(summary.duration == 8.0);
  // A step takes 0.14 to 0.30 s, and the first one waits.
  CHECK(summary.steps > 24);
  CHECK(summary.steps < 58);
  REQUIRE(summary.segments.size() == 2);
  CHECK(std::abs(summary.segments[1].mean_velocity.x() - 0.4) < 0.08);
  CHECK(summary.tick_cpu.max == 100.0 + 8 * kSecond - 1);
  CHECK(summary.qp_iterations_max > 0);
  CHECK(summary.max_torque_share > 0.1);
  CHECK(summary.max_torque_share <= 1.0);
  CHECK(summary.drives_damped == 0.0);
  const YAML::Node json = YAML::Load(as_json(summary));
  CHECK(json["seed"].as<int>() == 3);
  CHECK(json["times_real_time"].as<double>() == 4.0);
  CHECK_FALSE(json["fallen"].as<bool>());
  CHECK_FALSE(json["lying"].as<bool>());
  for (const char* key : {"first_fall_s", "fall_reason", "fallen_on"}) CHECK(json[key].IsNull());
  CHECK(json["steps"].as<std::int64_t>() == summary.steps);
  CHECK(json["segments"][1]["behaviour"].as<std::string>() == "walk");
  CHECK(json["segments"][1]["velocity_m_s"][0].as<double>() == 0.4);
  CHECK(json["segments"][1]["mean_velocity_m_s"][0].as<double>() == summary.segments[1].mean_velocity.x());
  CHECK(json["tick_cpu"]["counts"].size() == TickCpu::kBins);
  CHECK(as_text(summary).find("no fall in 8 s") == 0);
}

TEST_CASE("AFallTellsWhenAndByWhat") {
  sim::Scenario scenario = test::quiet_stand();
  scenario.pushes = {test::push(0.5, 0.0, 900.0, 0.0)};
  Run run(scenario);
  run.ticks(5 * kSecond);
  const Summary summary = run.observer.summary(1, 1.0);
  REQUIRE(summary.fallen());
  CHECK(summary.fall == run.rig.simulator.fall());
  const YAML::Node json = YAML::Load(as_json(summary));
  CHECK(json["first_fall_s"].as<double>() == run.rig.simulator.time());
  const auto reason = json["fall_reason"].as<std::string>();
  CHECK((reason == "tilt" || reason == "height" || reason == "body_on_ground"));
  CHECK(json["fallen_on"].IsNull() == (reason != "body_on_ground"));
  CHECK(as_text(summary).find("fell at ") == 0);
}

TEST_CASE("DrawnValuesAreToldAsNumbersOrAsWords") {
  Summary summary;
  summary.drawn = {{"friction", "0.625"}, {"sensors.noise", "none"}, {"odd \"path\"", "a\\b\n"}, {"robot", "1x"}};
  const YAML::Node json = YAML::Load(as_json(summary));
  CHECK(json["drawn"]["friction"].as<double>() == 0.625);
  CHECK(json["drawn"]["sensors.noise"].as<std::string>() == "none");
  CHECK(json["drawn"]["odd \"path\""].as<std::string>() == "a\\b\n");
  CHECK(json["drawn"]["robot"].as<std::string>() == "1x");
  CHECK(json["times_real_time"].IsNull());  // of no time at all
}

}  // namespace stance::rollout
