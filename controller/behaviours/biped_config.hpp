#pragma once
// All that robots/biped/biped.yaml says under `controller`: one struct a module, each with its own validate().
#include "controller/behaviours/height.hpp"
#include "controller/estimation/base_estimator.hpp"
#include "controller/estimation/com_offset_observer.hpp"
#include "controller/force_qp/force_qp.hpp"
#include "controller/kinematics/fallen.hpp"
#include "controller/planning/horizon.hpp"
#include "controller/planning/velocity.hpp"
#include "controller/safety/fault_ladder.hpp"
#include "controller/safety/intake.hpp"

namespace stance::behaviours {

struct ForceLimits {
  double friction = 0.0;          ///< mu of the planned forces
  double normal_force_min = 0.0;  ///< N, of a contact in stance
  double normal_force_max = 0.0;  ///< N
};

struct StandConfig {
  int stages = 1;                                           ///< N, of kControlPeriod each
  CentroidalState state_weights = CentroidalState::Zero();  ///< Q's diagonal
  double force_weight = 0.0;                                ///< R's diagonal
};

struct WalkConfig {
  planning::HorizonConfig horizon;
  planning::GaitConfig gait;
  planning::VelocityConfig velocity;
  double friction = 0.0;                                       ///< mu of the planned forces
  CentroidalState state_weights = CentroidalState::Zero();     ///< Q's diagonal, per control period
  CentroidalState recovery_weights = CentroidalState::Zero();  ///< the same while recovering
  double force_weight = 0.0;                                   ///< R's diagonal, per control period
  double recovery_crouch = 0.0;                                ///< m, by which C is lower while recovering
  double crouch_rate = 0.0;                                    ///< m/s, at which it gets there and back
};

/// When a standing robot takes a step, and when a stepping one stands again.
struct SteppingConfig {
  planning::Vector2 capture =
      planning::Vector2::Zero();  ///< m, of xi from the feet's middle, in H, above which it steps
  double capture_pitch = 0.0;     ///< rad, of the trunk capture_lead on at its present rate, the same
  double capture_lead = 0.0;      ///< s
  int min_steps = 0;              ///< before it may stand again
  planning::Vector2 settled = planning::Vector2::Zero();  ///< m, of xi from the feet's middle, below which it may
  double settled_feet = 0.0;                              ///< m, fore and aft between the feet, the same
  double settled_pitch = 0.0;                             ///< rad, the same
};

struct TorqueMapConfig {
  double null_space_kp = 0.0;      ///< 1/s^2
  double null_space_kd = 0.0;      ///< 1/s
  double lead = 0.0;               ///< s, from the state to the middle of its command's effect
  double max_posture_error = 0.0;  ///< rad, of a stance leg's joint, that its gains see
  double swing_kp = 0.0;           ///< 1/s^2, of the swing leg's joints
  double swing_kd = 0.0;           ///< 1/s
  double swing_lead = 0.0;         ///< s, the same as lead
  double max_ankle = 0.0;  ///< m, from the hip's pitch axis to the last link's begin, above which that link stretches
  double max_reach = 0.0;  ///< m, from the hip's pitch axis to the foot, of a swing leg
  double limit_margin = 0.0;  ///< rad, that a swing leg keeps from its joints' limits
};

struct BipedConfig {
  double last_link_pitch = 0.0;  ///< rad, of a leg's last link against the vertical
  estimation::BaseEstimatorConfig estimator;
  estimation::CentreOfMassOffsetConfig com_offset_observer;
  double com_offset_quiet_momentum = 0.0;  ///< kg m^2/s, about C, above which the observer waits
  force_qp::Settings force_qp;
  ForceLimits force_limits;
  HeightConfig height;
  StandConfig stand;
  WalkConfig walk;
  SteppingConfig stepping;
  TorqueMapConfig torque_map;
  safety::FaultLadderConfig fault_ladder;
  safety::IntakeConfig intake;
  kinematics::FallLimits fallen;
  JointVector damping = JointVector::Zero();  ///< N m s/rad, of the joints while damped

  /// Throws std::invalid_argument naming the field, its value and the allowed range.
  void validate() const;
};

}  // namespace stance::behaviours
