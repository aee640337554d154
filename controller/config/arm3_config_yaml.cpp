#include "controller/config/arm3_config_yaml.hpp"

#include "controller/config/safety_yaml.hpp"

namespace stance::config {
namespace {

behaviours::Arm3TrackConfig track(StrictYaml yaml) {
  behaviours::Arm3TrackConfig c;
  StrictYaml smooth = yaml.mapping("smooth");
  c.smooth_peak_rate = Eigen::Map<const Vector3>(smooth.numbers("peak_rate", 3).data());
  c.smooth_duration = smooth.number("duration");
  smooth.finish();
  c.limit_margin = yaml.number("limit_margin");
  c.kp = yaml.number("kp");
  c.kd = yaml.number("kd");
  c.lead = yaml.number("lead");
  yaml.finish();
  return c;
}

}  // namespace

behaviours::Arm3Config arm3_config(const RobotDescription& robot) {
  const std::string file = robot.name + ".yaml";
  StrictYaml root = StrictYaml::parse(robot.yaml_text, file);
  StrictYaml yaml = root.mapping("controller");
  behaviours::Arm3Config c;
  const std::string tool = yaml.text("tool");
  c.intake.user_command_timeout = yaml.number("user_command_timeout");
  c.track = track(yaml.mapping("track"));
  read_safety(yaml.mapping("safety"), c.fault_ladder, c.intake.validation);
  yaml.finish();
  c.damping = robot.drives.damping;
  try {
    c.geometry =
        kinematics::arm3_geometry(robot.model, rigid_body::link_pose_from_urdf(robot.urdf_text, robot.model, tool));
    c.validate();
  } catch (const std::invalid_argument& error) {
    throw ConfigError(file + ": controller: " + error.what());
  }
  return c;
}

}  // namespace stance::config
