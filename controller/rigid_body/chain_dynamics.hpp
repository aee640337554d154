#pragma once
// Dynamics of a tree of screws whose base stands still:
//   M(theta) thetadd + C(theta, thetad) thetad + g(theta) + J_b^T F_tip = tau.
// Nothing here allocates or throws.
//
// With J_i the body Jacobian of link i's frame, from J_i = Ad_(T_(i,p)) J_p and A_i in joint i's column:
//   M = sum_i J_i^T G_i J_i                                                                               (8.57)
//   C = sum_i J_i^T (G_i Jd_i + [G_i V_i] J_i),   [(m, f)] = -[[m]x [f]x; [f]x 0],   [G V] V = -ad_V^T G V
// M comes by composite bodies: M_ji = A_j^T F_i, F_i the momentum, taken to link j, of all that joint i carries when it
// alone turns. [G V] is skew, so that Md - 2 C is, too: the joints' inner forces do no work.
//
// References: Lynch and Park, Modern Robotics (2017), sections 8.3 to 8.5; Featherstone, Rigid Body Dynamics Algorithms
// (2008), section 6.2, for M; for C, Echeandia and Wensing, Numerical methods to compute the Coriolis matrix and
// Christoffel symbols for rigid-body systems, J. Comput. Nonlinear Dyn. 16 (2021).
#include <Eigen/Core>

#include "controller/rigid_body/newton_euler.hpp"

namespace stance::rigid_body {

/// Shape n x n.
using JointMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;

/// What acts besides the drives.
struct Load {
  Vector3 gravity{0.0, 0.0, -kGravity};  ///< m/s^2, in the base's frame of the tree
  Tip tip{};
  Vector6 F_tip = Vector6::Zero();  ///< N m, N: the wrench that the tip applies to its surroundings, in the tip's frame
};

/// tau (N m, N for a joint that slides) of the motion; entries past the tree's joints are zero.
JointVector inverse_dynamics(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                             const JointVector& thetadd, const Load& load) noexcept;

/// M, symmetric to the bit.
void joint_mass_matrix(const ScrewTree& tree, const JointVector& theta, JointMatrix& M) noexcept;

/// C, of which C thetad are the Coriolis and centripetal torques.
void coriolis_matrix(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                     JointMatrix& C) noexcept;

/// g: the torques that hold the links against gravity (m/s^2, in the base's frame of the tree).
JointVector joint_gravity(const ScrewTree& tree, const JointVector& theta, const Vector3& gravity) noexcept;

/// thetadd that tau gives. False, and thetadd zero, where M is not positive definite: a joint moves no mass.
[[nodiscard]] bool forward_dynamics(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                                    const JointVector& tau, const Load& load, JointVector& thetadd) noexcept;

}  // namespace stance::rigid_body
