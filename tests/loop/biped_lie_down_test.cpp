// The biped lets itself down: it stands first, crouches as low as it may, and its drives damp from there.
#include <algorithm>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "controller/config/biped_config_yaml.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::behaviours {
namespace {

using stance_msgs::user_command_t;
using test::BipedRig;

constexpr int kSettled = 50;  // ticks
constexpr int kSecond = 100;  // ticks

user_command_t command_of(std::int64_t seq, std::int8_t behaviour) {
  user_command_t command{};
  command.seq = seq;
  command.behaviour = behaviour;
  return command;
}

HeightConfig height() { return config::biped_config(test::biped()).height; }

bool damps(const BipedRig& rig) { return rig.command().mode == DriveMode::kDamp; }

/// Until the drives damp, at most so long; returns the ticks.
int until_it_damps(BipedRig& rig, int most) {
  int ticks = 0;
  for (; ticks < most && !damps(rig); ++ticks) rig.tick();
  return ticks;
}

double speed(const BipedRig& rig) {
  const auto& v = rig.simulator.truth().v_WC;
  return std::hypot(v[0], v[1], v[2]);
}

}  // namespace

TEST_CASE("ToldToLieDownItCrouchesAtItsRateAndThenDampsAndComesToRestWithoutAFault") {
  BipedRig rig;
  rig.tick_times(kSettled);
  const double before = rig.simulator.truth().p_WC[2];
  rig.give(command_of(1, user_command_t::LIE_DOWN));
  rig.tick();
  CHECK(rig.trace().behaviour == Behaviour::kLieDown);
  const int ticks = until_it_damps(rig, 10 * kSecond);
  const double way = -height().offset_range[0];
  CHECK(std::abs(ticks * kControlPeriod - way / height().offset_rate) < 3 * kControlPeriod);
  CHECK(std::abs(before - rig.simulator.truth().p_WC[2] - way) < 0.015);
  CHECK(rig.tilt() < 0.05);
  CHECK_FALSE(rig.simulator.lying());

  double fastest = 0.0;
  for (int k = 0; k < 5 * kSecond; ++k) {
    rig.tick();
    CHECK(damps(rig));
    fastest = std::max(fastest, speed(rig));
  }
  CHECK(rig.trace().behaviour == Behaviour::kLieDown);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.trace().qp_status == QpStatus::kNotRun);
  CHECK(rig.count(Fault::kRobotFallen) == 0);
  CHECK(rig.count(Fault::kQpFailed) == 0);
  CHECK(rig.simulator.lying());
  CHECK_FALSE(rig.simulator.fallen());
  CHECK(speed(rig) < 0.01);
  CHECK(fastest < std::sqrt(2.0 * kGravity * (before - way)));  // slower than a fall from the crouch
}

TEST_CASE("AWalkingRobotThatIsToldToLieDownStopsAndStandsFirst") {
  BipedRig rig;
  rig.tick_times(kSettled);
  user_command_t walk = command_of(1, user_command_t::WALK);
  walk.velocity[0] = 0.5;
  rig.give(walk);
  rig.tick_times(4 * kSecond);
  user_command_t lie_down = command_of(1000, user_command_t::LIE_DOWN);
  lie_down.velocity[0] = 0.5;  // means nothing with this behaviour
  rig.give(lie_down);
  rig.tick();
  CHECK(rig.trace().behaviour == Behaviour::kWalk);
  CHECK(until_it_damps(rig, 12 * kSecond) < 12 * kSecond);
  CHECK(rig.tilt() < 0.05);
  CHECK(speed(rig) < 2.0 * height().offset_rate);
  rig.tick_times(5 * kSecond);
  CHECK(rig.simulator.lying());
  CHECK_FALSE(rig.simulator.fallen());
}

TEST_CASE("ItRisesAgainWhereTheOperatorThinksBetterOfItAndNotOnceItLies") {
  BipedRig rig;
  rig.tick_times(kSettled);
  const double before = rig.simulator.truth().p_WC[2];
  rig.give(command_of(1, user_command_t::LIE_DOWN));
  rig.tick_times(kSecond);
  CHECK(before - rig.simulator.truth().p_WC[2] > 0.05);
  rig.give(command_of(1000, user_command_t::STAND));
  rig.tick_times(3 * kSecond);
  CHECK(rig.trace().behaviour == Behaviour::kStand);
  CHECK(std::abs(before - rig.simulator.truth().p_WC[2]) < 0.01);

  rig.give(command_of(2000, user_command_t::LIE_DOWN));
  REQUIRE(until_it_damps(rig, 10 * kSecond) < 10 * kSecond);
  for (const std::int8_t behaviour : {user_command_t::STAND, user_command_t::WALK}) {
    const std::int64_t refused = rig.count(Fault::kCommandInvalid);
    rig.give(command_of(3000 + behaviour, behaviour));
    rig.tick();
    CHECK(rig.count(Fault::kCommandInvalid) == refused + 1);
    CHECK(rig.trace().behaviour == Behaviour::kLieDown);
    CHECK(damps(rig));
  }
}

TEST_CASE("ARobotOnItsWayDownGoesOnWithoutItsOperator") {
  BipedRig rig;
  rig.tick_times(kSettled);
  rig.give(command_of(1, user_command_t::LIE_DOWN));
  rig.tick_times(5);
  rig.fall_silent();
  CHECK(until_it_damps(rig, 5 * kSecond) < 5 * kSecond);
  CHECK(rig.trace().behaviour == Behaviour::kLieDown);
}

TEST_CASE("ARobotThatIsPushedOverOnItsWayDownHasFallen") {
  sim::Scenario scenario = test::quiet_stand();
  scenario.pushes.push_back(test::push(2.0, 400.0, 0.0, 0.0));
  BipedRig rig(scenario);
  rig.tick_times(kSettled);
  rig.give(command_of(1, user_command_t::LIE_DOWN));
  rig.tick_times(4 * kSecond);
  CHECK(rig.simulator.fallen());
  CHECK_FALSE(rig.simulator.lying());
  CHECK(rig.count(Fault::kRobotFallen) > 0);
}

}  // namespace stance::behaviours
