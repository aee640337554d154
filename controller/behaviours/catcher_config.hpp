#pragma once
// All that robots/catcher/catcher.yaml says under `controller`, and what else of the robot its controller needs.
#include "controller/estimation/ball_filter.hpp"
#include "controller/planning/interception.hpp"
#include "controller/safety/fault_ladder.hpp"
#include "controller/safety/intake.hpp"

namespace stance::behaviours {

/// Which observations are believed, and of which ball they are.
struct BallTrackConfig {
  double gate = 0.0;              ///< NIS per degree of freedom, above which an observation is not believed
  int max_rejected = 0;           ///< in a row, after which the ball is another one
  double max_gap = 0.0;           ///< s without a believed observation, the same
  int min_observations = 0;       ///< before it is planned for
  double clear_of_cup = 0.0;      ///< m from the cup, below which a ball is the one that was caught
  Vector3 aim = Vector3::Zero();  ///< m, in A: balls are thrown at about there
  double aim_sigma = 0.0;         ///< m, by which they pass it, of each axis across their way
};

/// The catch's course in time.
struct CatchConfig {
  double give = 0.0;          ///< of the ball's velocity, with which the cup yields to it
  double max_give = 0.0;      ///< m/s, the most of that
  double give_sigma = 0.0;    ///< m, of the ball's place at the meeting, each axis, above which it does not: a cup that
                              ///< gives way follows a new estimate less nimbly
  double settle = 0.0;        ///< s from the meeting to rest
  double upright_time = 0.0;  ///< s, then, to turn the cup up
  double hold_time = 0.0;     ///< s with the ball
  double return_time = 0.0;   ///< s, back to where it waits
};

struct ComputedTorqueConfig {
  double kp = 0.0;    ///< 1/s^2, closed by the drives
  double kd = 0.0;    ///< 1/s
  double lead = 0.0;  ///< s, from a state to the middle of its command's effect
};

struct CatcherConfig {
  safety::IntakeConfig intake;
  double max_calibration_rms = 0.0;  ///< m
  estimation::BallFilterConfig filter;
  BallTrackConfig track;
  planning::InterceptionConfig planner;
  planning::JointMotionLimits motion;
  CatchConfig course;
  ComputedTorqueConfig computed_torque;
  safety::FaultLadderConfig fault_ladder;
  JointVector damping = JointVector::Zero();  ///< N m s/rad, of the joints while damped
  JointVector place = JointVector::Zero();    ///< rad, where it waits
  double tool = 0.0;                          ///< m, d5: from the wrist to the cup's centre along the last link's z

  /// Throws std::invalid_argument naming the field, its value and the allowed range.
  void validate() const;
};

}  // namespace stance::behaviours
