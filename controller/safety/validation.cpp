#include "controller/safety/validation.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace stance::safety {
namespace {

void require_positive(const char* field, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) {
    throw std::invalid_argument(std::string("safety.") + field + " is " + std::to_string(value) + ", but must be > 0");
  }
}

bool within(const Vector3& v, double bound) noexcept { return v.allFinite() && v.cwiseAbs().maxCoeff() <= bound; }

}  // namespace

void ValidationConfig::validate() const {
  require_positive("max_angular_velocity", max_angular_velocity);
  require_positive("max_acceleration", max_acceleration);
  require_positive("joint_position_margin", joint_position_margin);
  require_positive("joint_velocity_factor", joint_velocity_factor);
}

bool state_is_plausible(const ValidationConfig& config, const rigid_body::Model& model, int num_contacts,
                        const RobotState& state) noexcept {
  if (state.num_joints != model.num_joints || state.num_contacts != num_contacts) return false;
  if (!(state.sample_period > 0.0 && state.sample_period * kStateSamples < 2.0 * kControlPeriod)) return false;
  if (!state.joint_torque.allFinite()) return false;
  for (const SensorSample& sample : state.samples) {
    if (!within(sample.gyro, config.max_angular_velocity)) return false;
    if (!within(sample.accelerometer, config.max_acceleration)) return false;
    for (int i = 0; i < model.num_joints; ++i) {
      const auto& joint = model.joints[static_cast<std::size_t>(i)];
      const double q = sample.joint_position[i], qd = sample.joint_velocity[i];
      if (!(q >= joint.lower - config.joint_position_margin && q <= joint.upper + config.joint_position_margin)) {
        return false;
      }
      if (!(std::abs(qd) <= config.joint_velocity_factor * joint.max_velocity)) return false;
    }
  }
  return true;
}

bool command_is_plausible(const UserCommand& command) noexcept {
  return command.velocity.allFinite() && std::isfinite(command.yaw_rate) && std::isfinite(command.height_offset) &&
         command.behaviour >= Behaviour::kStand && command.behaviour <= Behaviour::kTrackSmooth;
}

bool joint_outside_limits(const rigid_body::Model& model, const JointVector& position) noexcept {
  constexpr double tolerance = 1e-3;
  for (int i = 0; i < model.num_joints; ++i) {
    const auto& joint = model.joints[static_cast<std::size_t>(i)];
    if (position[i] < joint.lower - tolerance || position[i] > joint.upper + tolerance) return true;
  }
  return false;
}

int limit_torques(const rigid_body::Model& model, JointCommand& command) noexcept {
  int clipped = 0;
  for (int i = 0; i < model.num_joints; ++i) {
    const double limit = model.joints[static_cast<std::size_t>(i)].max_torque;
    double& torque = command.feedforward_torque[i];
    const double wanted = torque;
    torque = std::isfinite(wanted) ? std::clamp(wanted, -limit, limit) : 0.0;
    if (!(torque == wanted)) ++clipped;
  }
  return clipped;
}

}  // namespace stance::safety
