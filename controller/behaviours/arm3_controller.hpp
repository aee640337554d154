#pragma once
// The 3-joint arm's tick: validate, play and integrate the motion (document 004), follow it by torque, safety.
//
// A motion plays joint rates; the velocity kinematics of kinematics/arm3.hpp turn them into the end effector's velocity
// and back, and Euler's method makes of them the reference theta. The arm moves as masses do, so that it follows by
//   feedforward_torque = Newton-Euler(q_r, qd_r, qdd_r)    position = q_r    velocity = qd_r
//   q_r = theta + thetad lead,  qd_r = thetad,  qdd_r = (thetad - thetad of the tick before) / dt
// with gains M_ii kp and M_ii kd, M the mass matrix at q_r, closed by the drives at their own rate.
#include "controller/behaviours/arm3_config.hpp"
#include "controller/rigid_body/screw_tree.hpp"

namespace stance::behaviours {

class Arm3Controller {
 public:
  /// Takes all memory. Throws std::invalid_argument where the model is not the document's arm or the configuration is
  /// out of range.
  Arm3Controller(const Arm3Config& config, const rigid_body::Model& model);
  Arm3Controller(const Arm3Controller&) = delete;  // the intake refers to the model
  Arm3Controller& operator=(const Arm3Controller&) = delete;

  /// One tick. The same inputs since construction give the same outputs, bit for bit. A state of another run starts
  /// afresh.
  void step(const TickInput& input, StageClock& clock, TickOutput& out) noexcept;

 private:
  /// What a run has made of the controller so far: a new run starts with a new one.
  struct Memory {
    bool moving = false;                    ///< there is a reference
    Behaviour wanted = Behaviour::kStand;   ///< by the operator, last
    Behaviour playing = Behaviour::kStand;  ///< kStand: holds still
    std::int64_t steps = 0;                 ///< of the motion
    Vector3 rate = Vector3::Zero();         ///< rad/s, of the reference, last
    TickOutput last;                        ///< what HOLD repeats
  };

  void start_run(std::int64_t run_id) noexcept;
  /// Begins, ends and gives up motions.
  void choose_motion(const JointVector& q) noexcept;
  void play(int periods, TickOutput& out) noexcept;
  Vector3 given_rate(double time) const noexcept;
  /// Rates that keep the reference off the joints' limits: 0 for a joint that would not.
  Vector3 within_limits(const Vector3& rate) noexcept;
  void follow(const Arm3Motion& motion, JointCommand& command) noexcept;
  /// What the arm is commanded in DAMP and STOP.
  void give_up(SafetyMode mode, JointCommand& command) const noexcept;

  Arm3Config config_;
  rigid_body::Model model_;
  rigid_body::ScrewTree tree_;

  Memory memory_;
  safety::FaultLadder ladder_;
  safety::Intake intake_;
  kinematics::Arm3Integrator integrator_;
};

}  // namespace stance::behaviours
