// The whole controller in the loop with the simulator: it stands, and each fault does what biped.yaml says. Times are
// in ticks of kControlPeriod.
#include "controller/behaviours/biped_controller.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "controller/config/biped_config_yaml.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::behaviours {
namespace {

using stance_msgs::robot_state_t;
using stance_msgs::user_command_t;
using test::Answer;
using test::answer_of;
using test::biped;
using test::biped_with;
using test::BipedRig;
using test::bytes_of;
using test::ByteVector;
using test::push;
using test::quiet_stand;

constexpr double kQuietTilt = 0.5 * M_PI / 180.0;      // rad, standing on perfect sensors
constexpr double kRecoveredTilt = 2.0 * M_PI / 180.0;  // rad, 2 s after a disturbance
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kSettled = 20;  // ticks
constexpr std::int64_t kRun = 7;

const BipedConfig& configuration() {
  static const BipedConfig config = config::biped_config(biped());
  return config;
}
int ticks_in(double seconds) { return static_cast<int>(std::lround(seconds / kControlPeriod)); }
int hold_ticks() { return ticks_in(configuration().fault_ladder.hold_time); }
int damp_ticks() { return ticks_in(configuration().fault_ladder.damp_time); }

void check_same(const JointCommand& a, const JointCommand& b) {
  CHECK(a.mode == b.mode);
  CHECK(a.num_joints == b.num_joints);
  CHECK(a.feedforward_torque == b.feedforward_torque);
  CHECK(a.position == b.position);
  CHECK(a.velocity == b.velocity);
  CHECK(a.kp == b.kp);
  CHECK(a.kd == b.kd);
}

void check_damps(const JointCommand& command) {
  CHECK(command.mode == DriveMode::kDamp);
  CHECK(command.num_joints == 8);
  CHECK(command.feedforward_torque.isZero());
  CHECK(command.kp.isZero());
  CHECK(command.kd == configuration().damping);
}

/// From here on `fault_tick` is what happens each tick: holds what was commanded last, damps, stops, at the times of
/// the configuration, counting the fault each tick.
template <typename FaultTick>
void check_holds_damps_stops(BipedRig& rig, Fault fault, const FaultTick& fault_tick) {
  const JointCommand last = rig.command();
  REQUIRE(last.mode == DriveMode::kActive);
  std::int64_t count = rig.count(fault);
  const auto next = [&] {
    fault_tick();
    CHECK(rig.has(fault));
    CHECK(rig.count(fault) == ++count);
  };
  for (int k = 0; k < hold_ticks(); ++k) {
    next();
    CHECK(rig.trace().safety == SafetyMode::kHold);
    check_same(rig.command(), last);
  }
  for (int k = 0; k < damp_ticks(); ++k) {
    next();
    REQUIRE(rig.trace().safety == SafetyMode::kDamp);
    check_damps(rig.command());
  }
  next();
  CHECK(rig.trace().safety == SafetyMode::kStop);
  CHECK(rig.command().mode == DriveMode::kStop);
  CHECK(rig.command().kd.isZero());
}

user_command_t stand_command(std::int64_t seq, double height_offset) {
  user_command_t command{};
  command.seq = seq;
  command.height_offset = height_offset;
  return command;
}

/// With one iteration of OSQP, which is enough where no force reaches its limits, and nowhere else.
config::RobotDescription starved_of_iterations() {
  const config::RobotDescription robot = biped_with("controller.force_qp.max_iterations", "1");
  return config::robot_from_texts(with_engine(robot.yaml_text, "osqp-sparse"), robot.urdf_text);
}

}  // namespace

TEST_CASE("OnPerfectSensorsItStandsUprightWithoutAFault") {
  BipedRig rig;
  double worst = 0.0;
  for (int k = 0; k < 300; ++k) {
    rig.tick();
    worst = std::max(worst, rig.tilt());
    REQUIRE(rig.trace().safety == SafetyMode::kRun);
    REQUIRE(rig.trace().faults == 0);
    REQUIRE(rig.trace().qp_status == QpStatus::kSolved);
  }
  CHECK(worst < kQuietTilt);
  CHECK(rig.simulator.refused().total() == 0);
  for (const std::int64_t count : rig.trace().fault_count) CHECK(count == 0);
}

TEST_CASE("WithoutStatesItHoldsTheLastCommandThenDampsThenStops") {
  BipedRig rig;
  rig.tick_times(kSettled);
  check_holds_damps_stops(rig, Fault::kStateStale, [&] { rig.tick_without_state(); });
  rig.tick_times(10);
  CHECK(rig.trace().safety == SafetyMode::kStop);
}

TEST_CASE("StatesThatReturnWithinTheHoldTimeAreTakenUpAgainAndItStands") {
  BipedRig rig;
  rig.tick_times(kSettled);
  for (int k = 0; k < hold_ticks(); ++k) rig.tick_without_state();
  REQUIRE(rig.trace().safety == SafetyMode::kHold);
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.trace().faults == 0);
  rig.tick_times(200);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.tilt() < kRecoveredTilt);
  CHECK(rig.count(Fault::kStateStale) == hold_ticks());
}

TEST_CASE("StatesThatReturnWhileItDampsAreTakenUpAgain") {
  BipedRig rig;
  rig.tick_times(kSettled);
  for (int k = 0; k < hold_ticks() + 1; ++k) rig.tick_without_state();
  REQUIRE(rig.trace().safety == SafetyMode::kDamp);
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.command().mode == DriveMode::kActive);
  rig.tick_times(200);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.tilt() < kRecoveredTilt);
}

TEST_CASE("AStateThatIsNotFiniteOrNotBelievableIsHeldOut") {
  const std::vector<void (*)(robot_state_t&)> spoilers{
      [](robot_state_t& s) { s.gyro[1][2] = kNan; },
      [](robot_state_t& s) { s.gyro[0][0] = kInfinity; },
      [](robot_state_t& s) { s.accelerometer[0][1] = -kInfinity; },
      [](robot_state_t& s) { s.accelerometer[1][2] = 1000.0; },
      [](robot_state_t& s) { s.joint_position[1][3] = kNan; },
      [](robot_state_t& s) { s.joint_position[0][1] = 10.0; },
      [](robot_state_t& s) { s.joint_velocity[1][7] = -1e300; },
      [](robot_state_t& s) { s.joint_torque[5] = kNan; },
      [](robot_state_t& s) { s.sample_period = 0.0; },
      [](robot_state_t& s) { s.num_joints = 1000; },
      [](robot_state_t& s) { s.num_contacts = -1; },
  };
  for (std::size_t i = 0; i < spoilers.size(); ++i) {
    CAPTURE(i);
    BipedRig rig;
    rig.tick_times(kSettled);
    const JointCommand last = rig.command();
    robot_state_t state = rig.state();
    spoilers[i](state);
    rig.tick_with(state);
    CHECK(rig.has(Fault::kStateInvalid));
    CHECK(rig.trace().safety == SafetyMode::kHold);
    check_same(rig.command(), last);
    rig.tick();
    CHECK(rig.trace().safety == SafetyMode::kRun);
    CHECK(rig.count(Fault::kStateInvalid) == 1);
    CHECK(rig.trace().estimate.p_WB.allFinite());
    CHECK(rig.command().position.allFinite());
  }
}

TEST_CASE("StatesThatStayInvalidHoldDampAndStop") {
  BipedRig rig;
  rig.tick_times(kSettled);
  check_holds_damps_stops(rig, Fault::kStateInvalid, [&] {
    robot_state_t state = rig.state();
    state.gyro[1][0] = kNan;
    rig.tick_with(state);
  });
}

TEST_CASE("AStateWhoseNumberOrStampJumpsIsInvalidAndTheRunGoesOn") {
  const std::vector<void (*)(robot_state_t&)> spoilers{
      [](robot_state_t& s) { s.utime += 3'600'000'000; },
      [](robot_state_t& s) { s.utime += 6'000; },
      [](robot_state_t& s) { s.seq += 1; },
      [](robot_state_t& s) { s.seq = std::numeric_limits<std::int64_t>::max(); },
      [](robot_state_t& s) { s.utime = std::numeric_limits<std::int64_t>::max(); },
  };
  for (std::size_t i = 0; i < spoilers.size(); ++i) {
    CAPTURE(i);
    BipedRig rig;
    rig.tick_times(kSettled);
    robot_state_t state = rig.state();
    spoilers[i](state);
    rig.tick_with(state);
    CHECK(rig.has(Fault::kStateInvalid));
    CHECK(rig.trace().safety == SafetyMode::kHold);
    rig.tick();
    CHECK(rig.trace().safety == SafetyMode::kRun);
    // States that were lost are none that jump.
    for (int k = 0; k < 2; ++k) rig.simulator.advance();
    rig.tick();
    CHECK(rig.trace().faults == 0);
  }
}

TEST_CASE("AStateOutOfOrderIsInvalid") {
  BipedRig rig;
  rig.tick_times(kSettled);
  const robot_state_t good = rig.state();
  robot_state_t older = good;
  older.seq -= 2;
  rig.tick_with(older);
  CHECK(rig.has(Fault::kStateInvalid));
  CHECK(rig.trace().safety == SafetyMode::kHold);
  robot_state_t same_stamp = rig.state();
  same_stamp.utime = good.utime - 10'000;
  rig.tick_with(same_stamp);
  CHECK(rig.has(Fault::kStateInvalid));
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.count(Fault::kStateInvalid) == 2);
}

TEST_CASE("AnInvalidFirstStateDampsSinceThereIsNothingToHold") {
  for (const std::int64_t run_id : {std::int64_t{0}, kRun}) {
    CAPTURE(run_id);
    BipedRig rig(quiet_stand(), biped(), run_id);
    robot_state_t state = rig.state();
    state.gyro[1][0] = kNan;
    rig.tick_with(state);
    CHECK(rig.has(Fault::kStateInvalid));
    check_damps(rig.command());
    CHECK(rig.simulator.refused().total() == 0);
    rig.tick();
    CHECK(rig.trace().safety == SafetyMode::kRun);
    CHECK(rig.command().mode == DriveMode::kActive);
  }
}

TEST_CASE("AnOperatorsStopDampsAtOnceThenStopsWhateverComes") {
  BipedRig rig;
  rig.tick_times(kSettled);
  rig.press_stop(1);
  for (int k = 0; k < damp_ticks(); ++k) {
    rig.tick();
    REQUIRE(rig.trace().safety == SafetyMode::kDamp);
    CHECK(rig.has(Fault::kOperatorStop));
    check_damps(rig.command());
  }
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kStop);
  CHECK(rig.command().mode == DriveMode::kStop);
  rig.give(stand_command(9, 0.0));
  rig.tick_times(50);
  CHECK(rig.trace().safety == SafetyMode::kStop);
}

TEST_CASE("AStopBeforeTheFirstStateKeepsTheRobotFromStanding") {
  BipedRig rig;
  rig.press_stop(1);
  for (int k = 0; k < 10; ++k) {
    rig.tick();
    CHECK(rig.trace().safety == SafetyMode::kDamp);
    check_damps(rig.command());
  }
}

TEST_CASE("ARobotPushedOverIsFallenDampsAndStops") {
  // No steps that might save it.
  sim::Scenario scenario = quiet_stand();
  scenario.pushes = {push(0.2, 0.0, 300.0, 0.0)};
  BipedRig rig(scenario, biped_with("controller.stepping",
                                    "{capture: [9, 9], capture_pitch: 9, capture_lead: 0, min_steps: 1, "
                                    "settled: [1, 1], settled_feet: 1, settled_pitch: 1}"));
  int ticks = 0;
  while (!rig.has(Fault::kRobotFallen) && ticks < 400) rig.tick(), ++ticks;
  REQUIRE(rig.has(Fault::kRobotFallen));
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  CHECK(rig.count(Fault::kRobotFallen) == 1);
  check_damps(rig.command());
  // No forces from now on, and so no torques to limit.
  const std::int64_t saturated = rig.count(Fault::kTorqueSaturated);
  CHECK(rig.ticker.output().plan.num_stages == 0);
  CHECK(rig.ticker.output().plan.force.front() == zero_contact_vectors());
  CHECK(rig.trace().effort == 0.0);
  rig.tick_times(damp_ticks() - 1);
  CHECK(rig.count(Fault::kTorqueSaturated) == saturated);
  CHECK(rig.trace().torques_clipped == 0);
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kStop);
  CHECK(rig.simulator.fallen());
}

TEST_CASE("AControllerStartedOnALyingRobotSaysFallenAndDampsFromTheFirstTick") {
  sim::Scenario scenario = quiet_stand();
  scenario.initial.roll_pitch_yaw = {0.3, 0.1, 0.0};
  BipedRig rig(scenario);
  for (int k = 0; k < 300; ++k) rig.simulator.advance();
  REQUIRE(rig.simulator.fallen());
  constexpr int ticks = 50;
  for (int k = 0; k < ticks; ++k) {
    rig.tick();
    CHECK(rig.has(Fault::kRobotFallen));
    CHECK(rig.trace().safety == SafetyMode::kDamp);
    check_damps(rig.command());
  }
  CHECK(rig.count(Fault::kRobotFallen) == ticks);
  CHECK(rig.simulator.refused().total() == 0);
  CHECK(rig.simulator.truth().drives_damped == 0);
}

TEST_CASE("TorquesBeyondTheLimitsAreClippedAndCounted") {
  sim::Scenario scenario = quiet_stand();
  scenario.pushes = {push(0.2, 0.0, 0.0, -1500.0)};
  BipedRig rig(scenario);
  std::int64_t saturated = 0;
  for (int k = 0; k < 60; ++k) {
    rig.tick();
    if (rig.has(Fault::kTorqueSaturated)) {
      ++saturated;
      CHECK(rig.trace().torques_clipped > 0);
    } else {
      CHECK(rig.trace().torques_clipped == 0);
    }
    CHECK(rig.count(Fault::kTorqueSaturated) == saturated);
    for (int i = 0; i < 8; ++i) {
      const double limit = rig.robot.model.joints[static_cast<std::size_t>(i)].max_torque;
      CHECK(std::abs(rig.command().feedforward_torque[i]) <= limit);
    }
  }
  CHECK(saturated > 0);
}

TEST_CASE("AJointOutsideItsLimitsIsCountedAndTheRobotStands") {
  BipedRig rig;
  rig.tick_times(kSettled);
  robot_state_t state = rig.state();
  const double limit = rig.robot.model.joints[0].upper;
  state.joint_position[0][0] = state.joint_position[1][0] = limit + 0.01;
  rig.tick_with(state);
  CHECK(rig.has(Fault::kJointLimit));
  CHECK(rig.count(Fault::kJointLimit) == 1);
  CHECK(rig.trace().safety == SafetyMode::kRun);
}

TEST_CASE("AUserCommandThatIsUnknownNotOfferedNotFiniteOrOutOfRangeIsCountedOnceAndIgnored") {
  const std::vector<void (*)(user_command_t&)> spoilers{
      [](user_command_t& c) { c.behaviour = 99; },
      [](user_command_t& c) { c.behaviour = -1; },
      [](user_command_t& c) { c.behaviour = 4; },
      [](user_command_t& c) { c.velocity[0] = kNan; },
      [](user_command_t& c) { c.velocity[1] = kInfinity; },
      [](user_command_t& c) { c.yaw_rate = kNan; },
      [](user_command_t& c) { c.height_offset = kInfinity; },
      [](user_command_t& c) { c.height_offset = configuration().height.offset_range[0] - 1e-6; },
      [](user_command_t& c) { c.height_offset = configuration().height.offset_range[1] + 1e-6; },
  };
  BipedRig undisturbed;
  undisturbed.tick_times(kSettled + 10);
  for (std::size_t i = 0; i < spoilers.size(); ++i) {
    CAPTURE(i);
    BipedRig rig;
    rig.tick_times(kSettled);
    user_command_t command = stand_command(1, -0.05);
    spoilers[i](command);
    rig.give(command);
    rig.tick();
    CHECK(rig.has(Fault::kCommandInvalid));
    CHECK(rig.trace().safety == SafetyMode::kRun);
    rig.tick_times(9);
    CHECK(rig.count(Fault::kCommandInvalid) == 1);
    CHECK(rig.trace().behaviour == Behaviour::kStand);
    check_same(rig.command(), undisturbed.command());
  }
}

TEST_CASE("AHeightThatTheOperatorWantsIsTakenToTheEndsOfItsRange") {
  constexpr double tolerance = 0.005;  // m
  const auto [lowest, highest] = configuration().height.offset_range;
  for (const double wanted : {lowest, -0.03, highest}) {
    CAPTURE(wanted);
    BipedRig rig;
    rig.tick_times(kSettled);
    const double before = rig.simulator.truth().p_WC[2];
    rig.give(stand_command(1, wanted));
    rig.tick_times(600);
    CHECK(rig.count(Fault::kCommandInvalid) == 0);
    CHECK(rig.trace().safety == SafetyMode::kRun);
    CHECK(std::abs(rig.simulator.truth().p_WC[2] - before - wanted) < tolerance);
  }
}

TEST_CASE("WhereTheQpFailsTheLastPlanIsHeldThenItDampsThenStops") {
  // The QP fails as soon as a force reaches its limits, which a push sees to.
  sim::Scenario scenario = quiet_stand();
  scenario.pushes = {{.time = 0.2, .duration = 10.0, .force_W = {0.0, 60.0, 0.0}, .point_B = Vector3::Zero()}};
  BipedRig rig(scenario, starved_of_iterations());
  ForcePlan last;
  JointCommand command;
  int ticks = 0;
  while (!rig.has(Fault::kQpFailed) && ticks < 100) {
    last = rig.ticker.output().plan;
    rig.tick();
    ++ticks;
  }
  REQUIRE(rig.has(Fault::kQpFailed));
  CHECK(ticks > 20);
  CHECK(rig.trace().qp_status == QpStatus::kMaxIterations);
  for (int k = 1; k <= hold_ticks(); ++k) {
    CHECK(rig.trace().safety == SafetyMode::kHold);
    CHECK(rig.command().mode == DriveMode::kActive);
    CHECK(rig.ticker.output().plan.force == last.force);
    CHECK(rig.count(Fault::kQpFailed) == k);
    rig.tick();
  }
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  check_damps(rig.command());
}

TEST_CASE("WhereTheFirstQpOfARunFailsThereIsNothingToHoldAndItDampsUntilOneSolves") {
  BipedRig rig(quiet_stand(), starved_of_iterations());
  // It seems to turn over: what balances that is beyond the forces' limits.
  robot_state_t state = rig.state();
  state.gyro[1][0] = 5.0;
  rig.tick_with(state);
  CHECK(rig.has(Fault::kQpFailed));
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  check_damps(rig.command());
  CHECK(rig.ticker.output().plan.num_stages == 0);
  rig.tick_times(5);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.command().mode == DriveMode::kActive);
  CHECK(rig.count(Fault::kQpFailed) == 1);
}

TEST_CASE("AQpThatSolvesAgainWithinTheHoldTimeIsTakenUpAgainAndItStands") {
  BipedRig rig(quiet_stand(), starved_of_iterations());
  rig.tick_times(kSettled);
  const ForcePlan last = rig.ticker.output().plan;
  // For one state it seems to turn over: what balances that is beyond the forces' limits.
  robot_state_t state = rig.state();
  state.gyro[1][0] = 5.0;
  rig.tick_with(state);
  CHECK(rig.has(Fault::kQpFailed));
  CHECK(rig.trace().safety == SafetyMode::kHold);
  CHECK(rig.ticker.output().plan.force == last.force);
  rig.tick();
  CHECK(rig.trace().qp_status == QpStatus::kSolved);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  rig.tick_times(200);
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.count(Fault::kQpFailed) == 1);
  CHECK(rig.tilt() < kRecoveredTilt);
}

TEST_CASE("AnotherRunIdStartsAFreshController") {
  sim::Scenario scenario = quiet_stand();
  scenario.pushes = {push(0.3, 3.0, 20.0, 0.0)};
  BipedRig first(scenario), fresh(scenario, biped(), kRun + 1);
  // A first run with everything that leaves a trace behind: a push, a height, faults, a stop, STOP.
  first.give(stand_command(3, -0.02));
  first.tick_times(60);
  first.tick_without_state();
  first.press_stop(1);
  first.tick_times(damp_ticks() + 10);
  REQUIRE(first.trace().safety == SafetyMode::kStop);

  BipedController used(configuration(), first.robot.model, first.robot.feet, first.robot.nominal_joint_position);
  BipedController unused(configuration(), first.robot.model, first.robot.feet, first.robot.nominal_joint_position);
  loop::NoClock clock;
  const auto step = [&](BipedController& controller, const TickInput& input) {
    TickOutput out;
    controller.step(input, clock, out);
    const io::Header header{};
    Answer answer;
    io::Message message;
    io::encode(header, out.plan, message);
    answer.plan = bytes_of(message);
    io::encode(header, out.command, message);
    answer.command = bytes_of(message);
    io::encode(header, io::Consumed{}, out.trace, message);
    answer.trace = bytes_of(message);
    return answer;
  };
  TickInput input;
  for (const ByteVector& bytes : test::recorded_states(scenario, 100, kRun)) {
    REQUIRE(io::decode(bytes, input.state));
    input.state_is_new = input.state.seq != 50;
    input.operator_stop = input.state.seq > 90;
    input.user_command.seq = 5;
    input.user_command.height_offset = 0.03;
    step(used, input);
  }
  input = TickInput{};
  input.state_is_new = true;
  for (const ByteVector& bytes : test::recorded_states(scenario, 100, kRun + 1)) {
    REQUIRE(io::decode(bytes, input.state));
    REQUIRE(step(used, input) == step(unused, input));
  }

  // The whole tick, too: only the count of ticks goes on.
  for (int k = 0; k < 100; ++k) {
    const robot_state_t state = fresh.state();
    fresh.tick();
    loop::NoClock no_clock;
    REQUIRE(first.ticker.offer_state(bytes_of(state)));
    first.ticker.tick(1, no_clock);
    check_same(first.command(), fresh.command());
    REQUIRE(first.trace().safety == fresh.trace().safety);
    REQUIRE(first.trace().fault_count == fresh.trace().fault_count);
    REQUIRE(first.trace().x == fresh.trace().x);
  }
}

TEST_CASE("ASenderThatCountsFromOneAgainStartsAFreshController") {
  BipedRig rig, restarted;
  rig.give(stand_command(4, -0.1));
  rig.tick_times(30);
  for (int k = 0; k < hold_ticks() + damp_ticks() + 1; ++k) rig.tick_without_state();
  REQUIRE(rig.trace().safety == SafetyMode::kStop);
  loop::NoClock clock;
  for (int k = 0; k < 50; ++k) {
    REQUIRE(rig.ticker.offer_state(bytes_of(restarted.state())));
    rig.ticker.tick(1, clock);
    restarted.tick();
    REQUIRE(rig.trace().safety == SafetyMode::kRun);
    check_same(rig.command(), restarted.command());
  }
}

TEST_CASE("AnOperatorsStopOutlastsASenderThatCountsFromOneAgainUntilAnotherRunId") {
  BipedRig rig, restarted, another(quiet_stand(), biped(), kRun + 1);
  rig.tick_times(30);
  rig.press_stop(1);
  rig.tick_times(5);
  rig.tick_with(restarted.state());
  CHECK(rig.has(Fault::kOperatorStop));
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  rig.tick_with(another.state());
  CHECK(rig.trace().faults == 0);
  CHECK(rig.trace().safety == SafetyMode::kRun);
}

TEST_CASE("AModelThatIsNoBipedIsRefused") {
  const config::RobotDescription robot = biped();
  CHECK_THROWS_AS(BipedController(configuration(), robot.model, {robot.feet[0]}, robot.nominal_joint_position),
                  std::invalid_argument);
  BipedConfig config = configuration();
  config.torque_map.lead = -1.0;
  CHECK_THROWS_AS(BipedController(config, robot.model, robot.feet, robot.nominal_joint_position),
                  std::invalid_argument);
}

}  // namespace stance::behaviours
