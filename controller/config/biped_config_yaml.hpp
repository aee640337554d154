#pragma once
#include "controller/behaviours/biped_config.hpp"
#include "controller/config/robot_description.hpp"

namespace stance::config {

/// The `controller` section of a biped's YAML text, and what else its controller needs of it. Throws ConfigError naming
/// the key.
behaviours::BipedConfig biped_config(const RobotDescription& robot);

}  // namespace stance::config
