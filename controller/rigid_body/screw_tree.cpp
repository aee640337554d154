#include "controller/rigid_body/screw_tree.hpp"

#include <stdexcept>
#include <string>

namespace stance::rigid_body {

ScrewMotion::ScrewMotion(const RigidTransform& M, const Vector6& A) noexcept
    : w_(A.head<3>().norm()), R_0_(M.R), p_0_(M.p), p_t_(-A.tail<3>()) {
  if (!(w_ > 0.0)) return;
  const Matrix3 k = math::skew(A.head<3>() / w_);
  const Matrix3 k2 = k * k;
  const Vector3 v = A.tail<3>();
  R_s_ = -k * M.R;
  R_c_ = k2 * M.R;
  p_s_ = k2 * v / w_ - k * M.p;
  p_c_ = k * v / w_ + k2 * M.p;
  p_t_ -= k2 * v;
}

void ScrewTree::add_joint(int parent_body, const RigidTransform& M, const Vector6& screw,
                          const SpatialInertia& inertia) noexcept {
  const int i = num_joints++;
  parent[i] = parent_body;
  A[i] = screw;
  motion[i] = ScrewMotion(M, screw);
  G[i + 1] = inertia;
}

ScrewTree screw_tree(const Model& model) noexcept {
  ScrewTree tree;
  tree.G[0] = {model.bodies[0].inertia, model.bodies[0].mass};
  for (int i = 0; i < model.num_joints; ++i) {
    const Joint& joint = model.joints[i];
    const Body& body = model.bodies[i + 1];
    const Matrix3 R_JP = joint.R_PJ.transpose();
    // The axis passes through the link frame's origin, at -com in the frame of the centre of mass.
    Vector6 A;
    A << joint.axis, joint.axis.cross(body.com);
    tree.add_joint(joint.parent, {R_JP, R_JP * (model.bodies[joint.parent].com - joint.p_PJ) - body.com}, A,
                   {body.inertia, body.mass});
  }
  return tree;
}

ScrewTree screw_chain(std::span<const RigidTransform> M, std::span<const SpatialInertia> G,
                      std::span<const Vector6> S) {
  if (M.size() != S.size() || G.size() != S.size() || S.empty() || S.size() > kMaxJoints) {
    throw std::invalid_argument("screw chain: " + std::to_string(M.size()) + " poses, " + std::to_string(G.size()) +
                                " inertias and " + std::to_string(S.size()) + " screws: give one of each for 1 to " +
                                std::to_string(kMaxJoints) + " joints");
  }
  ScrewTree tree;
  RigidTransform T_0i;
  for (int i = 0; i < static_cast<int>(S.size()); ++i) {
    T_0i = T_0i * M[i];
    tree.add_joint(i, M[i].inverse(), math::adjoint_times(T_0i.inverse(), S[i]), G[i]);
  }
  return tree;
}

Tip tip_on_link(const Model& model, int body, const RigidTransform& T_link) noexcept {
  return {body, {T_link.R, T_link.p - model.bodies[body].com}};
}

}  // namespace stance::rigid_body
