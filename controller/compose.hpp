#pragma once
// From a robot's description to its controller: what every program that runs one composes.
#include <memory>
#include <string>

#include "controller/config/robot_description.hpp"
#include "controller/loop/ticker.hpp"

namespace stance {

namespace behaviours {
class BipedController;
}

/// The controller of `robot`, all memory taken. Throws config::ConfigError; of a robot that has none, it names those
/// that have one.
loop::Controller compose(const config::RobotDescription& robot);

/// The biped's, and what is in it, for who looks on. Throws config::ConfigError where `robot` is another.
struct ComposedBiped {
  loop::Controller controller;
  std::shared_ptr<const behaviours::BipedController> biped;
};
ComposedBiped compose_biped(const config::RobotDescription& robot);

/// `yaml_text` with `controller.force_qp.engine` set to `engine`: what a log must carry when the command line chose
/// another. Throws config::ConfigError where the robot solves no force QP.
std::string with_engine(const std::string& yaml_text, const std::string& engine);

}  // namespace stance
