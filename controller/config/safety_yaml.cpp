#include "controller/config/safety_yaml.hpp"

namespace stance::config {

void read_safety(StrictYaml yaml, safety::FaultLadderConfig& fault_ladder, safety::ValidationConfig& validation) {
  fault_ladder.hold_time = yaml.number("hold_time");
  fault_ladder.damp_time = yaml.number("damp_time");
  validation.max_angular_velocity = yaml.number("max_angular_velocity");
  validation.max_acceleration = yaml.number("max_acceleration");
  validation.joint_position_margin = yaml.number("joint_position_margin");
  validation.joint_velocity_factor = yaml.number("joint_velocity_factor");
  yaml.finish();
}

}  // namespace stance::config
