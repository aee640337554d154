#pragma once
// The coefficients that the exponentials of so3 and se3 share.
#include <cmath>

namespace stance::math {

/// exp([v]x) = 1 + a [v]x + b [v]x^2, and its mean over the path from 0 to v is 1 + b [v]x + c [v]x^2.
struct Rodrigues {
  double a;  ///< sin(angle) / angle
  double b;  ///< (1 - cos(angle)) / angle^2
  double c;  ///< (angle - sin(angle)) / angle^3
};

/// For angle^2 = |v|^2, by series where the quotients lose digits.
inline Rodrigues rodrigues(double angle2) noexcept {
  if (angle2 < 1e-6) {
    return {1.0 - angle2 / 6.0 * (1.0 - angle2 / 20.0), 0.5 - angle2 / 24.0 * (1.0 - angle2 / 30.0),
            1.0 / 6.0 - angle2 / 120.0 * (1.0 - angle2 / 42.0)};
  }
  const double angle = std::sqrt(angle2);
  const double sine = std::sin(angle);
  // 1 - cos(angle), without its cancellation.
  const double sine_half = std::sin(0.5 * angle);
  return {sine / angle, 2.0 * sine_half * sine_half / angle2, (angle - sine) / (angle2 * angle)};
}

}  // namespace stance::math
