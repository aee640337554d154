#include "controller/rigid_body/screw_tree.hpp"

#include <stdexcept>
#include <string>

namespace stance::rigid_body {

ScrewTree screw_tree(const Model& model) noexcept {
  ScrewTree tree;
  tree.num_joints = model.num_joints;
  for (int b = 0; b < model.num_bodies(); ++b) tree.G[b] = {model.bodies[b].inertia, model.bodies[b].mass};
  for (int i = 0; i < model.num_joints; ++i) {
    const Joint& joint = model.joints[i];
    const Vector3& com = model.bodies[i + 1].com;
    const Matrix3 R_JP = joint.R_PJ.transpose();
    tree.parent[i] = joint.parent;
    tree.M[i] = {R_JP, R_JP * (model.bodies[joint.parent].com - joint.p_PJ) - com};
    // The axis passes through the link frame's origin, at -com in the frame of the centre of mass.
    tree.A[i] << joint.axis, joint.axis.cross(com);
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
  tree.num_joints = static_cast<int>(S.size());
  RigidTransform T_0i;
  for (int i = 0; i < tree.num_joints; ++i) {
    T_0i = T_0i * M[i];
    tree.parent[i] = i;
    tree.M[i] = M[i].inverse();
    tree.A[i] = math::adjoint_times(T_0i.inverse(), S[i]);
    tree.G[i + 1] = G[i];
  }
  return tree;
}

Tip tip_on_link(const Model& model, int body, const RigidTransform& T_link) noexcept {
  return {body, {T_link.R, T_link.p - model.bodies[body].com}};
}

}  // namespace stance::rigid_body
