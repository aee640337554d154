#pragma once
// The catcher's tick: validate, calibrate and filter, plan the catch, move by computed torque, safety.
//
//   uncalibrated   waits for the camera's points; refused ones are told with their reason
//   waiting        in its place, until a ball is in flight
//   catching       on its way to where the interception has it, decided anew each tick. Where the quintic that leads
//                  there keeps to the limits, the cup meets the ball giving way, with a share of its velocity
//   holding        the ball should be in the cup, which comes to rest, and then turns up
//   returning      to its place
// The joints follow a reference that planning/joint_motion.hpp moves. Its command, for the middle of its effect:
//   feedforward_torque = Newton-Euler of (q, v, a)      position = q      velocity = v
//   gains = M_ii kp, M_ii kd, closed by the drives at their own rate                              (computed torque)
#include "controller/behaviours/ball_track.hpp"
#include "controller/behaviours/catcher_config.hpp"
#include "controller/math/se3.hpp"
#include "controller/rigid_body/chain.hpp"
#include "controller/safety/intake.hpp"

namespace stance::behaviours {

class CatcherController {
 public:
  /// Takes all memory. Throws std::invalid_argument where the model is not document 001's arm or the configuration is
  /// out of range.
  CatcherController(const CatcherConfig& config, const rigid_body::Model& model);
  CatcherController(const CatcherController&) = delete;  // the intake refers to the model
  CatcherController& operator=(const CatcherController&) = delete;

  /// One tick. The same inputs since construction give the same outputs, bit for bit. A state of another run starts
  /// afresh.
  void step(const TickInput& input, StageClock& clock, TickOutput& out) noexcept;

 private:
  /// What a run has made of the controller so far: a new run starts with a new one.
  struct Memory {
    std::int64_t calibration_seq = 0;        ///< of the last points
    std::int64_t ball_utime = -1;            ///< us, of the last observation
    RigidTransform T_AK;                     ///< of the camera
    bool moving = false;                     ///< the reference has begun
    int periods = 0;                         ///< control periods since the reference was moved
    JointVector give = JointVector::Zero();  ///< rad/s, with which the joints are to meet the ball
    planning::JointMotion motion;            ///< the reference, at the last state acted on
    double phase_time = 0.0;                 ///< s, since the phase began
    TickOutput last;                         ///< what HOLD repeats
  };

  void start_run(std::int64_t run_id) noexcept;
  void calibrate(const TickInput& input, CatchPlan& plan) noexcept;
  void observe(const TickInput& input, BallEstimate& ball, CatchPlan& plan) noexcept;
  void plan(const RobotState& state, double dt, CatchPlan& plan) noexcept;
  void enter(CatchPhase phase, CatchPlan& plan) noexcept;
  void intercept(const RobotState& state, double dt, CatchPlan& plan) noexcept;
  void move(const RobotState& state, double dt, CatchPlan& plan) noexcept;
  JointVector upright(const JointVector& q) const noexcept;
  JointVector within_limits(const JointVector& q) const noexcept;
  JointVector choose_give(const planning::InterceptionPlan& found, double left, double dt) const noexcept;
  JointVector give(const planning::InterceptionPlan& found) const noexcept;
  void computed_torque(const planning::JointMotion& reference, JointCommand& command) const noexcept;
  /// What the arm is commanded in DAMP and STOP.
  void give_up(SafetyMode mode, TickOutput& out) const noexcept;

  CatcherConfig config_;
  rigid_body::Model model_;
  rigid_body::ScrewTree tree_;
  rigid_body::Tip cup_;
  kinematics::Arm5Geometry arm_;

  Memory memory_;
  safety::FaultLadder ladder_;
  safety::Intake intake_;
  BallTrack track_;
  planning::Interception interception_;
};

}  // namespace stance::behaviours
