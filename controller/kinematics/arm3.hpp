#pragma once
// The 3-joint arm of document 004: velocity kinematics both ways, and its kinematic map kept up to date by velocities.
//
//   A_1 = trans(0, 0, l1) [-s1 0 c1; c1 0 s1; 0 1 0]   A_2 = Rz(t2 + 90 deg) trans(l2, 0, 0)   A_3 = Rz(t3) trans(l3,
//   0, 0) T_A3 = A_1 A_2 A_3,   its origin o_3 = (s1 m, -c1 m, l1 + l2 c2 + l3 c23),   m = l2 s2 + l3 s23,  n = l2 c2 +
//   l3 c23 xi = (v, omega) = J thetad,   J = [ c1 m,  s1 n,  s1 l3 c23
//                                       s1 m, -c1 n, -c1 l3 c23
//                                       0,    -m,    -l3 s23
//                                       0,     c1,    c1
//                                       0,     s1,    s1
//                                       1,     0,     0 ]
// all in the base's frame A. det(J^T J) = (1 + m^2) l2^2 (1 + l3^2 s3^2) is never 0, so that the least-squares rates of
// any xi are unique. The document's misprints (s(t2 - t3) in J, its second column of omega without c1 and s1, omega_z =
// thetad_3) are put right here; arm3_literal.hpp has them as they were.
#include <Eigen/Core>

#include "controller/math/se3.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::kinematics {

struct Arm3Geometry {
  double l1 = 1.0, l2 = 0.5, l3 = 0.5;  ///< m; the document's
};

/// Linear rows first, as the document has it.
using Arm3Jacobian = Eigen::Matrix<double, 6, 3>;

/// Of a model whose three joints are these, in order, and whose `tool` link is the end effector's frame 3; the model's
/// base is A. Throws std::invalid_argument naming what is otherwise.
Arm3Geometry arm3_geometry(const rigid_body::Model& model, const rigid_body::LinkPose& tool);

/// T_A3, of t1..t3 (rad).
RigidTransform arm3_forward(const Arm3Geometry& arm, const Vector3& theta) noexcept;

/// J, so that xi = J thetad (m/s, rad/s).
Arm3Jacobian arm3_jacobian(const Arm3Geometry& arm, const Vector3& theta) noexcept;

/// thetad (rad/s) of least |J thetad - xi|, which is (J^T J)^-1 J^T xi, by QR.
Vector3 arm3_inverse_velocity(const Arm3Jacobian& J, const Vector6& xi) noexcept;

/// The map a time dt (s) later at the velocity xi = (v, omega): orientation by the exact exponential, R = exp([omega
/// dt]) R, position by p += v dt. The document's T R A turns the position about the base's origin, too, and its R is no
/// rotation.
RigidTransform updated_map(const RigidTransform& A, const Vector6& xi, double dt) noexcept;

/// The document's given rates (rad/s) at t (s): they jump at 1, 5 and 6 s, and are 0 after 16 s.
Vector3 arm3_given_rates(double t) noexcept;

/// Rates (rad/s) at t (s) that leave and come back without a jump up to their second derivative:
/// peak sin^3(2 pi t / duration) in 0..duration, 0 elsewhere.
Vector3 arm3_smooth_rates(const Vector3& peak, double duration, double t) noexcept;

/// The document's loop: rates to velocities, velocities to rates by least squares, angles by Euler's method from those,
/// and the map by the velocities alone.
class Arm3Integrator {
 public:
  explicit Arm3Integrator(const Arm3Geometry& arm) : arm_(arm) { start(Vector3::Zero()); }

  /// At the angles theta (rad), the map as they have it.
  void start(const Vector3& theta) noexcept;
  /// One step of dt (s) at the given rates (rad/s). Fills all of `out` but its number and its time.
  void step(const Vector3& given_rate, double dt, Arm3Motion& out) noexcept;

  const Vector3& theta() const noexcept { return theta_; }  ///< rad

 private:
  Arm3Geometry arm_;
  Vector3 theta_ = Vector3::Zero();
  RigidTransform map_;
};

}  // namespace stance::kinematics
