#include "controller/behaviours/torque_map.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "controller/config/biped_config_yaml.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::behaviours {
namespace {

constexpr int kSwing = 1;  // the leg that swings
const config::RobotDescription& robot() {
  static const config::RobotDescription biped = test::biped();
  return biped;
}
const BipedConfig& configuration() {
  static const BipedConfig config = config::biped_config(robot());
  return config;
}

/// The nominal posture with a trunk that moves.
BodyDynamics moving_body() {
  BodyDynamics body;
  body.state.R_WB = math::rotation_z(0.3) * math::exp_so3({0.1, -0.15, 0.0});
  body.state.p_WB = {0.4, -0.2, 0.72};
  body.state.v_WB = {0.5, -0.3, 0.1};
  body.state.w_WB_W = {0.8, -1.1, 0.4};
  body.state.q = robot().nominal_joint_position;
  rigid_body::forward_kinematics(robot().model, body.state, body.kinematics);
  rigid_body::centroidal(robot().model, body.kinematics, body.centroidal);
  rigid_body::mass_matrix(robot().model, body.state, body.mass_matrix);
  rigid_body::gravity_torques(robot().model, body.state, body.gravity);
  return body;
}

Vector3 foot_of(const rigid_body::State& state) {
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(robot().model, state, kinematics);
  const auto link = static_cast<std::size_t>(robot().feet[kSwing].body);
  return kinematics.p_W[link] + kinematics.R_W[link] * robot().feet[kSwing].tip;
}

JointCommand command_of(const BodyDynamics& body, const planning::SwingReference& reference,
                        const TorqueMapConfig& config = configuration().torque_map) {
  const std::array<rigid_body::Foot, 2> feet{robot().feet[0], robot().feet[1]};
  const TorqueMap map(config, configuration().last_link_pitch, robot().model, feet,
                      kinematics::leg_geometries(robot().model, robot().feet));
  std::array<LegTask, 2> tasks;
  tasks[kSwing].stance = false;
  tasks[kSwing].swing = reference;
  JointCommand command;
  map.map(body, tasks, command);
  return command;
}

}  // namespace

TEST_CASE("ASwingLegsCommandMovesItsFootAsTheReferenceSaysOnAMovingTrunk") {
  constexpr double step = 1e-5;  // s
  const BodyDynamics body = moving_body();
  TorqueMapConfig config = configuration().torque_map;
  config.swing_lead = 0.0;
  planning::SwingReference reference;
  reference.p = foot_of(body.state) + Vector3(0.06, 0.03, 0.05);
  reference.v = {1.2, -0.4, 0.3};
  const JointCommand command = command_of(body, reference, config);

  rigid_body::State now = body.state;
  now.q.segment<4>(4 * kSwing) = command.position.segment<4>(4 * kSwing);
  CHECK((foot_of(now) - reference.p).norm() < 1e-9);
  rigid_body::State then = now;
  then.q.segment<4>(4 * kSwing) += step * command.velocity.segment<4>(4 * kSwing);
  then.p_WB += step * now.v_WB;
  then.R_WB = math::exp_so3(step * now.w_WB_W) * now.R_WB;
  CHECK(((foot_of(then) - foot_of(now)) / step - reference.v).norm() < 5e-3);
}

TEST_CASE("AStanceLegThatIsFarFromItsPostureIsDrawnBackGently") {
  BodyDynamics body = moving_body();
  body.state.v_WB.setZero();
  body.state.w_WB_W.setZero();
  // The last link bent by the landing of a foot.
  const int stance = 4 * (1 - kSwing);
  body.state.q[stance + 3] += 0.8;
  rigid_body::forward_kinematics(robot().model, body.state, body.kinematics);
  const JointCommand command = command_of(body, {});
  const double error = (command.position - body.state.q).segment<4>(stance).cwiseAbs().maxCoeff();
  CHECK(std::abs(error - configuration().torque_map.max_posture_error) < 1e-9);
}

TEST_CASE("ASwingLegThatFallsFreelyWithItsTrunkNeedsNoTorque") {
  const Vector3 gravity(0.0, 0.0, -kGravity);
  BodyDynamics body = moving_body();
  body.state.w_WB_W.setZero();
  body.a_WB = gravity;
  planning::SwingReference reference;
  // In the posture that the leg takes for that foot.
  reference.p = foot_of(body.state);
  reference.v = body.state.v_WB;
  reference.a = gravity;
  const JointCommand falling = command_of(body, reference);
  CHECK(falling.velocity.segment<4>(4 * kSwing).norm() < 1e-9);
  CHECK(falling.feedforward_torque.segment<4>(4 * kSwing).norm() < 1e-6);

  body.a_WB.setZero();
  reference.a.setZero();
  const JointCommand held = command_of(body, reference);
  CHECK(held.feedforward_torque.segment<4>(4 * kSwing).norm() > 1.0);
}

TEST_CASE("ASwingLegThatCannotFollowStaysWithinItsLimitsAndItsRatesBounded") {
  constexpr double max_rate = 100.0;  // rad/s, well above what a leg in reach is asked for
  const BodyDynamics body = moving_body();
  const double margin = configuration().torque_map.limit_margin;
  const Vector3 foot = foot_of(body.state);
  // Far away, across the other leg, behind the trunk, above the hip, at the hip.
  const std::array<Vector3, 6> ways{Vector3(2.0, 0.0, 0.0), Vector3(0.0, 0.8, 0.1),  Vector3(-0.7, -0.2, 0.1),
                                    Vector3(0.1, 0.0, 1.0), Vector3(0.0, 0.0, 0.62), Vector3(0.0, 0.0, -3.0)};
  for (const Vector3& away : ways) {
    INFO("foot " << away.transpose() << " m from where it is");
    planning::SwingReference reference;
    reference.p = foot + away;
    reference.v = {3.0, 2.0, -1.0};
    reference.a = {40.0, -30.0, 20.0};
    const JointCommand command = command_of(body, reference);
    for (int i = 4 * kSwing; i < 4 * kSwing + 4; ++i) {
      const rigid_body::Joint& joint = robot().model.joints[static_cast<std::size_t>(i)];
      const double lower = joint.lower + margin, upper = joint.upper - margin;
      CHECK(command.position[i] >= lower);
      CHECK(command.position[i] <= upper);
      CHECK(std::abs(command.velocity[i]) < max_rate);
      CHECK(std::isfinite(command.feedforward_torque[i]));
      CHECK(command.kp[i] > 0.0);
    }
  }
}

}  // namespace stance::behaviours
