#pragma once
// The recursive Newton-Euler algorithm over screws, for a tree whose base moves as it likes. A fixed base has V_0 = 0.
//
// With i a joint's child link, p its parent, and T_(i,p), A_i, G_i as in screw_tree.hpp:
//   forward   V_i  = Ad_T(V_p) + A_i thetad_i                                         (8.51)
//             Vd_i = Ad_T(Vd_p) + ad_(V_i)(A_i) thetad_i + A_i thetadd_i              (8.52)
//   backward  F_i  = sum over children c of Ad_(T_(c,i))^T F_c + F_out_i + G_i Vd_i - ad_(V_i)^T (G_i V_i)      (8.53)
//             tau_i = F_i^T A_i                                                       (8.54)
// Everything stands in link frames. Gravity g enters as Vd_0 = (0, -g) on top of the base's own acceleration.
// Reference: Lynch and Park, Modern Robotics (2017), sections 8.2 and 8.3.
#include <array>

#include "controller/rigid_body/screw_tree.hpp"

namespace stance::rigid_body {

/// The wrench that moves a single body, in its frame at its centre of mass (8.22, 8.23):
///   moment = I omegad + omega x I omega,  force = m (vd + omega x v),  i.e. G Vd - ad_V^T (G V).
Vector6 single_body_wrench(const SpatialInertia& G, const Vector6& V, const Vector6& Vd) noexcept;

/// Twists, accelerations, wrenches: one for each body, base first, each in its body's frame.
using BodySixVectors = std::array<Vector6, kMaxBodies>;

/// The joint torques, and the wrench F_0 on the base, of the motion (theta, thetad, thetadd; V_0, Vd_0), where every
/// body i applies the wrench F_out[i] to its surroundings.
void newton_euler(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                  const JointVector& thetadd, const Vector6& V_0, const Vector6& Vd_0, const BodySixVectors& F_out,
                  Vector6& F_0, JointVector& tau) noexcept;

}  // namespace stance::rigid_body
