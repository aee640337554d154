#pragma once
#include <string>

#include "controller/behaviours/biped_config.hpp"

namespace stance::config {

/// The `controller` section of a biped's YAML text. Throws ConfigError naming the key.
behaviours::BipedConfig biped_config_from_yaml(const std::string& yaml_text);

}  // namespace stance::config
