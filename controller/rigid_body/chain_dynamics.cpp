#include "controller/rigid_body/chain_dynamics.hpp"

#include <Eigen/Cholesky>
#include <array>

#include "controller/rigid_body/chain.hpp"
#include "controller/rigid_body/composite_inertia.hpp"

namespace stance::rigid_body {
namespace {

/// For every link, base excepted.
using LinkJacobians = std::array<JointJacobian, kMaxJoints>;

/// X of joint i's parent carried over to joint i's link by Ad_T, column by column.
void carry_over(const ScrewTree& tree, int i, const RigidTransform& T, LinkJacobians& X) noexcept {
  X[i].setZero(6, tree.num_joints);
  if (tree.parent[i] == 0) return;
  const JointJacobian& parent = X[tree.parent[i] - 1];
  // A parent's columns end with its own joint, which stands before joint i.
  for (int j = 0; j < i; ++j) X[i].col(j) = math::adjoint_times(T, parent.col(j));
}

BodySixVectors at_tip(const Load& load) noexcept {
  BodySixVectors F_out;
  F_out.fill(Vector6::Zero());
  F_out[load.tip.body] = math::adjoint_transpose_times(load.tip.T_body.inverse(), load.F_tip);
  return F_out;
}

}  // namespace

JointVector inverse_dynamics(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                             const JointVector& thetadd, const Load& load) noexcept {
  Vector6 Vd_0, F_0;
  Vd_0 << Vector3::Zero(), -load.gravity;
  JointVector tau;
  newton_euler(tree, theta, thetad, thetadd, Vector6::Zero(), Vd_0, at_tip(load), F_0, tau);
  return tau;
}

/// M_ji = S_j . (I_i S_i), with joint i's screw S_i and the inertia I_i of all that it moves in the base's frame: there
/// screws, momenta and inertias of different links meet without being carried from one to the next.
void joint_mass_matrix(const ScrewTree& tree, const JointVector& theta, JointMatrix& M) noexcept {
  std::array<RigidTransform, kMaxBodies> pose;  // of the links in the base's frame
  std::array<Vector6, kMaxJoints> S;
  std::array<CompositeInertia, kMaxBodies> composite;
  for (int i = 0; i < tree.num_joints; ++i) {
    const RigidTransform T_ip = tree.motion[i](theta(i));
    const RigidTransform& parent = pose[tree.parent[i]];
    RigidTransform& link = pose[i + 1];
    link.R.noalias() = parent.R * T_ip.R.transpose();
    link.p = parent.p - link.R * T_ip.p;
    S[i] = math::adjoint_times(link, tree.A[i]);
  }
  // Joints on different branches do not feel each other.
  M.setZero(tree.num_joints, tree.num_joints);
  for (int i = tree.num_joints - 1; i >= 0; --i) {
    CompositeInertia& carried = composite[i + 1];
    carried.add_body(tree.G[i + 1].mass, tree.G[i + 1].inertia, pose[i + 1].R, pose[i + 1].p);
    const Vector6 momentum = carried.momentum(S[i].head<3>(), S[i].tail<3>());
    for (int j = i; j >= 0; j = tree.parent[j] - 1) M(i, j) = M(j, i) = S[j].dot(momentum);
    if (tree.parent[i] > 0) composite[tree.parent[i]] += carried;
  }
}

void coriolis_matrix(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                     JointMatrix& C) noexcept {
  LinkJacobians J, Jd;
  C.setZero(tree.num_joints, tree.num_joints);
  for (int i = 0; i < tree.num_joints; ++i) {
    const RigidTransform T = tree.motion[i](theta(i));
    carry_over(tree, i, T, J);
    carry_over(tree, i, T, Jd);
    // d/dt Ad_T = -thetad ad_A Ad_T
    for (int j = 0; j < i; ++j) Jd[i].col(j) -= math::lie_bracket_times(tree.A[i], J[i].col(j)) * thetad(i);
    J[i].col(i) = tree.A[i];
    const SpatialInertia& G = tree.G[i + 1];
    const Vector6 momentum = G * (J[i] * thetad.head(tree.num_joints));
    for (int c = 0; c <= i; ++c) {
      const Vector6 F = G * Jd[i].col(c) - math::lie_bracket_transpose_times(J[i].col(c), momentum);
      for (int r = 0; r <= i; ++r) C(r, c) += J[i].col(r).dot(F);
    }
  }
}

JointVector joint_gravity(const ScrewTree& tree, const JointVector& theta, const Vector3& gravity) noexcept {
  const JointVector still = JointVector::Zero();
  Load load;
  load.gravity = gravity;
  return inverse_dynamics(tree, theta, still, still, load);
}

bool forward_dynamics(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                      const JointVector& tau, const Load& load, JointVector& thetadd) noexcept {
  thetadd.setZero();
  JointMatrix M;
  joint_mass_matrix(tree, theta, M);
  const Eigen::LLT<JointMatrix> cholesky(M);
  if (cholesky.info() != Eigen::Success) return false;
  const JointVector bias = inverse_dynamics(tree, theta, thetad, thetadd, load);
  thetadd.head(tree.num_joints) = cholesky.solve((tau - bias).head(tree.num_joints));
  return true;
}

}  // namespace stance::rigid_body
