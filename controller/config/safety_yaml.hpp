#pragma once
#include "controller/config/strict_yaml.hpp"
#include "controller/safety/fault_ladder.hpp"
#include "controller/safety/validation.hpp"

namespace stance::config {

/// The section `controller.safety` of any robot. Throws ConfigError naming the key.
void read_safety(StrictYaml yaml, safety::FaultLadderConfig& fault_ladder, safety::ValidationConfig& validation);

}  // namespace stance::config
