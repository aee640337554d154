#include "controller/math/se3.hpp"

#include <cmath>

#include "controller/math/rodrigues.hpp"

namespace stance::math {

Matrix6 adjoint(const RigidTransform& T) noexcept {
  Matrix6 Ad;
  Ad << T.R, Matrix3::Zero(), skew(T.p) * T.R, T.R;
  return Ad;
}

Matrix6 lie_bracket(const Vector6& V) noexcept {
  const Matrix3 omega = skew(V.head<3>());
  Matrix6 ad;
  ad << omega, Matrix3::Zero(), skew(V.tail<3>()), omega;
  return ad;
}

RigidTransform exp_se3(const Vector6& V) noexcept {
  const Vector3 omega = V.head<3>(), v = V.tail<3>();
  const double angle2 = omega.squaredNorm();
  const Rodrigues k = rodrigues(angle2);
  // [omega]x^2 = omega omega^T - |omega|^2 1
  Matrix3 R = (k.b * omega) * omega.transpose() + k.a * skew(omega);
  R.diagonal().array() += 1.0 - k.b * angle2;
  const Vector3 omega_v = omega.cross(v);
  return {R, v + k.b * omega_v + k.c * omega.cross(omega_v)};
}

Vector6 log_se3(const RigidTransform& T) noexcept {
  const Vector3 omega = log_so3(T.R);
  const double angle2 = omega.squaredNorm();
  const double half = 0.5 * std::sqrt(angle2);
  // (1 - h cot h) / (2 h)^2 of the half angle h, by series where it loses digits; h cos h / sin h is well behaved up to
  // pi.
  const double d = angle2 < 1e-4 ? 1.0 / 12.0 + angle2 / 720.0 * (1.0 + angle2 / 42.0)
                                 : (1.0 - half * std::cos(half) / std::sin(half)) / angle2;
  Vector6 V;
  V << omega, T.p - 0.5 * omega.cross(T.p) + d * omega.cross(omega.cross(T.p));
  return V;
}

}  // namespace stance::math
