#pragma once
// Is what came in fit to act on? Pure checks, no state.
#include "controller/interface/signals.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::safety {

struct ValidationConfig {
  double max_angular_velocity = 0.0;   ///< rad/s, of the gyro, each axis
  double max_acceleration = 0.0;       ///< m/s^2, of the accelerometer, each axis
  double joint_position_margin = 0.0;  ///< rad, past the joint's limits, above which an encoder is not believed
  double joint_velocity_factor = 0.0;  ///< times the joint's speed limit, above which an encoder is not believed
  void validate() const;               ///< throws std::invalid_argument naming the field, its value and the range
};

/// Finite, of this robot's size, with plausible values. `seq` and `run_id` are the caller's to judge.
bool state_is_plausible(const ValidationConfig& config, const rigid_body::Model& model, int num_contacts,
                        const RobotState& state) noexcept;

/// Finite, and of a known behaviour.
bool command_is_plausible(const UserCommand& command) noexcept;

/// Does any joint stand outside its limits by more than 1e-3 rad?
bool joint_outside_limits(const rigid_body::Model& model, const JointVector& position) noexcept;

/// Clips feed-forward torques to the joints' limits; returns how many were. A torque that is not finite becomes zero
/// and counts.
int limit_torques(const rigid_body::Model& model, JointCommand& command) noexcept;

}  // namespace stance::safety
