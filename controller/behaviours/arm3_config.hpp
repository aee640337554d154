#pragma once
// All that robots/arm3/arm3.yaml says under `controller`, and what else of the robot its controller needs.
#include "controller/kinematics/arm3.hpp"
#include "controller/safety/intake.hpp"

namespace stance::behaviours {

struct Arm3TrackConfig {
  Vector3 smooth_peak_rate = Vector3::Zero();  ///< rad/s, of `track-smooth`
  double smooth_duration = 0.0;                ///< s, the same
  double limit_margin = 0.0;                   ///< rad, that the reference keeps from the joints' limits
  double kp = 0.0;                             ///< 1/s^2, closed by the drives
  double kd = 0.0;                             ///< 1/s
  double lead = 0.0;  ///< s, from a state to the mean of the instants at which the drives act on it
};

struct Arm3Config {
  kinematics::Arm3Geometry geometry;
  Arm3TrackConfig track;
  safety::IntakeConfig intake;
  safety::FaultLadderConfig fault_ladder;
  JointVector damping = JointVector::Zero();  ///< N m s/rad, of the joints while damped

  /// Throws std::invalid_argument naming the field, its value and the allowed range.
  void validate() const;
};

}  // namespace stance::behaviours
