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
  Vector6 V;
  V << omega, left_jacobian_inverse_so3(omega) * T.p;
  return V;
}

}  // namespace stance::math
