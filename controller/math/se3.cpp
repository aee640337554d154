#include "controller/math/se3.hpp"

#include <cmath>

#include "controller/math/rodrigues.hpp"

namespace stance::math {

Matrix6 adjoint(const RigidTransform& T) noexcept {
  Matrix6 Ad;
  Ad << T.R, Matrix3::Zero(), skew(T.p) * T.R, T.R;
  return Ad;
}

Vector6 adjoint_times(const RigidTransform& T, const Vector6& V) noexcept {
  Vector6 out;
  const Vector3 omega = T.R * V.head<3>();
  out << omega, T.R * V.tail<3>() + T.p.cross(omega);
  return out;
}

Vector6 adjoint_transpose_times(const RigidTransform& T, const Vector6& F) noexcept {
  Vector6 out;
  const Vector3 moment = F.head<3>() - T.p.cross(F.tail<3>());
  out << T.R.transpose() * moment, T.R.transpose() * F.tail<3>();
  return out;
}

Matrix6 lie_bracket(const Vector6& V) noexcept {
  const Matrix3 omega = skew(V.head<3>());
  Matrix6 ad;
  ad << omega, Matrix3::Zero(), skew(V.tail<3>()), omega;
  return ad;
}

Vector6 lie_bracket_times(const Vector6& V, const Vector6& W) noexcept {
  const Vector3 omega = V.head<3>(), v = V.tail<3>();
  const Vector3 omega_w = W.head<3>(), v_w = W.tail<3>();
  Vector6 out;
  out << omega.cross(omega_w), v.cross(omega_w) + omega.cross(v_w);
  return out;
}

Vector6 lie_bracket_transpose_times(const Vector6& V, const Vector6& F) noexcept {
  const Vector3 omega = V.head<3>(), v = V.tail<3>();
  const Vector3 moment = F.head<3>(), force = F.tail<3>();
  Vector6 out;
  out << moment.cross(omega) + force.cross(v), force.cross(omega);
  return out;
}

RigidTransform exp_se3(const Vector6& V) noexcept {
  const Rodrigues k = rodrigues(V.head<3>().squaredNorm());
  const Matrix3 K = skew(V.head<3>());
  const Matrix3 K2 = K * K;
  return {Matrix3::Identity() + k.a * K + k.b * K2, V.tail<3>() + K * (k.b * V.tail<3>()) + K2 * (k.c * V.tail<3>())};
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
