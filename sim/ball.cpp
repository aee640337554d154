#include "sim/ball.hpp"

#include <cmath>
#include <stdexcept>

#include "sim/world.hpp"

namespace stance::sim {

Vector3 flight_acceleration(const BallModel& ball, const Vector3& v_W) noexcept {
  return Vector3(0.0, 0.0, -kGravity) - ball.drag * v_W.norm() * v_W;
}

Vector3 launch_velocity(const BallModel& ball, const Vector3& from_W, const Vector3& aim_W, double flight_time) {
  constexpr int most = 60;
  constexpr double close = 1e-9;  // m
  const auto steps = static_cast<int>(std::lround(flight_time / kPhysicsStep));
  Vector3 launch = (aim_W - from_W) / flight_time;
  for (int i = 0; i < most; ++i) {
    Vector3 p = from_W, v = launch;
    for (int k = 0; k < steps; ++k) {  // as Bullet steps
      v += kPhysicsStep * flight_acceleration(ball, v);
      p += kPhysicsStep * v;
    }
    const Vector3 error = aim_W - p;
    if (error.norm() < close) return launch;
    launch += error / flight_time;
  }
  throw std::invalid_argument(
      "a throw's drag is too strong for its distance and flight_time: make one of them smaller");
}

}  // namespace stance::sim
