#pragma once
// The biped's own planning parameters.
#include <cmath>

#include "controller/config/biped_config_yaml.hpp"

namespace stance::planning::test {

inline constexpr double kComHeight = 0.75;  // m
inline constexpr double kHipLateral = 0.1;  // m

inline const behaviours::WalkConfig& walk_config() {
  static const behaviours::WalkConfig config =
      config::biped_config(config::load_robot(config::share_directory() / "robots", "biped")).walk;
  return config;
}
inline double omega() { return std::sqrt(kGravity / kComHeight); }

/// Single support of a steady gait at `velocity` [m/s], `time` [s] after lift-off: in H, from the stance foot.
inline FootholdProblem steady(double side, double time, const Vector2& velocity = Vector2::Zero()) {
  const FootholdConfig& c = walk_config().gait.footholds;
  FootholdProblem problem;
  problem.side = side;
  problem.time = time;
  problem.swing_time = c.swing_time;
  problem.double_support = c.double_support;
  problem.velocity = velocity;
  problem.omega = omega();
  problem.hip_lateral = kHipLateral;
  // At the last change of support, half a double support before lift-off.
  const double period = c.swing_time + c.double_support, growth = std::exp(omega() * period);
  const Vector2 xi_start = steady_offset(c, omega(), velocity, -side);
  const double width = steady_width(c, velocity);
  const Vector2 q_start =
      Vector2(0.0, side * width * growth / (growth + 1.0)) - velocity * (period * growth / (growth - 1.0));
  const double since = std::exp(omega() * (0.5 * c.double_support + time));
  const Vector2 xi = xi_start * since, q = q_start / since;
  problem.com = {0.5 * (xi + q), 0.5 * omega() * (xi - q)};
  problem.swing_foot = {0.0, side * width};
  return problem;
}

}  // namespace stance::planning::test
