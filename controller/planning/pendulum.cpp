#include "controller/planning/pendulum.hpp"

#include <cmath>

namespace stance::planning {

Pendulum swung(const Pendulum& start, const Vector2& z, double omega, double time) noexcept {
  const double grown = std::exp(omega * time);
  const Vector2 xi = z + (start.divergent(omega) - z) * grown;
  const Vector2 q = z + (start.convergent(omega) - z) / grown;
  return {0.5 * (xi + q), 0.5 * omega * (xi - q)};
}

}  // namespace stance::planning
