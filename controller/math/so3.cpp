#include "controller/math/so3.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "controller/math/rodrigues.hpp"

namespace stance::math {

Matrix3 skew(const Vector3& v) noexcept {
  Matrix3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Matrix3 exp_so3(const Vector3& v) noexcept {
  const Rodrigues k = rodrigues(v.squaredNorm());
  const Matrix3 K = skew(v);
  return Matrix3::Identity() + k.a * K + k.b * K * K;
}

Vector3 log_so3(const Matrix3& R) noexcept {
  // Through the quaternion: well conditioned at every angle, pi included.
  Quaternion q(R);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  const double s = q.vec().norm();
  if (s < 1e-10) return 2.0 * q.vec();
  return (2.0 * std::atan2(s, q.w()) / s) * q.vec();
}

Matrix3 left_jacobian_inverse_so3(const Vector3& v) noexcept {
  const double angle2 = v.squaredNorm();
  const double half = 0.5 * std::sqrt(angle2);
  // By series where the quotient loses digits; h cos h / sin h is well behaved up to pi.
  const double d = angle2 < 1e-4 ? 1.0 / 12.0 + angle2 / 720.0 * (1.0 + angle2 / 42.0)
                                 : (1.0 - half * std::cos(half) / std::sin(half)) / angle2;
  const Matrix3 K = skew(v);
  return Matrix3::Identity() - 0.5 * K + d * K * K;
}

Matrix3 rotation_from_rpy(const Vector3& rpy) noexcept {
  const double cr = std::cos(rpy.x()), sr = std::sin(rpy.x());
  const double cp = std::cos(rpy.y()), sp = std::sin(rpy.y());
  const double cy = std::cos(rpy.z()), sy = std::sin(rpy.z());
  Matrix3 R;
  R << cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,  //
      sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,   //
      -sp, cp * sr, cp * cr;
  return R;
}

Vector3 rpy_from_rotation(const Matrix3& R) noexcept {
  return {std::atan2(R(2, 1), R(2, 2)), std::asin(std::clamp(-R(2, 0), -1.0, 1.0)), std::atan2(R(1, 0), R(0, 0))};
}

Matrix3 rotation_z(double angle) noexcept {
  const double c = std::cos(angle), s = std::sin(angle);
  Matrix3 R;
  R << c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0;
  return R;
}

double unwrap(double angle, double near) noexcept {
  constexpr double turn = 2.0 * std::numbers::pi;
  return angle + turn * std::round((near - angle) / turn);
}

}  // namespace stance::math
