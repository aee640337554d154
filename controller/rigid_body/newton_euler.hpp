#pragma once
// The recursive Newton-Euler algorithm over screws, for a tree whose base moves as it likes. An open chain is the tree
// in which joint i's parent is body i; a fixed base has V_0 = 0.
//
// Body 0 is the base and body i + 1 hangs on joint i. With i a joint's child link and p its parent:
//   forward   T_(i,p) = exp(-[A_i] theta_i) M_(i,p)                                    (8.50)
//             V_i  = Ad_T(V_p) + A_i thetad_i                                         (8.51)
//             Vd_i = Ad_T(Vd_p) + ad_(V_i)(A_i) thetad_i + A_i thetadd_i              (8.52)
//   backward  F_i  = sum over children c of Ad_(T_(c,i))^T F_c + F_out_i + G_i Vd_i - ad_(V_i)^T (G_i V_i)      (8.53)
//             tau_i = F_i^T A_i                                                       (8.54)
// Everything stands in link frames; in those of the centres of mass G_i = diag(I_i, m_i 1). Gravity g enters as Vd_0 =
// (0, -g) on top of the base's own acceleration. Reference: Lynch and Park, Modern Robotics (2017), section 8.3.
#include <array>

#include "controller/math/se3.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::rigid_body {

/// G = diag(inertia, mass 1), in a frame at the centre of mass.
struct SpatialInertia {
  Matrix3 inertia = Matrix3::Zero();  ///< kg m^2
  double mass = 0.0;                  ///< kg

  Vector6 operator*(const Vector6& V) const noexcept;
};

struct ScrewTree {
  int num_joints = 0;
  std::array<int, kMaxJoints> parent{};      ///< body index of joint i's parent, at most i
  std::array<RigidTransform, kMaxJoints> M;  ///< M_(i,p): coordinates in the parent to those in the link, at theta = 0
  std::array<Vector6, kMaxJoints> A;         ///< joint i's screw in its child link's frame; of any norm
  std::array<SpatialInertia, kMaxBodies> G;  ///< of the bodies, base first
};

/// The model's tree with link frames at the centres of mass, axes of the model's link frames.
ScrewTree screw_tree(const Model& model) noexcept;

/// Twists, accelerations, wrenches: one for each body, base first, each in its body's frame.
using BodySixVectors = std::array<Vector6, kMaxBodies>;

/// The joint torques, and the wrench F_0 on the base, of the motion (theta, thetad, thetadd; V_0, Vd_0), where every
/// body i applies the wrench F_out[i] to its surroundings.
void newton_euler(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                  const JointVector& thetadd, const Vector6& V_0, const Vector6& Vd_0, const BodySixVectors& F_out,
                  Vector6& F_0, JointVector& tau) noexcept;

}  // namespace stance::rigid_body
