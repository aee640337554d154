#pragma once
// Rigid transforms, twists and wrenches: adjoint, Lie bracket, exponential and logarithm of SE(3).
//
// A six-vector is angular first: twist V = (omega, v), wrench F = (moment, force); F^T V is power.
// Reference: Lynch and Park, Modern Robotics (2017), sections 3.3, 3.4 and 8.3.
#include <Eigen/Core>

#include "controller/math/so3.hpp"

namespace stance {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// T_ab = (R_ab, p_ab): takes coordinates in frame b to coordinates in frame a.
struct RigidTransform {
  Matrix3 R = Matrix3::Identity();
  Vector3 p = Vector3::Zero();  ///< m, origin of b in a

  RigidTransform operator*(const RigidTransform& other) const noexcept { return {R * other.R, R * other.p + p}; }
  Vector3 operator*(const Vector3& point) const noexcept { return R * point + p; }
  RigidTransform inverse() const noexcept { return {R.transpose(), -(R.transpose() * p)}; }
};

namespace math {

/// Ad_T = [R 0; [p]x R, R]: takes a twist in b to the same twist in a (MR def. 3.20).
Matrix6 adjoint(const RigidTransform& T) noexcept;

/// Ad_T V, without forming the matrix.
inline Vector6 adjoint_times(const RigidTransform& T, const Vector6& V) noexcept {
  Vector6 out;
  const Vector3 omega = T.R * V.head<3>();
  out << omega, T.R * V.tail<3>() + T.p.cross(omega);
  return out;
}

/// Ad_(T^-1) V.
inline Vector6 adjoint_inverse_times(const RigidTransform& T, const Vector6& V) noexcept {
  Vector6 out;
  const Vector3 omega = V.head<3>();
  out << T.R.transpose() * omega, T.R.transpose() * (V.tail<3>() - T.p.cross(omega));
  return out;
}

/// Ad_T^T F: takes a wrench in a to the same wrench in b (MR eq. 3.98).
inline Vector6 adjoint_transpose_times(const RigidTransform& T, const Vector6& F) noexcept {
  Vector6 out;
  const Vector3 moment = F.head<3>() - T.p.cross(F.tail<3>());
  out << T.R.transpose() * moment, T.R.transpose() * F.tail<3>();
  return out;
}

/// ad_V = [[omega]x 0; [v]x [omega]x] (MR def. 8.1).
Matrix6 lie_bracket(const Vector6& V) noexcept;

/// ad_V(W), without forming the matrix.
inline Vector6 lie_bracket_times(const Vector6& V, const Vector6& W) noexcept {
  const Vector3 omega = V.head<3>(), v = V.tail<3>();
  const Vector3 omega_w = W.head<3>(), v_w = W.tail<3>();
  Vector6 out;
  out << omega.cross(omega_w), v.cross(omega_w) + omega.cross(v_w);
  return out;
}

/// ad_V^T F, without forming the matrix.
inline Vector6 lie_bracket_transpose_times(const Vector6& V, const Vector6& F) noexcept {
  const Vector3 omega = V.head<3>(), v = V.tail<3>();
  const Vector3 moment = F.head<3>(), force = F.tail<3>();
  Vector6 out;
  out << moment.cross(omega) + force.cross(v), force.cross(omega);
  return out;
}

/// exp([V]): the transform reached by following the twist V for unit time (MR prop. 3.25). Any |omega|, also 0; a screw
/// S that turns by theta is exp_se3(S theta), whether S is of unit norm or not.
RigidTransform exp_se3(const Vector6& V) noexcept;

/// The V with exp_se3(V) = T and |omega| <= pi.
Vector6 log_se3(const RigidTransform& T) noexcept;

}  // namespace math
}  // namespace stance
