#include "controller/safety/validation.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "tests/loop/biped_rig.hpp"

namespace stance::safety {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kJustMore = 1.0 + 1e-9;
constexpr ValidationConfig kConfig{.max_angular_velocity = 40.0,
                                   .max_acceleration = 200.0,
                                   .joint_position_margin = 0.1,
                                   .joint_velocity_factor = 2.0};

struct Fixture {
  config::RobotDescription robot = test::biped();
  const rigid_body::Model& model = robot.model;

  RobotState good() const {
    RobotState state;
    state.utime = 10'000;
    state.seq = 1;
    state.run_id = 1;
    state.num_joints = 8;
    state.num_contacts = 2;
    state.sample_period = 0.005;
    for (SensorSample& sample : state.samples) {
      sample.gyro = {0.1, -0.2, 0.3};
      sample.accelerometer = {0.1, -0.2, 9.8};
      sample.joint_position = robot.nominal_joint_position;
      sample.joint_velocity.setConstant(0.5);
    }
    state.joint_torque.setConstant(3.0);
    return state;
  }
  bool plausible(const RobotState& state) const { return state_is_plausible(kConfig, model, 2, state); }
};

/// A way to put a value into a state.
struct Field {
  std::string name;
  std::function<void(RobotState&, double)> set;
};

std::vector<Field> number_fields() {
  std::vector<Field> fields{{"sample_period", [](RobotState& s, double v) { s.sample_period = v; }}};
  for (std::size_t sample = 0; sample < kStateSamples; ++sample) {
    const std::string which = "samples[" + std::to_string(sample) + "].";
    for (int i = 0; i < 3; ++i) {
      fields.push_back({which + "gyro", [=](RobotState& s, double v) { s.samples[sample].gyro[i] = v; }});
      fields.push_back(
          {which + "accelerometer", [=](RobotState& s, double v) { s.samples[sample].accelerometer[i] = v; }});
    }
    for (int i = 0; i < kMaxJoints; ++i) {
      fields.push_back(
          {which + "joint_position", [=](RobotState& s, double v) { s.samples[sample].joint_position[i] = v; }});
      fields.push_back(
          {which + "joint_velocity", [=](RobotState& s, double v) { s.samples[sample].joint_velocity[i] = v; }});
    }
  }
  for (int i = 0; i < kMaxJoints; ++i) {
    fields.push_back({"joint_torque", [=](RobotState& s, double v) { s.joint_torque[i] = v; }});
  }
  return fields;
}

}  // namespace

TEST_CASE_METHOD(Fixture, "AGoodStateIsAccepted") { CHECK(plausible(good())); }

TEST_CASE_METHOD(Fixture, "AStateThatIsNotFiniteInAnyFieldIsRefused") {
  for (const Field& field : number_fields()) {
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      CAPTURE(field.name, bad);
      RobotState state = good();
      field.set(state, bad);
      CHECK_FALSE(plausible(state));
    }
  }
}

TEST_CASE_METHOD(Fixture, "AStateOfAnotherRobotsSizeIsRefused") {
  for (const int joints : {-1, 0, 7, 9, std::numeric_limits<int>::max()}) {
    RobotState state = good();
    state.num_joints = joints;
    CHECK_FALSE(plausible(state));
  }
  for (const int contacts : {-1, 0, 1, 3}) {
    RobotState state = good();
    state.num_contacts = contacts;
    CHECK_FALSE(plausible(state));
  }
}

TEST_CASE_METHOD(Fixture, "SamplesThatDoNotFitIntoTwoPeriodsAreRefused") {
  for (const double bad : {0.0, -0.005, 0.01, 1.0}) {
    RobotState state = good();
    state.sample_period = bad;
    CHECK_FALSE(plausible(state));
  }
  RobotState state = good();
  state.sample_period = 0.0099;
  CHECK(plausible(state));
}

TEST_CASE_METHOD(Fixture, "TheImuIsBelievedUpToItsLimitsOnEachAxisAndNoFurther") {
  for (std::size_t sample = 0; sample < kStateSamples; ++sample) {
    for (int i = 0; i < 3; ++i) {
      for (const double sign : {-1.0, 1.0}) {
        RobotState state = good();
        state.samples[sample].gyro[i] = sign * kConfig.max_angular_velocity;
        CHECK(plausible(state));
        state.samples[sample].gyro[i] *= kJustMore;
        CHECK_FALSE(plausible(state));

        state = good();
        state.samples[sample].accelerometer[i] = sign * kConfig.max_acceleration;
        CHECK(plausible(state));
        state.samples[sample].accelerometer[i] *= kJustMore;
        CHECK_FALSE(plausible(state));
      }
    }
  }
}

TEST_CASE_METHOD(Fixture, "AnEncoderIsBelievedUpToItsJointsLimitsAndMarginAndNoFurther") {
  constexpr double beyond = 1e-6;  // rad, rad/s
  for (std::size_t sample = 0; sample < kStateSamples; ++sample) {
    for (int i = 0; i < model.num_joints; ++i) {
      const auto& joint = model.joints[static_cast<std::size_t>(i)];
      const auto with_position = [&](double q) {
        RobotState state = good();
        state.samples[sample].joint_position[i] = q;
        return plausible(state);
      };
      CHECK(with_position(joint.upper + kConfig.joint_position_margin - beyond));
      CHECK_FALSE(with_position(joint.upper + kConfig.joint_position_margin + beyond));
      CHECK(with_position(joint.lower - kConfig.joint_position_margin + beyond));
      CHECK_FALSE(with_position(joint.lower - kConfig.joint_position_margin - beyond));
      for (const double sign : {-1.0, 1.0}) {
        RobotState state = good();
        const double fastest = kConfig.joint_velocity_factor * joint.max_velocity;
        state.samples[sample].joint_velocity[i] = sign * (fastest - beyond);
        CHECK(plausible(state));
        state.samples[sample].joint_velocity[i] = sign * (fastest + beyond);
        CHECK_FALSE(plausible(state));
      }
    }
  }
}

TEST_CASE("AUserCommandMustBeFiniteAndOfAKnownBehaviour") {
  UserCommand good;
  good.behaviour = Behaviour::kCatch;
  good.velocity = {0.3, -0.1};
  CHECK(command_is_plausible(good));
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    UserCommand command = good;
    command.velocity.x() = bad;
    CHECK_FALSE(command_is_plausible(command));
    command = good;
    command.velocity.y() = bad;
    CHECK_FALSE(command_is_plausible(command));
    command = good;
    command.yaw_rate = bad;
    CHECK_FALSE(command_is_plausible(command));
    command = good;
    command.height_offset = bad;
    CHECK_FALSE(command_is_plausible(command));
  }
  for (const int unknown : {-128, -1, 6, 127}) {
    UserCommand command = good;
    command.behaviour = static_cast<Behaviour>(unknown);
    CHECK_FALSE(command_is_plausible(command));
  }
}

TEST_CASE_METHOD(Fixture, "AJointIsOutsideItsLimitsFromAMilliradianOn") {
  CHECK_FALSE(joint_outside_limits(model, robot.nominal_joint_position));
  for (int i = 0; i < model.num_joints; ++i) {
    const auto& joint = model.joints[static_cast<std::size_t>(i)];
    JointVector q = robot.nominal_joint_position;
    q[i] = joint.upper + 0.9e-3;
    CHECK_FALSE(joint_outside_limits(model, q));
    q[i] = joint.upper + 1.1e-3;
    CHECK(joint_outside_limits(model, q));
    q[i] = joint.lower - 0.9e-3;
    CHECK_FALSE(joint_outside_limits(model, q));
    q[i] = joint.lower - 1.1e-3;
    CHECK(joint_outside_limits(model, q));
  }
}

TEST_CASE_METHOD(Fixture, "TorquesAreClippedToEachJointsLimitAndCounted") {
  JointCommand command;
  for (int i = 0; i < model.num_joints; ++i) {
    command.feedforward_torque[i] = model.joints[static_cast<std::size_t>(i)].max_torque * (i % 2 == 0 ? 1.0 : -1.0);
  }
  const JointVector at_limit = command.feedforward_torque;
  CHECK(limit_torques(model, command) == 0);
  CHECK(command.feedforward_torque == at_limit);

  command.feedforward_torque *= 1.5;
  CHECK(limit_torques(model, command) == model.num_joints);
  CHECK(command.feedforward_torque == at_limit);

  command.feedforward_torque[2] *= 2.0;
  CHECK(limit_torques(model, command) == 1);
  CHECK(command.feedforward_torque == at_limit);
}

TEST_CASE_METHOD(Fixture, "ATorqueThatIsNotFiniteBecomesZeroAndCounts") {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    JointCommand command;
    command.feedforward_torque.setOnes();
    command.feedforward_torque[3] = bad;
    CHECK(limit_torques(model, command) == 1);
    CHECK(command.feedforward_torque[3] == 0.0);
    CHECK(command.feedforward_torque[4] == 1.0);
  }
}

TEST_CASE("LimitsThatAreNotPositiveAreRefusedByName") {
  const std::vector<std::pair<std::string, double ValidationConfig::*>> fields{
      {"max_angular_velocity", &ValidationConfig::max_angular_velocity},
      {"max_acceleration", &ValidationConfig::max_acceleration},
      {"joint_position_margin", &ValidationConfig::joint_position_margin},
      {"joint_velocity_factor", &ValidationConfig::joint_velocity_factor}};
  CHECK_NOTHROW(kConfig.validate());
  for (const auto& [name, member] : fields) {
    for (const double bad : {0.0, -1.0, kNan, kInfinity}) {
      ValidationConfig config = kConfig;
      config.*member = bad;
      CHECK_THROWS_MATCHES(config.validate(), std::invalid_argument,
                           MessageMatches(ContainsSubstring("safety." + name + " is")));
    }
  }
}

}  // namespace stance::safety
