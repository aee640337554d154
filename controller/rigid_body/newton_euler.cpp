#include "controller/rigid_body/newton_euler.hpp"

namespace stance::rigid_body {

Vector6 single_body_wrench(const SpatialInertia& G, const Vector6& V, const Vector6& Vd) noexcept {
  return G * Vd - math::lie_bracket_transpose_times(V, G * V);
}

void newton_euler(const ScrewTree& tree, const JointVector& theta, const JointVector& thetad,
                  const JointVector& thetadd, const Vector6& V_0, const Vector6& Vd_0, const BodySixVectors& F_out,
                  Vector6& F_0, JointVector& tau) noexcept {
  std::array<RigidTransform, kMaxJoints> T;
  BodySixVectors V, Vd, F;
  V[0] = V_0;
  Vd[0] = Vd_0;
  for (int i = 0; i < tree.num_joints; ++i) {
    const int parent = tree.parent[i], body = i + 1;
    const Vector6& A = tree.A[i];
    T[i] = tree.motion[i](theta(i));                                                                    // 8.50
    V[body] = math::adjoint_times(T[i], V[parent]) + A * thetad(i);                                     // 8.51
    Vd[body] = math::adjoint_times(T[i], Vd[parent]) + math::lie_bracket_times(V[body], A) * thetad(i)  // 8.52
               + A * thetadd(i);
  }
  for (int b = 0; b <= tree.num_joints; ++b) {
    F[b] = F_out[b] + single_body_wrench(tree.G[b], V[b], Vd[b]);
  }
  tau.setZero();
  // A child stands after its parent, so that F of a body is complete when its turn comes.
  for (int i = tree.num_joints - 1; i >= 0; --i) {
    const int body = i + 1;
    F[tree.parent[i]] += math::adjoint_transpose_times(T[i], F[body]);  // 8.53
    tau(i) = F[body].dot(tree.A[i]);                                    // 8.54
  }
  F_0 = F[0];
}

}  // namespace stance::rigid_body
