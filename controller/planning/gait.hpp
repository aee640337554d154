#pragma once
// The gait of two feet: double and single support in turn, with footholds and times planned anew each tick.
#include <array>

#include "controller/planning/footholds.hpp"
#include "controller/planning/swing.hpp"

namespace stance::planning {

enum class GaitPhase { kDoubleSupport, kSingleSupport };

struct GaitConfig {
  FootholdConfig footholds;
  SwingConfig swing;
  double first_double_support = 0.0;     ///< s, before the first step of a walk
  double capture_double_support = 0.0;   ///< s, before the first step that a push asks for
  double recovery_double_support = 0.0;  ///< s, while recovering
  double recovery_threshold = 0.0;       ///< m, of the recovery measure, above which the gait recovers
  double freeze = 0.0;                   ///< s before touchdown, in which time and crossing stand
  double touchdown_phase = 0.0;          ///< of the swing, from which a closed switch is a touchdown
  double touchdown_speed = 0.0;          ///< m/s over the ground, above which a foot that touches it has not landed
  double slope_gain = 0.0;               ///< of a step's slope, into the estimate
  double slope_min_step = 0.0;           ///< m, of a step that tells a slope
  double max_slope = 0.0;                ///< 1
  void validate() const;                 ///< throws std::invalid_argument naming the field, its value and the range
};

/// Where the robot is, as the gait sees it. Foot 0 is the left one.
struct GaitInput {
  Pendulum com;                                                   ///< in W
  std::array<Vector3, 2> p_WF{Vector3::Zero(), Vector3::Zero()};  ///< m, tips
  std::array<bool, 2> contact_switch{};
  Vector2 velocity = Vector2::Zero();  ///< m/s, wanted, in H
  double yaw = 0.0;                    ///< rad, of H
};

struct GaitState {
  GaitPhase phase = GaitPhase::kDoubleSupport;
  int swing = 0;                       ///< the foot that swings, or will next
  double time = 0.0;                   ///< s, since the phase began
  double swing_time = 0.0;             ///< s, of this swing
  double next_swing_time = 0.0;        ///< s, of the one after
  double double_support = 0.0;         ///< s, of this one, or of the next
  Vector2 foothold = Vector2::Zero();  ///< m, of this swing, in W
  double foothold_z = 0.0;             ///< m, expected there, of the foot's tip
  int crossing = 0;
  bool recovering = false;
  int steps = 0;                                                  ///< touchdowns since the start
  double slope = 0.0;                                             ///< dz/dx of the ground, forward in H
  std::array<Vector3, 2> p_WF{Vector3::Zero(), Vector3::Zero()};  ///< m, tips: where they stand, or stood last

  bool stance(int foot) const noexcept { return phase == GaitPhase::kDoubleSupport || foot != swing; }
  int support() const noexcept { return 1 - swing; }  ///< the foot that stands in single support
  /// How much of its load a foot still bears: falls over the double support of the one about to lift.
  double load(int foot) const noexcept;
};

class Gait {
 public:
  /// `omega` [1/s] of the pendulum, `hip_lateral` [m] of a hip from the trunk's middle.
  Gait(const GaitConfig& config, double omega, double hip_lateral);

  /// Begins with double support; then `swing` lifts.
  void start(int swing, double double_support, const GaitInput& input) noexcept;

  /// `dt` [s] since the last step (or start).
  void step(const GaitInput& input, double dt) noexcept;

  const GaitState& state() const noexcept { return state_; }
  const SwingReference& swing() const noexcept { return swing_.reference(); }
  const GaitConfig& config() const noexcept { return config_; }
  double omega() const noexcept { return omega_; }

  /// What plan_footholds is given for a swing of `swing` about `support` [m, in W].
  FootholdProblem problem(const Pendulum& com, const Vector2& support, const Vector2& swing_foot, int swing,
                          const Vector2& velocity, double yaw) const noexcept;
  double double_support() const noexcept;  ///< s, of the coming ones

 private:
  bool landed(const GaitInput& input, double dt) const noexcept;
  void touch_down(const GaitInput& input) noexcept;
  void plan(const GaitInput& input) noexcept;

  GaitConfig config_;
  double omega_, hip_lateral_;
  Swing swing_;
  GaitState state_;
  Vector3 p_swing_ = Vector3::Zero();  // m, tip of the foot that swings or will next, at the last step
};

}  // namespace stance::planning
