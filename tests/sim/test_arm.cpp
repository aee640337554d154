// A robot without feet stands on a fixed base: here a pendulum of one joint.
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <string>

#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

constexpr double kLength = 0.5;  // m, from the joint to the point-like mass
constexpr double kUpper = 1.2;   // rad

const std::string kUrdf = R"(<?xml version="1.0"?>
<robot name="pendulum">
  <link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="bob">
    <inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="swing" type="revolute">
    <parent link="base"/><child link="bob"/>
    <origin xyz="0 0 2"/><axis xyz="0 1 0"/>
    <limit lower="-1.2" upper="1.2" effort="50" velocity="30"/>
  </joint>
</robot>)";

const std::string kYaml = R"(robot: pendulum
urdf: pendulum.urdf
joints: [swing]
feet: []
nominal_joint_position: [0.05]
drives: {damping: [0.1], command_timeout: 0.05}
)";

Simulator simulator() {
  Scenario scenario = test::biped_scenario("stand");
  scenario.robot = "pendulum";
  return {config::robot_from_texts(kYaml, kUrdf), scenario, {}};
}

stance_msgs::joint_command_t command(const Simulator& simulator, double torque) {
  stance_msgs::joint_command_t out{};
  out.seq = out.state_seq = simulator.state().seq;
  out.run_id = simulator.state().run_id;
  out.num_joints = 1;
  out.feedforward_torque[0] = torque;
  return out;
}

}  // namespace

TEST_CASE("AnArmSwingsOnItsFixedBaseAtItsPendulumsPeriod") {
  Simulator arm = simulator();
  CHECK(arm.state().num_contacts == 0);
  double last = arm.truth().joint_position[0];
  double first_crossing = 0.0, second_crossing = 0.0;
  for (int k = 0; k < 300 && second_crossing == 0.0; ++k) {
    REQUIRE(arm.accept(command(arm, 0.0)) == Acceptance::kAccepted);
    arm.advance();
    const double now = arm.truth().joint_position[0];
    if (last > 0.0 && now <= 0.0) {
      const double crossing = arm.time() - kControlPeriod * now / (now - last);
      (first_crossing == 0.0 ? first_crossing : second_crossing) = crossing;
    }
    last = now;
  }
  const double period = 2.0 * M_PI * std::sqrt(kLength / kGravity);
  CHECK(std::abs(second_crossing - first_crossing - period) < 2e-3 * period);
  CHECK(arm.truth().p_WB[2] == 0.0);
  CHECK(arm.truth().fallen == 0);
}

TEST_CASE("AnArmsJointStopsAtItsLimit") {
  Simulator arm = simulator();
  for (int k = 0; k < 200; ++k) {
    REQUIRE(arm.accept(command(arm, 15.0)) == Acceptance::kAccepted);
    arm.advance();
    CHECK(arm.truth().joint_position[0] < kUpper + 0.02);
  }
  CHECK(arm.truth().joint_position[0] > kUpper - 0.02);
}

}  // namespace stance::sim
