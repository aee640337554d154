#include "controller/rigid_body/chain.hpp"

namespace stance::rigid_body {
namespace {

/// From the tip up to the base: `visit(joint, T)` is told the tip's pose T in the frame of each joint's child link.
/// Returns T_(0,tip).
template <typename Visit>
RigidTransform climb(const ScrewTree& tree, const Tip& tip, const JointVector& theta, const Visit& visit) noexcept {
  RigidTransform T = tip.T_body;
  for (int body = tip.body; body > 0; body = tree.parent[body - 1]) {
    const int joint = body - 1;
    visit(joint, T);
    const RigidTransform link = tree.motion[joint](theta(joint));
    T = {link.R.transpose() * T.R, link.R.transpose() * (T.p - link.p)};
  }
  return T;
}

}  // namespace

RigidTransform tip_pose(const ScrewTree& tree, const Tip& tip, const JointVector& theta) noexcept {
  return climb(tree, tip, theta, [](int, const RigidTransform&) {});
}

RigidTransform body_jacobian(const ScrewTree& tree, const Tip& tip, const JointVector& theta,
                             JointJacobian& J_b) noexcept {
  J_b.setZero(6, tree.num_joints);
  return climb(tree, tip, theta, [&](int joint, const RigidTransform& T) {
    J_b.col(joint) = math::adjoint_inverse_times(T, tree.A[joint]);
  });
}

RigidTransform space_jacobian(const ScrewTree& tree, const Tip& tip, const JointVector& theta,
                              JointJacobian& J_s) noexcept {
  const RigidTransform T = body_jacobian(tree, tip, theta, J_s);
  for (int i = 0; i < tree.num_joints; ++i) J_s.col(i) = math::adjoint_times(T, J_s.col(i));
  return T;
}

}  // namespace stance::rigid_body
