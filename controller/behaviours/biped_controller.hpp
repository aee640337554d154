#pragma once
// The biped's tick: validate, estimate, plan, model, force QP, torque map, safety.
#include <array>

#include "controller/behaviours/biped_config.hpp"
#include "controller/behaviours/stand.hpp"
#include "controller/behaviours/torque_map.hpp"
#include "controller/behaviours/walk.hpp"
#include "controller/estimation/base_estimator.hpp"
#include "controller/estimation/com_offset_observer.hpp"
#include "controller/safety/fault_ladder.hpp"
#include "controller/safety/intake.hpp"

namespace stance::behaviours {

class BipedController {
 public:
  /// Takes all memory. Throws std::invalid_argument where the model is no biped or the configuration is out of range.
  BipedController(const BipedConfig& config, const rigid_body::Model& model, const std::vector<rigid_body::Foot>& feet,
                  const JointVector& nominal_joint_position);
  BipedController(const BipedController&) = delete;  // the torque map refers to the model
  BipedController& operator=(const BipedController&) = delete;

  /// One tick. The same inputs since construction give the same outputs, bit for bit. A state of another run starts
  /// afresh.
  void step(const TickInput& input, StageClock& clock, TickOutput& out) noexcept;

  /// The force QP of the last tick that stepped.
  const force_qp::Problem& stepping_problem() const noexcept { return walk_.problem(); }

 private:
  static constexpr int kFeet = 2;

  /// What a run has made of the controller so far: a new run starts with a new one.
  struct Memory {
    double yaw = 0.0;           ///< rad, unwrapped
    std::int64_t plan_age = 0;  ///< control periods since the plan was made or shifted
    bool standing = false;      ///< the stance has been taken up
    bool stepping = false;
    bool lying = false;  ///< let down: nothing but a new run ends it
    TickOutput last;     ///< what HOLD repeats
  };

  void start_run(std::int64_t run_id) noexcept;
  /// To a robot that does not lie.
  safety::Offer offer() const noexcept;
  void estimate(int periods, const RobotState& state, BaseEstimate& base) noexcept;
  void plan(int periods, const RobotState& state, Trace& trace) noexcept;
  void stand(const WalkInput& now, TickState& reference) noexcept;
  /// From standing to stepping and back, and from standing to lying.
  void choose_behaviour(const WalkInput& now) noexcept;
  bool lying_down() const noexcept { return intake_.user_command().behaviour == Behaviour::kLieDown; }
  std::array<LegTask, kFeet> leg_tasks(const ForcePlan& plan) const noexcept;
  /// The plan of this tick: solved, else the last one shifted to now.
  void make_plan(const TickInput& input, TickOutput& out) noexcept;
  ContactFlags standing_feet() const noexcept;
  estimation::ContactPlan contact_plan() const noexcept;
  /// No forces: what the robot is commanded in DAMP and STOP.
  void give_up(SafetyMode mode, TickOutput& out) const noexcept;

  BipedConfig config_;
  rigid_body::Model model_;
  std::array<rigid_body::Foot, kFeet> feet_;
  std::array<kinematics::LegGeometry, kFeet> legs_;
  estimation::BaseEstimator fresh_estimator_;  ///< as constructed, for a new run
  estimation::CentreOfMassOffsetObserver fresh_observer_;

  Memory memory_;
  safety::Intake intake_;
  safety::FaultLadder ladder_;
  estimation::BaseEstimator estimator_;
  estimation::CentreOfMassOffsetObserver observer_;
  BodyDynamics body_;
  TorqueMap torque_map_;
  Stand stand_;
  Walk walk_;
};

}  // namespace stance::behaviours
