#include "controller/kinematics/arm3_literal.hpp"

#include <cmath>

namespace stance::kinematics::literal {
namespace {

/// The third row's entry of t2, misprinted.
double third_row(const Arm3Geometry& arm, const Vector3& theta) noexcept {
  return -arm.l3 * std::sin(theta(1) - theta(2)) - arm.l2 * std::sin(theta(1));
}

}  // namespace

Vector3 arm3_rates(double t) noexcept {
  return t <= 1.0 ? Vector3(0.1 * t, 0.01 * t, 0.1 * t) : Vector3(0.3, 0.01, 0.3);
}

Vector6 arm3_velocity(const Arm3Geometry& arm, const Vector3& theta, const Vector3& thetad) noexcept {
  Arm3Jacobian J = kinematics::arm3_jacobian(arm, theta);
  J(2, 1) = third_row(arm, theta);
  Vector6 xi = J * thetad;
  xi(5) = thetad(2);
  return xi;
}

Arm3Jacobian arm3_jacobian(const Arm3Geometry& arm, const Vector3& theta) noexcept {
  Arm3Jacobian J = kinematics::arm3_jacobian(arm, theta);
  J(2, 1) = third_row(arm, theta);
  J.row(3) << 0.0, std::cos(theta(0)), std::cos(theta(1));
  J.row(4) << 0.0, std::sin(theta(1)), std::sin(theta(0));
  return J;
}

Eigen::Matrix4d updated_map(const Eigen::Matrix4d& A, const Vector6& xi, double dt) noexcept {
  const Vector3 dp = xi.head<3>() * dt, dphi = xi.tail<3>() * dt;
  Eigen::Matrix4d TR = Eigen::Matrix4d::Identity();
  TR.topLeftCorner<3, 3>() += math::skew(dphi);
  TR(2, 1) = dphi.z();
  TR.topRightCorner<3, 1>() = dp;
  return TR * A;
}

}  // namespace stance::kinematics::literal
