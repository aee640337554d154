#include "sim/drives.hpp"

#include <algorithm>
#include <cmath>

namespace stance::sim {
namespace {

using stance_msgs::joint_command_t;

constexpr double kMaxValue = 1e6;  // of any field: beyond it, no controller meant what it says

bool plausible(double value) noexcept { return std::isfinite(value) && std::abs(value) <= kMaxValue; }

bool in_range(const joint_command_t& command, std::int64_t present_state_seq) noexcept {
  if (command.mode < joint_command_t::ACTIVE || command.mode > joint_command_t::STOP) return false;
  if (command.state_seq < 1 || command.state_seq > present_state_seq) return false;
  for (int i = 0; i < command.num_joints; ++i) {
    if (!plausible(command.feedforward_torque[i]) || !plausible(command.position[i]) ||
        !plausible(command.velocity[i]) || !plausible(command.kp[i]) || !plausible(command.kd[i]) ||
        command.kp[i] < 0.0 || command.kd[i] < 0.0) {
      return false;
    }
  }
  return true;
}

}  // namespace

JointVector drive_torque(const rigid_body::Model& model, const joint_command_t& command, const JointVector& q,
                         const JointVector& qd) noexcept {
  JointVector torque = JointVector::Zero();
  if (command.mode == joint_command_t::STOP) return torque;
  for (int i = 0; i < model.num_joints; ++i) {
    const double asked = command.mode == joint_command_t::DAMP
                             ? -command.kd[i] * qd[i]
                             : command.feedforward_torque[i] + command.kp[i] * (command.position[i] - q[i]) +
                                   command.kd[i] * (command.velocity[i] - qd[i]);
    const double limit = model.joints[static_cast<std::size_t>(i)].max_torque;
    torque[i] = std::clamp(asked, -limit, limit);
  }
  return torque;
}

JointVector damping_torque(const rigid_body::Model& model, const JointVector& damping, const JointVector& qd) noexcept {
  JointVector torque = JointVector::Zero();
  for (int i = 0; i < model.num_joints; ++i) {
    const double limit = model.joints[static_cast<std::size_t>(i)].max_torque;
    torque[i] = std::clamp(-damping[i] * qd[i], -limit, limit);
  }
  return torque;
}

Acceptance CommandGate::judge(const joint_command_t& command, std::int64_t present_state_seq) noexcept {
  if (command.run_id != run_id_ || command.num_joints != num_joints_) {
    ++refused_.run;
    return Acceptance::kRefusedRun;
  }
  if (!in_range(command, present_state_seq)) {
    ++refused_.not_finite;
    return Acceptance::kRefusedNotFinite;
  }
  if (command.state_seq == last_state_seq_ && command.seq == last_seq_) return Acceptance::kRepeated;
  if (command.state_seq < last_state_seq_ || (command.state_seq == last_state_seq_ && command.seq < last_seq_)) {
    ++refused_.order;
    return Acceptance::kRefusedOrder;
  }
  if (present_state_seq - command.state_seq > max_age_) {
    ++refused_.stale;
    return Acceptance::kRefusedStale;
  }
  last_seq_ = command.seq;
  last_state_seq_ = command.state_seq;
  return Acceptance::kAccepted;
}

}  // namespace stance::sim
