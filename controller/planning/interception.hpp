#pragma once
// Where and when an arm of document 001 meets a ball: decided anew each tick, over candidates (time x pitch x solution
// of the inverse kinematics). Frame A is the arm's base. Nothing here allocates or throws.
//
// The ball coasts,  pd = v,  vd = g - k |v| v.  At a time t the cup may meet it at p(t) with its axis against the
// ball's velocity: in the arm's vertical plane through p, v_r along the plane's horizontal,
//   pitch = atan2(-v_r, v_z) + offset,  roll 0,       so that for offset 0 the axis is -(v_r, v_z) / |(v_r, v_z)|;
// from an arm that reaches over its own back the same axis is at the negative pitch. Of all that it costs least,
//   motion    max_i |q_i - q_now_i| / speed_i                         [s]
//   facing    angle^2, and what it is over `max_facing`: between the cup's axis and the ball's velocity reversed, which
//             has a part across the arm's plane,  cos(angle) = cos(offset) |(v_r, v_z)| / |v|
//   lateness  what is missing of `spare_time` between the time needed and the time left
//   reach     by how much the cup stays short of a ball barely out of reach: the wrist's circle about the shoulder is
//             closed by up to `reach_slack`
//   change    of the plan of the tick before, in time and in posture
// is the plan. From `commit` before the meeting on, the cup only follows the ball's way, by the least motion: where the
// estimate's way passes the cup of the posture q by e, across its direction v, with w = accelerations^2
//   q += s W J^T D^T (D J W J^T D^T + mu 1)^-1 e,  D (2 x 3): across v,  J: the cup's Jacobian,  W = diag(w),
// within the joints' limits, while that brings the cup nearer to the way, and the meeting is when the ball passes the
// cup there. What the estimate changes along the way costs no motion so. s <= 1 leaves each joint no more than its
// speed takes it in the time left, and mu is a small share of the trace: a stretched arm may not get nearer.
// `min_height` is not looked at any more. A meeting put off beyond 1.5 `commit` is another ball's, and planned anew.
#include <array>
#include <cstdint>

#include "controller/kinematics/arm5.hpp"
#include "controller/planning/joint_motion.hpp"

namespace stance::planning {

inline constexpr int kPitchOffsets = 9;

struct InterceptionConfig {
  double earliest = 0.0;                              ///< s ahead
  double latest = 0.0;                                ///< s ahead
  double step = 0.0;                                  ///< s between candidates
  std::array<double, kPitchOffsets> pitch_offsets{};  ///< rad, of the cup's axis from the ball's velocity
  double min_height = 0.0;                            ///< m, of the cup over A's origin
  double limit_margin = 0.0;                          ///< rad, from the joints' limits to the motion's
  double reach_slack = 0.0;                           ///< m
  double commit = 0.0;                                ///< s
  double spare_time = 0.0;                            ///< s
  double max_facing = 0.0;                            ///< rad, beyond which turned_away_cost counts
  double facing_cost = 0.0;                           ///< 1/rad^2
  double turned_away_cost = 0.0;                      ///< 1/rad, of what is over max_facing
  double lateness_cost = 0.0;                         ///< 1/s
  double reach_cost = 0.0;                            ///< 1/m
  double time_change_cost = 0.0;                      ///< 1/s
  double posture_change_cost = 0.0;                   ///< 1/s, of the motion from the last plan's posture to this one's

  /// Throws std::invalid_argument naming the field, its value and the range.
  void validate() const;
};

/// A ball in flight.
struct BallState {
  Vector3 p_A = Vector3::Zero();  ///< m
  Vector3 v_A = Vector3::Zero();  ///< m/s
  double drag = 0.0;              ///< 1/m, k
  /// A time `dt` (s, of any sign) on, by the midpoint rule.
  void coast(double dt) noexcept;
  /// To where it is nearest to `point_A` [m], at most back to `from` (s, <= 0) and on to `to` (s, >= 0). Returns the
  /// time that this took [s].
  double coast_to_nearest(const Vector3& point_A, double from, double to) noexcept;
  /// Two directions across its way, of unit length and square to each other.
  Eigen::Matrix<double, 2, 3> across() const noexcept;
};

enum class InterceptionStatus : std::uint8_t {
  kPlanned,
  kTime,   ///< the arm gets there late; it goes all the same
  kReach,  ///< there is no posture that meets the ball
};

struct InterceptionPlan {
  InterceptionStatus status = InterceptionStatus::kReach;
  double time = 0.0;                    ///< s, of the caller's clock
  Vector3 p_ABall = Vector3::Zero();    ///< m, where the ball will be
  Vector3 v_ABall = Vector3::Zero();    ///< m/s, the same
  JointVector q = JointVector::Zero();  ///< rad, the posture that meets it
  double slack = 0.0;                   ///< s, left less needed
  bool committed = false;

  bool exists() const noexcept { return status != InterceptionStatus::kReach; }
};

class Interception {
 public:
  /// Throws std::invalid_argument: config.validate()'s, or motion limits that are not finite or leave a joint nothing.
  Interception(const InterceptionConfig& config, const kinematics::Arm5Geometry& arm,
               const JointMotionLimits& motion_limits);

  /// Plans for the ball that is in `ball` at `now` [s], for an arm in `motion`.
  const InterceptionPlan& update(double now, const BallState& ball, const JointMotion& motion) noexcept;
  const InterceptionPlan& plan() const noexcept { return plan_; }
  /// The next ball is another one.
  void reset() noexcept { plan_ = InterceptionPlan{}; }

 private:
  void follow(double now, BallState ball, const JointMotion& motion) noexcept;
  /// rad, t1 of an arm whose plane holds `p_A`, on its side.
  double bearing(const Vector3& p_A) const noexcept;
  /// Of the ball's speed, what lies in the arm's plane: the cosine of the angle to it.
  double in_plane(const BallState& ball) const noexcept;
  /// Calls `take(q, short_of)` for each posture with the cup at `ball`'s place, its axis at `offset`.
  template <typename Take>
  void postures(const BallState& ball, double offset, const Take& take) const noexcept;
  double short_of_reach(const Vector3& p_A, double bearing, double pitch, Vector3& p_reached) const noexcept;

  InterceptionConfig config_;
  kinematics::Arm5Geometry arm_;
  kinematics::Arm5Limits limits_;
  JointMotionLimits motion_limits_;
  double farthest_ = 0.0;  ///< m, of the cup from the shoulder's axis
  InterceptionPlan plan_;
};

}  // namespace stance::planning
