#pragma once
// Stepping on two point feet: the gait's plan (planning/), rolled out over the horizon, and the force QP that follows
// it.
//
// The QP is written in W. Its reference is the pendulum that starts where the robot is and rolls over the planned
// footholds; each stage is linearised about that pendulum's centre of mass and force (coupling term, centroidal.hpp).
// The height has an integral, the ground a slope learnt from the touchdowns.
#include <memory>

#include "controller/behaviours/biped_config.hpp"
#include "controller/behaviours/tick.hpp"
#include "controller/planning/horizon.hpp"
#include "controller/planning/velocity.hpp"

namespace stance::behaviours {

using planning::Vector2;

/// Where the robot is, as walking sees it.
struct WalkInput {
  Vector3 rpy = Vector3::Zero();                                  ///< rad, yaw unwrapped
  Vector3 p_WC = Vector3::Zero();                                 ///< m
  Vector3 v_WC = Vector3::Zero();                                 ///< m/s
  Vector3 w_WB_W = Vector3::Zero();                               ///< rad/s
  std::array<Vector3, 2> p_WF{Vector3::Zero(), Vector3::Zero()};  ///< m, tips of the feet
  std::array<bool, 2> contact_switch{};
  Vector2 velocity = Vector2::Zero();  ///< m/s, in H, wanted
  double yaw_rate = 0.0;               ///< rad/s, wanted
  double height_offset = 0.0;          ///< m, wanted
  int periods = 1;                     ///< control periods since the last call
};

class Walk {
 public:
  /// `nominal_height` [m]: of C over the ground; `inertia` [kg m^2]: I_eff on one foot, in H; `hip_lateral` [m]: of a
  /// hip from the trunk's middle. Throws std::invalid_argument.
  Walk(const WalkConfig& config, const HeightConfig& height, const ForceLimits& limits, const force_qp::Settings& qp,
       double mass, const Matrix3& inertia, double nominal_height, double hip_lateral, double foot_radius);

  /// The foot whose swing, after `double_support` [s], promises the better footholds.
  int better_swing(const WalkInput& input, double double_support) const noexcept;

  /// Takes up stepping; after `double_support` [s] foot `swing` lifts.
  void enter(const WalkInput& input, int swing, double double_support) noexcept;

  /// The gait's step, the reference and x of this tick.
  void plan(const WalkInput& input, TickState& out) noexcept;
  void model() noexcept;
  /// Solves, with `time_left` [s] for it; where the status is kSolved, `plan` has the forces in W and the predicted
  /// path.
  QpStatus solve(double time_left, ForcePlan& plan, Trace& trace) noexcept;

  /// Writes what the gait is doing into the trace.
  void note(GaitTrace& trace) const noexcept;

  const planning::Gait& gait() const noexcept { return gait_; }
  /// As `model` made it.
  const force_qp::Problem& problem() const noexcept { return problem_; }
  const planning::VelocityReference& velocity() const noexcept { return velocity_; }

 private:
  planning::GaitInput gait_input(const WalkInput& input) const noexcept;

  WalkConfig config_;
  Height height_;
  ForceLimits limits_;
  centroidal::Parameters parameters_;
  double nominal_height_, foot_radius_;
  planning::VelocityReference velocity_;
  planning::Gait gait_;
  planning::Horizon horizon_;
  force_qp::Problem problem_;
  force_qp::Solution solution_;
  std::unique_ptr<force_qp::ForceQp> qp_;

  double yaw_ = 0.0;
  double crouch_ = 0.0;    // m
  double ground_z_ = 0.0;  // m, under the standing feet
  ContactVectors p_WG_ = zero_contact_vectors();
};

}  // namespace stance::behaviours
