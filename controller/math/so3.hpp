#pragma once
// Rotations: the skew matrix, exponential and logarithm, roll-pitch-yaw.
#include <Eigen/Core>
#include <Eigen/Geometry>

namespace stance {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;

inline constexpr double kGravity = 9.81;  ///< m/s^2, magnitude, along -z of W

namespace math {

/// [v]x, so that skew(a) b = a x b.
Matrix3 skew(const Vector3& v) noexcept;

/// exp([v]x): the rotation by |v| rad about v (Rodrigues). Exact to machine precision for every |v|, also the smallest.
Matrix3 exp_so3(const Vector3& v) noexcept;

/// The v with exp_so3(v) = R and |v| <= pi.
Vector3 log_so3(const Matrix3& R) noexcept;

/// The derivative of the logarithm, and what takes exp_se3's translation to its twist's: log_so3(exp_so3(dv)
/// exp_so3(v)) = v + J_l^-1(v) dv to first order, J_l^-1 = 1 - [v]x / 2 + d [v]x^2, d = (1 - h cot h) / |v|^2, h = |v|
/// / 2, for |v| < 2 pi.
Matrix3 left_jacobian_inverse_so3(const Vector3& v) noexcept;

/// Rz(yaw) Ry(pitch) Rx(roll) of (roll, pitch, yaw) rad.
Matrix3 rotation_from_rpy(const Vector3& rpy) noexcept;

/// (roll, pitch, yaw) of R, pitch in [-pi/2, pi/2]; the inverse of rotation_from_rpy away from pitch = +-pi/2.
Vector3 rpy_from_rotation(const Matrix3& R) noexcept;

/// Rz(angle), rotation about z.
Matrix3 rotation_z(double angle) noexcept;

/// angle + 2 pi k, the one nearest to `near`.
double unwrap(double angle, double near) noexcept;

}  // namespace math
}  // namespace stance
