#include "controller/rigid_body/dynamics.hpp"

#include <Eigen/QR>

#include "controller/rigid_body/composite_inertia.hpp"
#include "controller/rigid_body/newton_euler.hpp"

namespace stance::rigid_body {
namespace {

/// Of each body together with all that hangs on it, about B's origin, axes of W.
std::array<CompositeInertia, kMaxBodies> composite_inertias(const Model& model, const Kinematics& kinematics) noexcept {
  std::array<CompositeInertia, kMaxBodies> composite;
  for (int b = model.num_bodies() - 1; b >= 0; --b) {
    const Body& body = model.bodies[b];
    CompositeInertia& own = composite[b];
    own.add_body(body.mass, body.inertia, kinematics.R_W[b], kinematics.com_W[b] - kinematics.p_W[0]);
    if (b == 0) break;
    composite[model.joints[b - 1].parent] += own;
  }
  return composite;
}

/// Momentum (about B's origin, in W) of the whole tree over nu: the base's rows of the mass matrix. Shape 6 x (6 + n).
void momentum_matrix(const Model& model, const Kinematics& kinematics,
                     const std::array<CompositeInertia, kMaxBodies>& composite, Matrix6Nu& H) noexcept {
  H.resize(6, 6 + model.num_joints);
  const CompositeInertia& whole = composite[0];
  const Matrix3 moment = math::skew(whole.moment);
  H.topLeftCorner<3, 3>() = whole.inertia;
  H.block<3, 3>(0, 3) = moment;
  H.block<3, 3>(3, 0) = -moment;
  H.block<3, 3>(3, 3) = whole.mass * Matrix3::Identity();
  for (int i = 0; i < model.num_joints; ++i) {
    const CompositeInertia& carried = composite[i + 1];
    const Vector3& axis = kinematics.axis_W[i];
    // Velocity, at B's origin, of a body that turns about the joint.
    const Vector3 v = (kinematics.p_W[i + 1] - kinematics.p_W[0]).cross(axis);
    H.col(6 + i) = carried.momentum(axis, v);
  }
}

}  // namespace

void forward_kinematics(const Model& model, const State& state, Kinematics& kinematics) noexcept {
  const auto place_com = [&](int b) {
    const Vector3 r = kinematics.R_W[b] * model.bodies[b].com;
    kinematics.com_W[b] = kinematics.p_W[b] + r;
    return r;
  };
  std::array<Vector3, kMaxBodies> v_W;  // of the link frames' origins
  kinematics.R_W[0] = state.R_WB;
  kinematics.p_W[0] = state.p_WB;
  kinematics.w_W[0] = state.w_WB_W;
  v_W[0] = state.v_WB;
  kinematics.v_com_W[0] = v_W[0] + kinematics.w_W[0].cross(place_com(0));
  for (int i = 0; i < model.num_joints; ++i) {
    const Joint& joint = model.joints[i];
    const int parent = joint.parent, body = i + 1;
    const Vector3 r = kinematics.R_W[parent] * joint.p_PJ;
    const Matrix3 R_WJ = kinematics.R_W[parent] * joint.R_PJ;
    kinematics.axis_W[i] = R_WJ * joint.axis;
    kinematics.R_W[body] = R_WJ * math::exp_so3(joint.axis * state.q(i));
    kinematics.p_W[body] = kinematics.p_W[parent] + r;
    kinematics.w_W[body] = kinematics.w_W[parent] + kinematics.axis_W[i] * state.qd(i);
    v_W[body] = v_W[parent] + kinematics.w_W[parent].cross(r);
    kinematics.v_com_W[body] = v_W[body] + kinematics.w_W[body].cross(place_com(body));
  }
}

void geometric_jacobian(const Model& model, const State& state, const Kinematics& kinematics, int body,
                        const Vector3& p_W, Jacobian& J) noexcept {
  J.setZero(6, 6 + model.num_joints);
  J.topLeftCorner<3, 3>().setIdentity();
  J.block<3, 3>(3, 0) = -math::skew(p_W - state.p_WB);
  J.block<3, 3>(3, 3).setIdentity();
  for (int b = body; b > 0; b = model.joints[b - 1].parent) {
    const Vector3& axis = kinematics.axis_W[b - 1];
    J.col(6 + b - 1) << axis, axis.cross(p_W - kinematics.p_W[b]);
  }
}

void inverse_dynamics(const Model& model, const State& state, const VectorNu& nud, VectorNu& tau) noexcept {
  const Matrix3& R_WB = state.R_WB;
  const Vector3 r = R_WB * model.bodies[0].com;
  const Vector3 wd = nud.head<3>();
  const Vector3 a_com = nud.segment<3>(3) + wd.cross(r) + state.w_WB_W.cross(state.w_WB_W.cross(r));
  const Vector3 v_com = state.v_WB + state.w_WB_W.cross(r);
  const Vector3 minus_g(0.0, 0.0, kGravity);
  // Twist of the base in its own frame at its centre of mass, and the twist's rate there, which is not the
  // acceleration.
  Vector6 V_0, Vd_0;
  V_0 << R_WB.transpose() * state.w_WB_W, R_WB.transpose() * v_com;
  Vd_0 << R_WB.transpose() * wd, R_WB.transpose() * (a_com - state.w_WB_W.cross(v_com) + minus_g);
  JointVector qdd = JointVector::Zero();
  qdd.head(model.num_joints) = nud.tail(model.num_joints);
  BodySixVectors F_out;
  F_out.fill(Vector6::Zero());

  Vector6 F_0;
  JointVector joint_tau;
  newton_euler(screw_tree(model), state.q, state.qd, qdd, V_0, Vd_0, F_out, F_0, joint_tau);
  const Vector3 force = R_WB * F_0.tail<3>();
  tau.resize(6 + model.num_joints);
  tau.head<3>() = R_WB * F_0.head<3>() + r.cross(force);
  tau.segment<3>(3) = force;
  tau.tail(model.num_joints) = joint_tau.head(model.num_joints);
}

void mass_matrix(const Model& model, const State& state, MatrixNu& M) noexcept {
  Kinematics kinematics;
  forward_kinematics(model, state, kinematics);
  Matrix6Nu H;
  momentum_matrix(model, kinematics, composite_inertias(model, kinematics), H);
  const int n = model.num_joints;
  // Joints on different branches do not feel each other.
  M.setZero(6 + n, 6 + n);
  M.topRows<6>() = H;
  for (int j = 0; j < n; ++j) {
    for (int b = j + 1; b > 0; b = model.joints[b - 1].parent) {
      const int i = b - 1;
      const Vector3& axis = kinematics.axis_W[i];
      const Vector3 v = (kinematics.p_W[b] - kinematics.p_W[0]).cross(axis);
      M(6 + i, 6 + j) = axis.dot(H.col(6 + j).head<3>()) + v.dot(H.col(6 + j).tail<3>());
    }
  }
  M.triangularView<Eigen::StrictlyLower>() = M.transpose();
}

void gravity_torques(const Model& model, const State& state, VectorNu& tau) noexcept {
  State still = state;
  still.w_WB_W.setZero();
  still.v_WB.setZero();
  still.qd.setZero();
  const VectorNu nud = VectorNu::Zero(6 + model.num_joints);
  inverse_dynamics(model, still, nud, tau);
}

void centroidal(const Model& model, const Kinematics& kinematics, Centroidal& out) noexcept {
  out = Centroidal{};
  for (int b = 0; b < model.num_bodies(); ++b) {
    const double mass = model.bodies[b].mass;
    out.mass += mass;
    out.p_WC += mass * kinematics.com_W[b];
    out.v_WC += mass * kinematics.v_com_W[b];
  }
  out.p_WC /= out.mass;
  out.v_WC /= out.mass;
  for (int b = 0; b < model.num_bodies(); ++b) {
    const Body& body = model.bodies[b];
    const Matrix3 inertia_W = kinematics.R_W[b] * body.inertia * kinematics.R_W[b].transpose();
    const Vector3 r = kinematics.com_W[b] - out.p_WC;
    out.L_C_W += inertia_W * kinematics.w_W[b] + body.mass * r.cross(kinematics.v_com_W[b] - out.v_WC);
    out.inertia_W += inertia_W + body.mass * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
  }
}

void centroidal_momentum_matrix(const Model& model, const Kinematics& kinematics, Matrix6Nu& A_G) noexcept {
  const std::array<CompositeInertia, kMaxBodies> composite = composite_inertias(model, kinematics);
  momentum_matrix(model, kinematics, composite, A_G);
  // From about B's origin to about C: L_C = L_B - p_BC x p.
  const Vector3 p_BC_W = composite[0].moment / composite[0].mass;
  for (int c = 0; c < A_G.cols(); ++c) {
    const Vector3 linear = A_G.col(c).tail<3>();
    A_G.col(c).head<3>() -= p_BC_W.cross(linear);
  }
}

Matrix3 effective_inertia(const Model& model, const State& state, const Kinematics& kinematics,
                          std::span<const Foot> held, const ConstraintRows& constraints) noexcept {
  constexpr int kMaxRows = 3 * kMaxContacts + 3 + kMaxConstraintRows;
  const int num_held = static_cast<int>(held.size());
  const int rows = 3 * num_held + 3 + static_cast<int>(constraints.rows());
  const int free = 3 + model.num_joints;
  Matrix6Nu A_G;
  centroidal_momentum_matrix(model, kinematics, A_G);

  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, 6 + kMaxJoints> C(rows, 6 + model.num_joints);
  C.topRows<3>() = A_G.bottomRows<3>();
  for (int k = 0; k < num_held; ++k) {
    const int body = held[k].body;
    Jacobian J;
    geometric_jacobian(model, state, kinematics, body, kinematics.p_W[body] + kinematics.R_W[body] * held[k].tip, J);
    C.middleRows<3>(3 + 3 * k) = J.bottomRows<3>();
  }
  C.bottomRows(constraints.rows()) = constraints;

  // C (w, x) = 0 for w = the three unit vectors and x = (v_WB, qd).
  using Free = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxRows, 3 + kMaxJoints>;
  using RightHandSide = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxRows, 3>;
  using Solution = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3 + kMaxJoints, 3>;
  const Free C_free = C.rightCols(free);
  const RightHandSide rhs = -C.leftCols<3>();
  const Solution x = C_free.completeOrthogonalDecomposition().solve(rhs);
  return A_G.topLeftCorner<3, 3>() + A_G.topRightCorner(3, free) * x;
}

}  // namespace stance::rigid_body
