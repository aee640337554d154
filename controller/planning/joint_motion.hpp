#pragma once
// How joints go from where they are to a target, there with a wanted speed and no acceleration, within limits of speed
// and acceleration, decided anew each tick. Nothing here allocates or throws.
//
// With time T left, a joint at (q, v, a) follows the quintic that ends at (target, speed, 0):
//   q(t) = q + v t + a t^2/2 + c3 t^3 + c4 t^4 + c5 t^5,      d = target - q - v T - a T^2/2, dv = speed - v - a T, da
//   = -a c3 = (10 d - 4 dv T + da T^2/2) / T^3    c4 = (-15 d + 7 dv T - da T^2) / T^4    c5 = (6 d - 3 dv T + da
//   T^2/2) / T^5
// Where that would pass a limit on its way, or no time is left, the joint instead makes for the line along which it
// would come to the target with that speed, over it by the speed from which it can still stop there, sqrt(2 b |e|) with
// b a share of its acceleration: as fast as it may. Where it would be late so and time matters more than its speed, it
// passes the target with the least speed that has it there on time, or the most that it may have: from v to s in T, at
// most `max_speed` on the way,
//   far(s) = (p^2 - v^2) / 2a + (p^2 - s^2) / 2b + p (T - (p - v) / a - (p - s) / b)
//   p      = min(max_speed, (T + v/a + s/b) / (1/a + 1/b))                                    (its greatest speed)
// From rest to rest over a distance d the quintic's peaks are 15/8 d/T and 10/sqrt(3) d/T^2: the time that it needs.
#include <cstdint>
#include <limits>

#include "controller/interface/signals.hpp"

namespace stance::planning {

struct JointMotionLimits {
  JointVector speed = JointVector::Zero();         ///< rad/s
  JointVector acceleration = JointVector::Zero();  ///< rad/s^2
  /// rad, where a joint that passes its target must be able to stop, and which keeps_to_limits() keeps to.
  JointVector lower = JointVector::Constant(-std::numeric_limits<double>::infinity());
  JointVector upper = JointVector::Constant(std::numeric_limits<double>::infinity());
};

/// Where a motion's joints are.
struct JointMotion {
  JointVector q = JointVector::Zero();  ///< rad
  JointVector v = JointVector::Zero();  ///< rad/s
  JointVector a = JointVector::Zero();  ///< rad/s^2
};

/// What a joint gives up that cannot be at its target both on time and with its speed.
enum class Priority : std::uint8_t {
  kSpeed,  ///< it is late
  kTime,   ///< it passes on time
};

/// `motion` a time `dt` (s, > 0) on, on its way to `target` [rad] with `speed` [rad/s] in `time_left` (s, of any sign).
/// Of the first `joints`.
void advance(const JointMotionLimits& limits, int joints, const JointVector& target, const JointVector& speed,
             double time_left, Priority priority, double dt, JointMotion& motion) noexcept;

/// Does the quintic from `motion` to `target` with `speed` in `time_left` (s, > 0) keep to the limits?
bool keeps_to_limits(const JointMotionLimits& limits, int joints, const JointVector& target, const JointVector& speed,
                     double time_left, const JointMotion& motion) noexcept;

/// s that the quintic needs from `motion` to rest at `target`, near enough to compare targets by.
double time_needed(const JointMotionLimits& limits, int joints, const JointMotion& motion,
                   const JointVector& target) noexcept;

}  // namespace stance::planning
