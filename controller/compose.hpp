#pragma once
// From a robot's description to its tick: what every program that runs a controller composes.
#include <string>

#include "controller/config/robot_description.hpp"
#include "controller/loop/ticker.hpp"

namespace stance {

/// The controller of `robot`, all memory taken. Throws config::ConfigError.
loop::TickFunction compose(const config::RobotDescription& robot);

/// `yaml_text` with `controller.force_qp.engine` set to `engine`: what a log must carry when the command line chose
/// another.
std::string with_engine(const std::string& yaml_text, const std::string& engine);

}  // namespace stance
