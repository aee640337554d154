#pragma once
// A thrown ball: how it flies, and how it is thrown so that it comes by a point.
#include "controller/math/so3.hpp"

namespace stance::sim {

struct BallModel {
  double radius = 0.0;       ///< m
  double mass = 0.0;         ///< kg
  double drag = 0.0;         ///< 1/m: k of the acceleration -k |v| v
  double restitution = 0.0;  ///< of its impacts, on whatever
  double friction = 0.0;     ///< mu, the same
};

/// m/s^2, in W, of a ball that flies with `v_W`.
Vector3 flight_acceleration(const BallModel& ball, const Vector3& v_W) noexcept;

/// m/s: the velocity in W with which a ball that leaves `from_W` is at `aim_W` [m] after `flight_time` [s], in steps of
/// the physics. Throws std::invalid_argument where drag lets no throw do that.
Vector3 launch_velocity(const BallModel& ball, const Vector3& from_W, const Vector3& aim_W, double flight_time);

}  // namespace stance::sim
