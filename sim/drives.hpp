#pragma once
// The joint drives and what they accept. Their law, closed at 1 kHz:
//   active   torque = feedforward_torque + kp (position - q) + kd (velocity - qd)
//   damp     torque = -kd qd
//   stop     torque = 0
// each clipped at the joint's limit. Without a valid command for `command_timeout` they damp with the robot's own
// gains.
#include <cstdint>
#include <stance_msgs/joint_command_t.hpp>

#include "controller/config/robot_description.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::sim {

/// Torques of `command` at (q, qd).
JointVector drive_torque(const rigid_body::Model& model, const stance_msgs::joint_command_t& command,
                         const JointVector& q, const JointVector& qd) noexcept;

/// Torques of a drive without a command.
JointVector damping_torque(const rigid_body::Model& model, const JointVector& damping, const JointVector& qd) noexcept;

enum class Acceptance {
  kAccepted,
  kRepeated,          ///< the last accepted one again: no harm, and nothing new
  kRefusedStale,      ///< answers a state too old
  kRefusedNotFinite,  ///< a field is not finite or out of range
  kRefusedOrder,      ///< seq or state_seq went back
  kRefusedRun,        ///< not of this run, or of another robot's size
};

struct RefusalCounts {
  std::int64_t stale = 0;
  std::int64_t not_finite = 0;
  std::int64_t order = 0;
  std::int64_t run = 0;

  std::int64_t total() const { return stale + not_finite + order + run; }
};

/// Judges each command. Order: the state that is answered never goes back, and among answers to one state seq grows. A
/// command that answers a newer state may have any seq, so that a controller which starts anew is heard.
class CommandGate {
 public:
  /// `max_age`: control periods between the state that is answered and the present one.
  CommandGate(std::int64_t run_id, int num_joints, std::int64_t max_age)
      : run_id_(run_id), num_joints_(num_joints), max_age_(max_age) {}

  Acceptance judge(const stance_msgs::joint_command_t& command, std::int64_t present_state_seq) noexcept;
  const RefusalCounts& refused() const { return refused_; }

 private:
  std::int64_t run_id_;
  int num_joints_;
  std::int64_t max_age_;
  std::int64_t last_seq_ = 0;
  std::int64_t last_state_seq_ = 0;
  RefusalCounts refused_;
};

}  // namespace stance::sim
