// The biped steps, in the loop with the simulator: it walks as it is told, meets pushes by stepping, and stands again.
#include <algorithm>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "controller/behaviours/shifted_plan.hpp"
#include "controller/config/biped_config_yaml.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::behaviours {
namespace {

using stance_msgs::user_command_t;
using test::BipedRig;
using test::push;
using test::quiet_stand;

constexpr int kSettled = 50;  // ticks
constexpr int kSecond = 100;  // ticks

user_command_t walk_command(std::int64_t seq, double vx, double vy, double yaw_rate) {
  user_command_t command{};
  command.seq = seq;
  command.behaviour = user_command_t::WALK;
  command.velocity[0] = vx;
  command.velocity[1] = vy;
  command.yaw_rate = yaw_rate;
  return command;
}
user_command_t stand_command(std::int64_t seq) {
  user_command_t command{};
  command.seq = seq;
  return command;
}

double yaw_of(const BipedRig& rig) {
  const auto& q = rig.simulator.truth().quat_WB;
  return std::atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]));
}

}  // namespace

TEST_CASE("ItWalksAsTheOperatorWantsAndStandsAgain") {
  struct Case {
    double vx, vy, yaw_rate;
  };
  for (const Case& c : {Case{0.0, 0.0, 0.0}, Case{0.5, 0.0, 0.0}, Case{1.2, 0.0, 0.0}, Case{-0.4, 0.0, 0.0},
                        Case{0.0, 0.3, 0.0}, Case{0.0, -0.5, 0.0}, Case{0.0, 0.0, 0.6}}) {
    CAPTURE(c.vx, c.vy, c.yaw_rate);
    BipedRig rig;
    rig.tick_times(kSettled);
    rig.give(walk_command(1, c.vx, c.vy, c.yaw_rate));
    rig.tick_times(10 * kSecond);  // ramps, and the velocity's integral
    CHECK(rig.trace().behaviour == Behaviour::kWalk);
    // From a touchdown to a later one of the same foot.
    const auto to_touchdown = [&](int steps, auto&& each_tick) {
      const int end = rig.trace().gait.steps + steps;
      int ticks = 0;
      for (; rig.trace().gait.steps < end && ticks < 10 * kSecond; ++ticks) {
        rig.tick();
        each_tick();
      }
      return ticks * kControlPeriod;
    };
    static_cast<void>(to_touchdown(1, [] {}));
    const auto before = rig.simulator.truth();
    double turned = 0.0, last = yaw_of(rig);
    const double time = to_touchdown(20, [&] {
      turned += std::remainder(yaw_of(rig) - last, 2.0 * M_PI);
      last = yaw_of(rig);
    });
    const auto& after = rig.simulator.truth();
    if (c.yaw_rate == 0.0) {
      CHECK(std::abs((after.p_WC[0] - before.p_WC[0]) / time - c.vx) < 0.05 + 0.05 * std::abs(c.vx));
      CHECK(std::abs((after.p_WC[1] - before.p_WC[1]) / time - c.vy) < 0.05);
    }
    CHECK(std::abs(turned / time - c.yaw_rate) < 0.03);
    rig.give(stand_command(2));
    rig.tick_times(6 * kSecond);
    CHECK(rig.trace().behaviour == Behaviour::kStand);
    CHECK(rig.trace().safety == SafetyMode::kRun);
    CHECK(rig.count(Fault::kQpFailed) == 0);
    CHECK_FALSE(rig.simulator.fallen());
    CHECK(rig.tilt() < 0.05);
  }
}

TEST_CASE("AStraightWalkTurnsTheEstimatedPitchByLittle") {
  // Pitch and the accelerometer's bias are not observed apart there: what is wrong systematically adds up.
  BipedRig rig;
  rig.tick_times(kSettled);
  rig.give(walk_command(1, 1.2, 0.0, 0.0));
  rig.tick_times(10 * kSecond);
  CHECK(std::abs(rig.trace().estimate.accelerometer_bias.x()) < 0.02);  // m/s^2, of which there is none: 2 mrad
}

TEST_CASE("APushTooHardToStandIsMetByStepsAndThenItStands") {
  constexpr double impulse = 5.0, duration = 0.1;  // N s, s
  for (int direction = 0; direction < 8; ++direction) {
    const double angle = direction * M_PI / 4.0;
    CAPTURE(direction);
    sim::Scenario scenario = quiet_stand();
    scenario.pushes = {push(0.5, impulse / duration * std::cos(angle), impulse / duration * std::sin(angle), 0.0)};
    BipedRig rig(scenario);
    bool stepped = false;
    for (int k = 0; k < 8 * kSecond; ++k) {
      rig.tick();
      stepped = stepped || rig.trace().behaviour == Behaviour::kWalk;
    }
    CHECK_FALSE(rig.simulator.fallen());
    CHECK(stepped);
    CHECK(rig.trace().behaviour == Behaviour::kStand);
    CHECK(rig.tilt() < 0.05);
  }
}

TEST_CASE("AHardPushMakesASteppingRobotCrouchAndRiseAgain") {
  const double crouch = config::biped_config(test::biped()).walk.recovery_crouch;
  sim::Scenario scenario = quiet_stand();
  scenario.pushes = {push(3.0, 120.0, 0.0, 0.0)};
  BipedRig rig(scenario);
  rig.tick_times(kSettled);
  rig.give(walk_command(1, 0.0, 0.0, 0.0));
  rig.tick_times(3 * kSecond - kSettled);
  const double before = rig.trace().x_ref[5];
  double lowest = before;
  for (int k = 0; k < 6 * kSecond; ++k) {
    if (k % 10 == 0) rig.give(walk_command(2 + k / 10, 0.0, 0.0, 0.0));
    rig.tick();
    lowest = std::min(lowest, rig.trace().x_ref[5]);
  }
  CHECK_FALSE(rig.simulator.fallen());
  CHECK(lowest < before - 0.01);
  CHECK(std::abs(rig.trace().x_ref[5] - before) < 0.1 * crouch);
}

TEST_CASE("APushWithinTheStancesReachTakesNoStep") {
  sim::Scenario scenario = quiet_stand();
  scenario.pushes = {push(0.5, 0.0, 30.0, 0.0)};
  BipedRig rig(scenario);
  for (int k = 0; k < 3 * kSecond; ++k) {
    rig.tick();
    REQUIRE(rig.trace().behaviour == Behaviour::kStand);
  }
  CHECK_FALSE(rig.simulator.fallen());
}

TEST_CASE("ThePlanSaysWhichFeetBearAndTheSwingFootBearsNothing") {
  BipedRig rig;
  rig.tick_times(kSettled);
  rig.give(walk_command(1, 0.3, 0.0, 0.0));
  int single = 0;
  for (int k = 0; k < 3 * kSecond; ++k) {
    rig.tick();
    const ForcePlan& plan = rig.ticker.output().plan;
    REQUIRE((plan.contact[0][0] || plan.contact[0][1]));
    for (std::size_t foot = 0; foot < 2; ++foot) {
      if (plan.contact[0][foot]) continue;
      ++single;
      REQUIRE(plan.force[0][foot].norm() < 1e-6);
    }
  }
  CHECK(single > kSecond);
}

TEST_CASE("WhereTheQpFailsWhileItWalksThePlanGoesOnUntilTheLadderEndsIt") {
  // One step of either engine is enough for a quiet walk and too few for a push.
  config::RobotDescription robot = test::biped_with("controller.force_qp.max_iterations", "1");
  robot = config::robot_from_texts(with_engine(robot.yaml_text, "structured"), robot.urdf_text);
  const int hold_ticks =
      static_cast<int>(std::lround(config::biped_config(robot).fault_ladder.hold_time / kControlPeriod));
  for (const bool too_late : {false, true}) {
    CAPTURE(too_late);
    sim::Scenario scenario = quiet_stand();
    scenario.pushes = {push(2.0, 150.0, 100.0, 0.0)};
    BipedRig rig(scenario, robot);
    rig.time_left_us = too_late ? 500 : loop::kWholePeriodUs;
    rig.give(walk_command(1, 0.3, 0.0, 0.0));
    ForcePlan last;
    int ticks = 0;
    for (; ticks < 3 * kSecond && !rig.has(Fault::kQpFailed); ++ticks) {
      last = rig.ticker.output().plan;
      rig.tick();
    }
    REQUIRE(rig.has(Fault::kQpFailed));
    CHECK(ticks > 2 * kSecond);
    CHECK(rig.trace().behaviour == Behaviour::kWalk);
    CHECK(rig.trace().qp_status == QpStatus::kMaxIterations);
    CHECK(rig.trace().qp_engine == (too_late ? QpEngine::kStructured : QpEngine::kOsqpSparse));
    for (int k = 0; k < hold_ticks && rig.has(Fault::kQpFailed); ++k) {
      CHECK(rig.trace().safety == SafetyMode::kHold);
      const ForcePlan& plan = rig.ticker.output().plan;
      REQUIRE(shift_plan(last, kControlPeriod, plan.contact.front()));
      CHECK(plan.num_stages == last.num_stages);
      CHECK(plan.stage_duration == last.stage_duration);
      CHECK(plan.force == last.force);
      CHECK(plan.p_WC == last.p_WC);
      rig.tick();
    }
  }
}

TEST_CASE("WhereUserCommandsCeaseItStopsAndStands") {
  const double timeout = config::biped_config(test::biped()).intake.user_command_timeout;
  const int ticks = static_cast<int>(std::lround(timeout / kControlPeriod));
  BipedRig rig;
  rig.tick_times(kSettled);
  rig.give(walk_command(1, 0.4, 0.0, 0.2));
  rig.tick_times(4 * kSecond + 1);  // the last command came a tick ago
  const Vector3 wanted = rig.trace().gait.velocity_wanted;
  CHECK(wanted.x() == 0.4);
  rig.fall_silent();
  rig.tick_times(ticks);
  CHECK(rig.trace().gait.velocity_wanted == wanted);
  rig.tick();
  CHECK(rig.trace().gait.velocity_wanted.x() < wanted.x());
  CHECK(rig.trace().gait.velocity_wanted.z() < wanted.z());
  rig.tick_times(6 * kSecond);
  CHECK(rig.trace().behaviour == Behaviour::kStand);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK_FALSE(rig.simulator.fallen());
  CHECK(std::abs(rig.simulator.truth().v_WC[0]) < 0.02);
  // Heard again, it walks again.
  rig.give(walk_command(1000, 0.4, 0.0, 0.0));
  rig.tick_times(2 * kSecond);
  CHECK(rig.trace().behaviour == Behaviour::kWalk);
  CHECK(rig.trace().gait.velocity_wanted.x() == 0.4);
}

TEST_CASE("AUserCommandAgesByTicksThatWereMissedToo") {
  BipedRig rig;
  rig.tick_times(kSettled);
  rig.give(walk_command(1, 0.4, 0.0, 0.0));
  rig.tick_times(2 * kSecond + 1);
  REQUIRE(rig.trace().gait.velocity_wanted.x() == 0.4);
  loop::NoClock clock;
  REQUIRE(rig.ticker.offer_state(test::bytes_of(rig.state())));
  rig.ticker.tick(51, clock);
  CHECK(rig.trace().gait.velocity_wanted.x() < 0.4);
}

}  // namespace stance::behaviours
