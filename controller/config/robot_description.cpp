#include "controller/config/robot_description.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>

namespace stance::config {
namespace {

DriveDescription drives(StrictYaml yaml, int num_joints) {
  DriveDescription out;
  const auto damping = yaml.numbers("damping", num_joints);
  for (int i = 0; i < num_joints; ++i) {
    out.damping[i] = damping[static_cast<std::size_t>(i)];
    if (!(out.damping[i] >= 0.0)) yaml.fail("damping", "has an entry that is not >= 0");
  }
  out.command_timeout = yaml.number("command_timeout");
  if (!(out.command_timeout >= kControlPeriod)) yaml.fail("command_timeout", "is shorter than a control period");
  yaml.finish();
  return out;
}

kinematics::FallLimits fall_limits(StrictYaml yaml) {
  kinematics::FallLimits out{yaml.number("min_upright"), yaml.number("min_height")};
  if (!(out.min_upright > 0.0 && out.min_upright < 1.0)) yaml.fail("min_upright", "must be in 0..1");
  if (!(out.min_height > 0.0)) yaml.fail("min_height", "must be > 0 m");
  yaml.finish();
  return out;
}

Cup cup_from(StrictYaml yaml) {
  Cup out;
  out.link = yaml.text("link");
  const auto position = yaml.numbers("position", 3);
  out.position = {position[0], position[1], position[2]};
  out.radius = yaml.number("radius");
  if (!(out.radius > 0.0)) yaml.fail("radius", "must be > 0 m");
  out.depth = yaml.number("depth");
  if (!(out.depth > 0.0)) yaml.fail("depth", "must be > 0 m");
  yaml.finish();
  return out;
}

}  // namespace

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  if (!stream || !(text << stream.rdbuf())) throw ConfigError("cannot read " + file.string());
  return text.str();
}

std::filesystem::path share_directory() {
  if (const char* directory = std::getenv("STANCE_SHARE")) return directory;
  if (std::filesystem::exists(std::filesystem::path(STANCE_SOURCE_DIR) / "robots")) return STANCE_SOURCE_DIR;
  return STANCE_INSTALLED_SHARE;
}

RobotDescription load_robot(const std::filesystem::path& robots_directory, const std::string& robot) {
  const auto directory = robots_directory / robot;
  const auto yaml_file = directory / (robot + ".yaml");
  if (!std::filesystem::exists(yaml_file)) {
    throw ConfigError("no robot '" + robot + "': " + yaml_file.string() + " does not exist");
  }
  const std::string yaml_text = read_text(yaml_file);
  StrictYaml yaml = StrictYaml::parse(yaml_text, robot + ".yaml");
  return robot_from_texts(yaml_text, read_text(directory / yaml.text("urdf")));
}

RobotDescription robot_from_texts(const std::string& yaml_text, const std::string& urdf_text) {
  RobotDescription robot;
  robot.name = StrictYaml::parse(yaml_text, "robot configuration").text("robot");
  StrictYaml yaml = StrictYaml::parse(yaml_text, robot.name + ".yaml");
  yaml.text("robot");
  yaml.text("urdf");
  robot.yaml_text = yaml_text;
  robot.urdf_text = urdf_text;
  robot.joint_names = yaml.texts("joints");
  robot.foot_links = yaml.texts("feet");
  const int num_joints = static_cast<int>(robot.joint_names.size());
  if (num_joints > kMaxJoints) yaml.fail("joints", "has more than " + std::to_string(kMaxJoints) + " entries");
  if (robot.foot_links.size() > static_cast<std::size_t>(kMaxContacts)) {
    yaml.fail("feet", "has more than " + std::to_string(kMaxContacts) + " entries");
  }
  const auto nominal = yaml.numbers("nominal_joint_position", num_joints);
  for (int i = 0; i < num_joints; ++i) robot.nominal_joint_position[i] = nominal[static_cast<std::size_t>(i)];
  robot.drives = drives(yaml.mapping("drives"), num_joints);
  if (robot.has_feet()) {
    robot.fallen = fall_limits(yaml.mapping("fallen"));
  } else if (yaml.has("fallen")) {
    yaml.fail("fallen", "is of a robot with feet: remove it, or name them in feet");
  }
  if (yaml.has("cup")) robot.cup = cup_from(yaml.mapping("cup"));
  yaml.leave("controller");
  yaml.finish();
  try {
    robot.model = rigid_body::model_from_urdf(urdf_text, robot.joint_names);
    robot.feet = rigid_body::feet_from_urdf(urdf_text, robot.model, robot.foot_links);
    if (robot.cup) robot.cup->body = robot.model.body_index(robot.cup->link);
  } catch (const std::invalid_argument& error) {
    throw ConfigError(robot.name + " URDF: " + error.what());
  }
  for (int i = 0; i < num_joints; ++i) {
    const auto& joint = robot.model.joints[static_cast<std::size_t>(i)];
    if (robot.nominal_joint_position[i] < joint.lower || robot.nominal_joint_position[i] > joint.upper) {
      yaml.fail("nominal_joint_position", "puts joint " + joint.name + " outside its limits");
    }
  }
  return robot;
}

}  // namespace stance::config
