#include "tests/sim/robots.hpp"

namespace stance::sim::test {

config::RobotDescription biped() {
  const auto robots = config::share_directory() / "robots";
  return config::load_robot(robots, "biped");
}

WorldSetup biped_world(double height) {
  const config::RobotDescription robot = biped();
  WorldSetup setup;
  setup.model = robot.model;
  setup.feet = robot.feet;
  setup.shapes = rigid_body::collision_shapes_from_urdf(robot.urdf_text, robot.model);
  setup.friction = 0.7;
  setup.initial.q = robot.nominal_joint_position;
  setup.initial.p_WB.z() = height;
  return setup;
}

Scenario biped_scenario(const std::string& name) { return load_scenario(biped(), name, 1); }

stance_msgs::joint_command_t hold_command(const config::RobotDescription& robot, const Simulator& simulator) {
  stance_msgs::joint_command_t command{};
  command.seq = simulator.state().seq;
  command.state_seq = simulator.state().seq;
  command.run_id = simulator.state().run_id;
  command.mode = stance_msgs::joint_command_t::ACTIVE;
  command.num_joints = robot.model.num_joints;
  for (int i = 0; i < robot.model.num_joints; ++i) {
    command.position[i] = robot.nominal_joint_position[i];
    // Below what the light links bear at 1 kHz.
    command.kp[i] = i % 4 == 3 ? 60.0 : 300.0;
    command.kd[i] = i % 4 == 3 ? 0.4 : 3.0;
  }
  return command;
}

}  // namespace stance::sim::test
