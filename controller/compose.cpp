#include "controller/compose.hpp"

#include <yaml-cpp/yaml.h>

#include <memory>

#include "controller/behaviours/biped_controller.hpp"
#include "controller/config/biped_config_yaml.hpp"

namespace stance {

loop::TickFunction compose(const config::RobotDescription& robot) {
  if (robot.name == "biped") {
    auto controller = std::make_shared<behaviours::BipedController>(config::biped_config(robot), robot.model,
                                                                    robot.feet, robot.nominal_joint_position);
    return [controller](const TickInput& input, StageClock& clock, TickOutput& out) {
      controller->step(input, clock, out);
    };
  }
  throw config::ConfigError("no controller for the robot '" + robot.name + "': there is one for biped");
}

std::string with_engine(const std::string& yaml_text, const std::string& engine) {
  YAML::Node root = YAML::Load(yaml_text);
  root["controller"]["force_qp"]["engine"] = engine;
  return YAML::Dump(root) + "\n";
}

}  // namespace stance
