#pragma once
// Horizontal vectors between W and the heading frame H, which is W turned by `yaw` [rad] about z.
#include <cmath>

#include "controller/planning/pendulum.hpp"

namespace stance::planning {

inline Vector2 in_heading(double yaw, const Vector2& v_W) noexcept {
  const double c = std::cos(yaw), s = std::sin(yaw);
  return {c * v_W.x() + s * v_W.y(), -s * v_W.x() + c * v_W.y()};
}
inline Vector2 in_world(double yaw, const Vector2& v_H) noexcept { return in_heading(-yaw, v_H); }

}  // namespace stance::planning
