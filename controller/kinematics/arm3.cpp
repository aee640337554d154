#include "controller/kinematics/arm3.hpp"

#include <cmath>

#include "controller/rigid_body/chain.hpp"

namespace stance::kinematics {

RigidTransform arm3_forward(const Arm3Geometry& arm, const Vector3& theta) noexcept {
  const double s1 = std::sin(theta(0)), c1 = std::cos(theta(0));
  const double s23 = std::sin(theta(1) + theta(2)), c23 = std::cos(theta(1) + theta(2));
  const double m = arm.l2 * std::sin(theta(1)) + arm.l3 * s23, n = arm.l2 * std::cos(theta(1)) + arm.l3 * c23;
  RigidTransform T;
  T.R << s1 * s23, s1 * c23, c1,  //
      -c1 * s23, -c1 * c23, s1,   //
      c23, -s23, 0.0;
  T.p << s1 * m, -c1 * m, arm.l1 + n;
  return T;
}

Arm3Jacobian arm3_jacobian(const Arm3Geometry& arm, const Vector3& theta) noexcept {
  const double s1 = std::sin(theta(0)), c1 = std::cos(theta(0));
  const double s23 = std::sin(theta(1) + theta(2)), c23 = std::cos(theta(1) + theta(2));
  const double m = arm.l2 * std::sin(theta(1)) + arm.l3 * s23, n = arm.l2 * std::cos(theta(1)) + arm.l3 * c23;
  Arm3Jacobian J;
  J << c1 * m, s1 * n, s1 * arm.l3 * c23,   //
      s1 * m, -c1 * n, -c1 * arm.l3 * c23,  //
      0.0, -m, -arm.l3 * s23,               //
      0.0, c1, c1,                          //
      0.0, s1, s1,                          //
      1.0, 0.0, 0.0;
  return J;
}

Vector3 arm3_inverse_velocity(const Arm3Jacobian& J, const Vector6& xi) noexcept {
  return rigid_body::inverse_velocity(J, xi);
}

RigidTransform updated_map(const RigidTransform& A, const Vector6& xi, double dt) noexcept {
  return {math::exp_so3(xi.tail<3>() * dt) * A.R, A.p + xi.head<3>() * dt};
}

Vector3 arm3_given_rates(double t) noexcept {
  if (t <= 1.0 || t > 16.0) return Vector3::Zero();
  if (t <= 5.0) return {0.1 * t, 0.1, 0.1 * t};
  const double outer = t <= 6.0 ? 0.3 : 0.3 - 0.1 * (t - 5.0);
  return {outer, 0.1 - 0.01 * (t - 5.0), outer};
}

Vector3 arm3_smooth_rates(const Vector3& peak, double duration, double t) noexcept {
  if (t < 0.0 || t > duration) return Vector3::Zero();
  const double s = std::sin(2.0 * M_PI * t / duration);
  return peak * (s * s * s);
}

void Arm3Integrator::start(const Vector3& theta) noexcept {
  theta_ = theta;
  map_ = arm3_forward(arm_, theta);
}

void Arm3Integrator::step(const Vector3& given_rate, double dt, Arm3Motion& out) noexcept {
  const Arm3Jacobian J = arm3_jacobian(arm_, theta_);
  const Vector6 xi = J * given_rate;
  out.theta = theta_;
  out.given_rate = given_rate;
  out.calculated_rate = arm3_inverse_velocity(J, xi);
  out.v = xi.head<3>();
  out.omega = xi.tail<3>();
  out.dp = out.v * dt;
  out.dphi = out.omega * dt;
  map_ = updated_map(map_, xi, dt);
  out.map.topLeftCorner<3, 3>() = map_.R;
  out.map.topRightCorner<3, 1>() = map_.p;
  out.jacobian = J;
  theta_ += out.calculated_rate * dt;
}

}  // namespace stance::kinematics
