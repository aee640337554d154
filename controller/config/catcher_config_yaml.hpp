#pragma once
#include "controller/behaviours/catcher_config.hpp"
#include "controller/config/robot_description.hpp"

namespace stance::config {

/// The `controller` section of the catcher's YAML text, and what else its controller needs of it. Throws ConfigError
/// naming the key.
behaviours::CatcherConfig catcher_config(const RobotDescription& robot);

}  // namespace stance::config
