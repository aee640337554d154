// A robot without feet stands on a fixed base: here a pendulum of one joint.
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <stdexcept>
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

const std::string kScenario = R"(robot: pendulum
duration: 3.0
command_latency: 0.001
mass_factor: {links: 1.0}
initial_state: {joint_position: [0.05]}
sensors: {delay: 0.001, noise: none}
commands:
  - {time: 0.0, behaviour: track}
)";

config::RobotDescription pendulum() { return config::robot_from_texts(kYaml, kUrdf); }

/// The scenario with `from` replaced by `to`.
Scenario scenario_with(const std::string& from, const std::string& to, std::uint64_t seed = 1) {
  std::string text = kScenario;
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  return scenario_from_text(text.replace(at, from.size(), to), "swing.yaml", pendulum(), seed);
}

std::string error_of(const std::string& from, const std::string& to) {
  try {
    static_cast<void>(scenario_with(from, to));
  } catch (const config::ConfigError& error) {
    return error.what();
  }
  return "";
}

Simulator simulator(const Scenario& scenario = scenario_with("", "")) { return {pendulum(), scenario, {}}; }

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

TEST_CASE("AnArmBeginsWhereItsScenarioHasItsJoints") {
  const Simulator arm = simulator(scenario_with("[0.05]", "[-0.7]"));
  CHECK(arm.truth().joint_position[0] == -0.7);
  CHECK(arm.state().joint_position[kStateSamples - 1][0] == -0.7);
  // It has no IMU of its own to be noisy: its base stands still, and is held up.
  CHECK(arm.state().accelerometer[0][2] == kGravity);
}

TEST_CASE("AnArmsScenarioDrawsRandomValuesAsAnyDoes") {
  const auto start = [](std::uint64_t seed) {
    return scenario_with("[0.05]", "[{uniform: [-1, 1]}]", seed).initial.joint_position[0];
  };
  CHECK(start(1) != start(2));
  CHECK(start(1) == start(1));
}

TEST_CASE("TheMassFactorOfAnArmIsOfItsLinks") {
  // Twice the mass on the same rod swings alike, but weighs twice on its drive.
  const auto torque = [](const char* factor) {
    Simulator arm = simulator(scenario_with("links: 1.0", std::string("links: ") + factor));
    stance_msgs::joint_command_t hold = command(arm, 0.0);
    hold.position[0] = 0.05;
    hold.kp[0] = 200.0;
    hold.kd[0] = 20.0;
    for (int k = 0; k < 200; ++k) {
      hold.seq = hold.state_seq = arm.state().seq;
      REQUIRE(arm.accept(hold) == Acceptance::kAccepted);
      arm.advance();
    }
    return arm.truth().joint_torque[0] / std::sin(arm.truth().joint_position[0]);
  };
  CHECK(std::abs(torque("1.0") - 2.0 * kGravity * kLength) < 1e-3);
  CHECK(std::abs(torque("2.0") - 4.0 * kGravity * kLength) < 1e-3);
}

TEST_CASE("WhatOnlyARobotWithFeetHasIsRefusedOfAnArmByName") {
  const auto refused = [](const std::string& key) {
    return "swing.yaml: " + key + " is of robots with feet, and pendulum has none: remove it";
  };
  for (const char* key : {"plant: multibody", "friction: 0.7", "terrain: flat", "pushes: []"}) {
    const std::string name(key, std::string(key).find(':'));
    CHECK(error_of("robot: pendulum\n", "robot: pendulum\n" + std::string(key) + "\n") == refused(name));
  }
  CHECK(error_of("{links: 1.0}", "{links: 1.0, legs: 1.0}") == refused("mass_factor.legs"));
  CHECK(error_of("{joint_position: [0.05]}", "{joint_position: [0.05], foot_clearance: 0}") ==
        refused("initial_state.foot_clearance"));
  CHECK(error_of("noise: none", "noise: none, contact_delay: 0") == refused("sensors.contact_delay"));
  CHECK(error_of("noise: none", "noise: {gyro_white: 0}") == refused("sensors.noise.gyro_white"));
  CHECK(error_of("behaviour: track", "behaviour: track, yaw_rate: 0") == refused("commands[1].yaw_rate"));
}

TEST_CASE("WhatAnArmsScenarioLacksIsNamed") {
  CHECK(error_of("{joint_position: [0.05]}", "{}") == "swing.yaml: initial_state.joint_position is missing");
  CHECK(error_of("[0.05]", "[0.05, 0]") == "swing.yaml: initial_state.joint_position has 2 entries, but must have 1");
  CHECK(error_of("[0.05]", "[1.3]") ==
        "swing.yaml: initial_state.joint_position puts joint swing at 1.3 rad, but must be in [-1.2, 1.2]");
  CHECK(error_of("{links: 1.0}", "{}") == "swing.yaml: mass_factor.links is missing");
  CHECK(error_of("noise: none", "noise: {joint_position_offset: 0}") ==
        "swing.yaml: sensors.noise.joint_position_resolution is missing");
}

TEST_CASE("WhatOnlyARobotWithoutFeetHasIsRefusedOfTheBipedByName") {
  std::string text = config::read_text(config::share_directory() / "sim/scenarios/biped/stand.yaml");
  const std::string before = "initial_state:\n";
  text.insert(text.find(before) + before.size(), "  joint_position: [0]\n");
  try {
    static_cast<void>(scenario_from_text(text, "stand.yaml", test::biped(), 1));
    FAIL("it was taken");
  } catch (const config::ConfigError& error) {
    CHECK(std::string(error.what()) ==
          "stand.yaml: initial_state.joint_position is of robots without feet, and biped has some: remove it");
  }
}

TEST_CASE("ARobotWithoutFeetCannotFallNorBeTheSingleBody") {
  CHECK_THROWS_AS(config::robot_from_texts(kYaml + "fallen: {min_upright: 0.5, min_height: 0.1}\n", kUrdf),
                  config::ConfigError);
  CHECK_THROWS_AS(Simulator(pendulum(), scenario_with("", ""),
                            {.seed = 1, .run_id = 1, .start_utime = 0, .plant = Plant::kSingleBody}),
                  std::invalid_argument);
}

}  // namespace stance::sim
