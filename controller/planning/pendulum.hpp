#pragma once
// The linear inverted pendulum at constant height: p'' = omega^2 (p - z), z the point where the ground's force acts.
// Its divergent component of motion xi = p + p'/omega obeys xi' = omega (xi - z), the convergent one q = p - p'/omega
// obeys q' = -omega (q - z).
#include <Eigen/Core>

namespace stance::planning {

using Vector2 = Eigen::Vector2d;

struct Pendulum {
  Vector2 p = Vector2::Zero();  ///< m, centre of mass over the ground
  Vector2 v = Vector2::Zero();  ///< m/s

  Vector2 divergent(double omega) const noexcept { return p + v / omega; }
  Vector2 convergent(double omega) const noexcept { return p - v / omega; }
};

/// After `time` [s] about the fixed point `z` [m]; `omega` [1/s] = sqrt(g / height).
Pendulum swung(const Pendulum& start, const Vector2& z, double omega, double time) noexcept;

}  // namespace stance::planning
