#include "controller/config/catcher_config_yaml.hpp"

#include <algorithm>

#include "controller/config/safety_yaml.hpp"

namespace stance::config {
namespace {

/// One number for each of the robot's joints.
JointVector joints(StrictYaml& yaml, const char* key, int num_joints) {
  const auto values = yaml.numbers(key, num_joints);
  JointVector out = JointVector::Zero();
  std::copy(values.begin(), values.end(), out.begin());
  return out;
}

void filter(StrictYaml yaml, behaviours::CatcherConfig& c) {
  c.filter.measurement_sigma = yaml.number("measurement_sigma");
  c.filter.acceleration_density = yaml.number("acceleration_density");
  const auto velocity = yaml.numbers("velocity", 3);
  c.filter.velocity = {velocity[0], velocity[1], velocity[2]};
  c.filter.velocity_sigma = yaml.number("velocity_sigma");
  c.filter.drag = yaml.number("drag");
  c.filter.drag_sigma = yaml.number("drag_sigma");
  c.track.gate = yaml.number("gate");
  c.track.max_rejected = yaml.integer("max_rejected");
  c.track.max_gap = yaml.number("max_gap");
  c.track.min_observations = yaml.integer("min_observations");
  c.track.clear_of_cup = yaml.number("clear_of_cup");
  const auto aim = yaml.numbers("aim", 3);
  c.track.aim = {aim[0], aim[1], aim[2]};
  c.track.aim_sigma = yaml.number("aim_sigma");
  yaml.finish();
}

void planner(StrictYaml yaml, int num_joints, behaviours::CatcherConfig& c) {
  planning::InterceptionConfig& p = c.planner;
  p.earliest = yaml.number("earliest");
  p.latest = yaml.number("latest");
  p.step = yaml.number("step");
  const auto offsets = yaml.numbers("pitch_offsets", planning::kPitchOffsets);
  std::copy(offsets.begin(), offsets.end(), p.pitch_offsets.begin());
  p.min_height = yaml.number("min_height");
  p.limit_margin = yaml.number("limit_margin");
  p.reach_slack = yaml.number("reach_slack");
  p.commit = yaml.number("commit");
  p.spare_time = yaml.number("spare_time");
  p.max_facing = yaml.number("max_facing");
  p.facing_cost = yaml.number("facing_cost");
  p.turned_away_cost = yaml.number("turned_away_cost");
  p.lateness_cost = yaml.number("lateness_cost");
  p.reach_cost = yaml.number("reach_cost");
  p.time_change_cost = yaml.number("time_change_cost");
  p.posture_change_cost = yaml.number("posture_change_cost");
  c.motion.speed = joints(yaml, "speed", num_joints);
  c.motion.acceleration = joints(yaml, "acceleration", num_joints);
  yaml.finish();
}

behaviours::CatchConfig course(StrictYaml yaml) {
  behaviours::CatchConfig c;
  c.give = yaml.number("give");
  c.max_give = yaml.number("max_give");
  c.give_sigma = yaml.number("give_sigma");
  c.settle = yaml.number("settle");
  c.upright_time = yaml.number("upright_time");
  c.hold_time = yaml.number("hold_time");
  c.return_time = yaml.number("return_time");
  yaml.finish();
  return c;
}

behaviours::ComputedTorqueConfig computed_torque(StrictYaml yaml) {
  behaviours::ComputedTorqueConfig c;
  c.kp = yaml.number("kp");
  c.kd = yaml.number("kd");
  c.lead = yaml.number("lead");
  yaml.finish();
  return c;
}

}  // namespace

behaviours::CatcherConfig catcher_config(const RobotDescription& robot) {
  StrictYaml root = StrictYaml::parse(robot.yaml_text, robot.name + ".yaml");
  if (!robot.cup) root.fail("cup", "is missing: what a catcher catches with");
  if (robot.cup->body != robot.model.num_joints || robot.cup->position.head<2>() != Eigen::Vector2d::Zero()) {
    root.fail("cup", "must stand on the last link's z axis");
  }
  StrictYaml yaml = root.mapping("controller");
  behaviours::CatcherConfig c;
  c.intake.user_command_timeout = yaml.number("user_command_timeout");
  StrictYaml calibration = yaml.mapping("calibration");
  c.max_calibration_rms = calibration.number("max_rms");
  calibration.finish();
  filter(yaml.mapping("filter"), c);
  planner(yaml.mapping("planner"), robot.model.num_joints, c);
  c.course = course(yaml.mapping("catch"));
  c.computed_torque = computed_torque(yaml.mapping("computed_torque"));
  read_safety(yaml.mapping("safety"), c.fault_ladder, c.intake.validation);
  yaml.finish();
  c.damping = robot.drives.damping;
  c.place = robot.nominal_joint_position;
  for (int i = 0; i < robot.model.num_joints; ++i) {
    const auto& joint = robot.model.joints[static_cast<std::size_t>(i)];
    c.motion.lower[i] = joint.lower + c.planner.limit_margin;
    c.motion.upper[i] = joint.upper - c.planner.limit_margin;
  }
  c.tool = robot.cup->position.z();
  try {
    c.validate();
  } catch (const std::invalid_argument& error) {
    throw ConfigError(robot.name + ".yaml: controller: " + error.what());
  }
  return c;
}

}  // namespace stance::config
