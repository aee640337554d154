// The 3-joint arm in the loop with the simulator: it plays document 004's motion and follows it by torque, and each
// fault does what arm3.yaml says. Times are in ticks of kControlPeriod.
#include "controller/behaviours/arm3_controller.hpp"

#include <algorithm>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <cmath>
#include <limits>
#include <stance_msgs/arm3_motion_t.hpp>
#include <vector>

#include "controller/config/arm3_config_yaml.hpp"
#include "tests/loop/arm3_rig.hpp"
#include "tests/support/golden.hpp"

namespace stance::behaviours {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;
using test::arm3;
using test::arm3_with;
using test::Arm3Rig;
using test::quiet_arm;

constexpr double kGolden = 1e-10;
constexpr double kOrthonormal = 1e-12;
constexpr double kJumpError = 5e-3;    // rad, of a joint behind a reference that jumps by 0.8 rad/s
constexpr double kSmoothError = 1e-4;  // rad, behind one that does not
constexpr int kSettled = 20;           // ticks
constexpr int kMotion = 1600;          // steps of the document's

const Arm3Config& configuration() {
  static const Arm3Config config = config::arm3_config(arm3());
  return config;
}
int ticks_in(double seconds) { return static_cast<int>(std::lround(seconds / kControlPeriod)); }

double orthonormality_defect(const Eigen::Matrix4d& map) {
  const Matrix3 R = map.topLeftCorner<3, 3>();
  return (R.transpose() * R - Matrix3::Identity()).cwiseAbs().maxCoeff();
}

/// A rig that plays a motion from its first tick on.
struct Playing : Arm3Rig {
  explicit Playing(Behaviour behaviour, const sim::Scenario& scenario = quiet_arm(),
                   const config::RobotDescription& arm = arm3())
      : Arm3Rig(scenario, arm) {
    want(behaviour);
  }

  /// One tick; the error is of the instant that it begins with.
  double tick_error() {
    const Vector3 theta = true_theta();
    tick();
    return (theta - motion().theta).cwiseAbs().maxCoeff();
  }
};

}  // namespace

TEST_CASE("AnArmPlaysTheDocumentsMotionStepByStep") {
  Playing rig(Behaviour::kTrack);
  const YAML::Node samples = test::load_golden("map_update004.json")["trajectory_as_printed"];
  std::size_t sample = 0;
  for (int k = 1; k <= kMotion; ++k) {
    rig.tick();
    const Arm3Motion& motion = rig.motion();
    REQUIRE(motion.step == k);
    CHECK(motion.given_rate == kinematics::arm3_given_rates((k - 1) * kControlPeriod));
    CHECK((motion.calculated_rate - motion.given_rate).cwiseAbs().maxCoeff() < kGolden);
    CHECK(motion.dp == Vector3(motion.v * kControlPeriod));
    CHECK(motion.dphi == Vector3(motion.omega * kControlPeriod));
    CHECK(orthonormality_defect(motion.map) < kOrthonormal);
    const Vector3 after = motion.theta + motion.calculated_rate * kControlPeriod;
    const Vector3 error =
        motion.map.topRightCorner<3, 1>() - kinematics::arm3_forward(configuration().geometry, after).p;
    if (k == 600) CHECK(error.norm() <= 3e-3);
    if (k == kMotion) CHECK(error.norm() <= 6e-3);
    if (sample == samples.size() || samples[sample]["n"].as<int>() != k) continue;
    const YAML::Node& golden = samples[sample++];
    CHECK((after - test::golden_vector<3>(golden, "theta")).cwiseAbs().maxCoeff() < kGolden);
    CHECK((motion.v - test::golden_vector<3>(golden, "v")).cwiseAbs().maxCoeff() < kGolden);
    CHECK((motion.omega - test::golden_vector<3>(golden, "omega")).cwiseAbs().maxCoeff() < kGolden);
    CHECK((motion.map - test::golden_matrix<4, 4>(golden, "map_exact")).cwiseAbs().maxCoeff() < kGolden);
  }
  CHECK(sample == samples.size());
}

TEST_CASE("AnArmFollowsTheDocumentsJumpsWithoutSaturating") {
  Playing rig(Behaviour::kTrack);
  double largest = 0.0;
  for (int k = 0; k < kMotion + 100; ++k) {
    largest = std::max(largest, rig.tick_error());
    CHECK(rig.command().mode == DriveMode::kActive);
    CHECK(rig.trace().faults == 0);
    for (int i = 0; i < 3; ++i) {
      CHECK(std::abs(rig.simulator.truth().joint_torque[i]) < 0.6 * rig.robot.model.joints[i].max_torque);
    }
  }
  CHECK(largest < kJumpError);
  CHECK(rig.tick_error() < kSmoothError);  // a second after the last jump
  CHECK(rig.simulator.refused().total() == 0);
}

TEST_CASE("AnArmFollowsTheSmoothMotionAsIfItHadNoMass") {
  Playing rig(Behaviour::kTrackSmooth);
  double largest = 0.0;
  const int ticks = ticks_in(configuration().track.smooth_duration);
  for (int k = 0; k < ticks; ++k) {
    largest = std::max(largest, rig.tick_error());
    CHECK(rig.trace().behaviour == Behaviour::kTrackSmooth);
  }
  CHECK(largest < kSmoothError);
  CHECK(rig.motion().step == ticks);
  rig.tick_times(2);
  CHECK(rig.motion().given_rate.isZero());
}

TEST_CASE("AnArmHeavierThanItsControllerBelievesFollowsByItsGains") {
  sim::Scenario scenario = quiet_arm();
  scenario.limb_mass_factor = 1.3;
  Playing rig(Behaviour::kTrack, scenario);
  double largest = 0.0;
  for (int k = 0; k < kMotion; ++k) largest = std::max(largest, rig.tick_error());
  CHECK(largest > kSmoothError);
  CHECK(largest < 0.05);
}

TEST_CASE("AnArmThatIsToldNothingHoldsStillWhereItIs") {
  const Vector3 start(0.4, 1.1, -0.7);
  Arm3Rig rig(quiet_arm(start));
  for (int k = 0; k < 200; ++k) {
    rig.tick();
    CHECK(rig.motion().step == 0);
    CHECK(rig.motion().v.isZero());
    CHECK((rig.true_theta() - start).cwiseAbs().maxCoeff() < 1e-3);  // it falls until the first command comes
  }
  CHECK(rig.trace().behaviour == Behaviour::kStand);
}

TEST_CASE("AMotionBeginsAnewWhenItIsAskedForAnew") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(300);
  CHECK(rig.motion().step == 300);
  rig.want(Behaviour::kStand);
  rig.tick_times(kSettled);
  const Vector3 theta = rig.motion().theta;
  CHECK(rig.motion().step == 0);
  CHECK(theta.norm() > 0.1);
  rig.want(Behaviour::kTrack);
  rig.tick();
  CHECK(rig.motion().step == 1);
  CHECK(rig.motion().theta == theta);
  // Its map begins where the arm is.
  const Vector3 place = kinematics::arm3_forward(configuration().geometry, theta).p;
  CHECK((rig.motion().map.topRightCorner<3, 1>() - place).norm() < kGolden);
}

TEST_CASE("AnArmWhoseOperatorIsHeardNoMoreHoldsStill") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(200);
  REQUIRE(rig.motion().given_rate.norm() > 0.1);
  rig.fall_silent();
  rig.tick_times(ticks_in(configuration().intake.user_command_timeout) + 1);
  CHECK(rig.trace().behaviour == Behaviour::kStand);
  CHECK(rig.motion().given_rate.isZero());
  CHECK(rig.trace().safety == SafetyMode::kRun);
}

TEST_CASE("ABehaviourThatAnArmHasNotIsRefusedAndTold") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(kSettled);
  for (const Behaviour behaviour : {Behaviour::kWalk, Behaviour::kCatch, Behaviour::kLieDown}) {
    rig.want(behaviour);
    rig.tick();
    CHECK(rig.has(Fault::kCommandInvalid));
    CHECK(rig.trace().behaviour == Behaviour::kTrack);
  }
}

TEST_CASE("AnArmHoldsItsCommandWithoutStatesThenDampsThenRunsAgainWhereItIs") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(300);
  const JointCommand held = rig.command();
  const int hold_ticks = ticks_in(configuration().fault_ladder.hold_time);
  for (int k = 0; k < hold_ticks; ++k) {
    rig.tick_without_state();
    CHECK(rig.trace().safety == SafetyMode::kHold);
    CHECK(rig.has(Fault::kStateStale));
    CHECK(rig.command().feedforward_torque == held.feedforward_torque);
  }
  for (int k = 0; k < 50; ++k) {
    rig.tick_without_state();
    CHECK(rig.trace().safety == SafetyMode::kDamp);
    CHECK(rig.command().mode == DriveMode::kDamp);
    CHECK(rig.command().kd == configuration().damping);
  }
  const Vector3 sunk = Eigen::Map<const Vector3>(rig.state().joint_position[kStateSamples - 1]);
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kRun);
  CHECK(rig.motion().theta == sunk);
  CHECK(rig.motion().step == 0);  // its motion is over
  rig.tick_times(kSettled);
  CHECK(rig.motion().step == 0);
  CHECK((rig.true_theta() - sunk).cwiseAbs().maxCoeff() < 0.05);
  rig.want(Behaviour::kTrackSmooth);
  rig.tick();
  CHECK(rig.motion().step == 1);
}

TEST_CASE("AnArmDoesNotActOnAStateThatIsNotFiniteOrOutOfOrder") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(kSettled);
  auto state = rig.state();
  state.joint_position[1][2] = std::numeric_limits<double>::quiet_NaN();
  rig.tick_with(state);
  CHECK(rig.has(Fault::kStateInvalid));
  CHECK(rig.trace().safety == SafetyMode::kHold);
  state = rig.state();
  state.seq -= 1;
  rig.tick_with(state);
  CHECK(rig.has(Fault::kStateInvalid));
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kRun);
}

TEST_CASE("AnOperatorsStopDampsTheArmAndThenTakesItsTorque") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(300);
  rig.press_stop(1);
  const int damp_ticks = ticks_in(configuration().fault_ladder.damp_time);
  for (int k = 0; k < damp_ticks; ++k) {
    rig.tick();
    CHECK(rig.trace().safety == SafetyMode::kDamp);
  }
  rig.want(Behaviour::kTrack);
  for (int k = 0; k < kSettled; ++k) {
    rig.tick();
    CHECK(rig.trace().safety == SafetyMode::kStop);
    CHECK(rig.command().mode == DriveMode::kStop);
    CHECK(rig.command().kd.isZero());
  }
}

TEST_CASE("AReferenceStopsShortOfAJointsLimitAndSaysSo") {
  Playing rig(Behaviour::kTrack, quiet_arm({2.6, 0.3, 0.5}));
  bool told = false;
  for (int k = 0; k < kMotion; ++k) {
    rig.tick();
    told = told || rig.has(Fault::kJointLimit);
    for (int i = 0; i < 3; ++i) {
      const auto& joint = rig.robot.model.joints[static_cast<std::size_t>(i)];
      CHECK(rig.motion().theta[i] <= joint.upper - configuration().track.limit_margin);
      CHECK(rig.true_theta()[i] < joint.upper);
    }
  }
  CHECK(told);
  CHECK(rig.trace().safety == SafetyMode::kRun);
}

TEST_CASE("ATorqueBeyondTheLimitIsClippedAndCounted") {
  Playing rig(Behaviour::kTrack, quiet_arm({0.0, 1.2, 0.3}), arm3_with("effort=\"30\"", "effort=\"4\""));
  rig.tick_times(kMotion + 2);  // up to the last jump
  CHECK(rig.count(Fault::kTorqueSaturated) > 0);
  CHECK(std::abs(rig.command().feedforward_torque[2]) <= 4.0);
}

TEST_CASE("AStalledTickMakesTheStepsGoodThatItMissed") {
  Playing rig(Behaviour::kTrack);
  rig.tick_times(250);
  const Arm3Motion before = rig.motion();
  // Three periods later, in one tick.
  for (int k = 0; k < 2; ++k) rig.simulator.advance();
  static_cast<void>(rig.ticker.offer_state(test::bytes_of(rig.state())));
  loop::NoClock clock;
  rig.ticker.tick(3, clock);
  CHECK(rig.motion().step == before.step + 3);
  CHECK((rig.motion().theta - before.theta - 3.0 * kControlPeriod * before.calculated_rate).norm() < 1e-4);
}

TEST_CASE("ANewRunOfAnArmStartsAfreshWithTheSameBytes") {
  const auto bytes = [](loop::Ticker& ticker, std::int64_t run_id) {
    Arm3Rig rig;
    loop::NoClock clock;
    std::vector<test::ByteVector> out;
    for (int k = 0; k < kSettled; ++k) {
      auto state = rig.state();
      state.run_id = run_id;
      REQUIRE(ticker.offer_state(test::bytes_of(state)));
      ticker.tick(1, clock);
      auto motion = test::decoded<stance_msgs::arm3_motion_t>(ticker.published().front().message.bytes());
      motion.seq = motion.run_id = 0;
      out.push_back(test::bytes_of(motion));
      rig.tick();
    }
    return out;
  };
  loop::Ticker ticker(compose(arm3()));
  const auto first = bytes(ticker, 7);
  CHECK(bytes(ticker, 8) == first);
}

TEST_CASE("AnArmPublishesItsMotionAndNoForcePlan") {
  Arm3Rig rig;
  rig.tick();
  std::vector<std::string> channels;
  for (const loop::Published& out : rig.ticker.published()) channels.emplace_back(out.channel);
  CHECK(channels == std::vector<std::string>{"ARM3_MOTION", "JOINT_COMMAND", "CONTROLLER_TRACE"});
  const auto motion = test::decoded<stance_msgs::arm3_motion_t>(rig.ticker.published().front().message.bytes());
  CHECK(motion.seq == rig.ticker.header().seq);
  CHECK(motion.state_seq == 1);
  CHECK(motion.map_A3[2][3] == 2.0);  // upright
}

TEST_CASE("WhatIsWrongWithAnArmsConfigurationIsNamed") {
  const auto refused = [](const std::string& from, const std::string& to, const std::string& message) {
    CHECK_THROWS_MATCHES(compose(arm3_with(from, to)), config::ConfigError,
                         MessageMatches(ContainsSubstring("arm3.yaml") && ContainsSubstring(message)));
  };
  refused("kd: 60.0", "dk: 60.0", "controller.track.kd is missing");
  refused("lead: 0.0055", "lead: 0.0055\n    laed: 0", "controller.track.laed is not a known key");
  refused("lead: 0.0055", "lead: 0.5", "track.lead is 0.5");
  refused("duration: 12.0", "duration: 0", "track.smooth.duration is 0");
  refused("user_command_timeout: 0.5", "user_command_timeout: 0", "user_command_timeout is 0");
  refused("hold_time: 0.03", "hold_time: -1", "safety.hold_time");
  refused("tool: tool", "tool: hand", "link 'hand' is not in the document");
}

TEST_CASE("AnArmThatIsNotTheDocumentsIsRefusedByWhatIsOtherwise") {
  const auto refused = [](const std::string& from, const std::string& to, const std::string& message) {
    CHECK_THROWS_MATCHES(compose(arm3_with(from, to)), config::ConfigError,
                         MessageMatches(ContainsSubstring("arm of document 004") && ContainsSubstring(message)));
  };
  refused("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 1 0\"/>", "joint 'theta1' must turn about z");
  refused("<origin xyz=\"0 0 1.0\"/>", "<origin xyz=\"0.1 0 1.0\"/>", "joint 'theta2' must stand on its parent's z");
  refused("<origin xyz=\"0 0 1.0\"/>", "<origin xyz=\"0 0 1.0\" rpy=\"0 0 1\"/>", "joint 'theta2' must not be turned");
  refused("rpy=\"3.141592653589793 -1.5707963267948966 0\"", "", "the tool must be turned as A(0) has it");
}

}  // namespace stance::behaviours
