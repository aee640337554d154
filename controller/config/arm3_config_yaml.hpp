#pragma once
#include "controller/behaviours/arm3_config.hpp"
#include "controller/config/robot_description.hpp"

namespace stance::config {

/// The `controller` section of the 3-joint arm's YAML text, and what else its controller needs of it. Throws
/// ConfigError naming the key.
behaviours::Arm3Config arm3_config(const RobotDescription& robot);

}  // namespace stance::config
