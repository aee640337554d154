#include "sim/single_body.hpp"

#include <Eigen/LU>

namespace stance::sim {
namespace {

/// The whole robot as one body: B's frame stays where it is, the centre of mass and the inertia are the composite ones.
WorldSetup as_one_body(const WorldSetup& setup) {
  rigid_body::State pose;  // B at W's origin
  pose.q = setup.initial.q;
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(setup.model, pose, kinematics);
  rigid_body::Centroidal whole;
  rigid_body::centroidal(setup.model, kinematics, whole);

  WorldSetup one;
  one.model.name = setup.model.name;
  one.model.total_mass = whole.mass;
  one.model.bodies[0] = {setup.model.name, whole.mass, whole.p_WC, whole.inertia_W};
  one.floating = true;
  one.initial = setup.initial;
  one.initial.q.setZero();
  one.initial.qd.setZero();
  return one;
}

}  // namespace

SingleBody::SingleBody(const WorldSetup& setup)
    : legs_(kinematics::leg_geometries(setup.model, setup.feet)),
      p_WF_(foot_tips(setup.model, setup.feet, setup.initial)),
      body_(as_one_body(setup)) {
  for (std::size_t leg = 0; leg < legs_.size(); ++leg) {
    last_link_pitch_[leg] = setup.initial.q.segment<3>(static_cast<Eigen::Index>(4 * leg + 1)).sum();
  }
  foot_force_W_.fill(Vector3::Zero());
  follow();
}

void SingleBody::step(const AppliedForces& forces, const Wrench& push) {
  Wrench total = push;
  for (std::size_t i = 0; i < legs_.size(); ++i) {
    total.force += forces.force_W[i];
    total.moment += (forces.p_WF[i] - body_.state().p_WB).cross(forces.force_W[i]);
    foot_force_W_[i] = forces.force_W[i];
  }
  body_.step(JointVector::Zero(), total);
  follow();
}

void SingleBody::follow() noexcept {
  const rigid_body::State& base = body_.state();
  state_.p_WB = base.p_WB;
  state_.R_WB = base.R_WB;
  state_.v_WB = base.v_WB;
  state_.w_WB_W = base.w_WB_W;
  const Matrix3 R_LB = kinematics::leg_rotation().transpose();
  for (std::size_t leg = 0; leg < legs_.size(); ++leg) {
    const Vector3 p_BF = base.R_WB.transpose() * (p_WF_[leg] - base.p_WB);
    kinematics::LegVector q;
    // Out of reach, the joints are the nearest: the robot has fallen by then.
    static_cast<void>(kinematics::leg_ik(legs_[leg], R_LB * (p_BF - legs_[leg].p_BL), last_link_pitch_[leg], q));

    // The foot's velocity in W is zero, and the last link keeps its angle in the leg.
    Vector3 p_BF_reached;
    Eigen::Matrix<double, 3, 4> J_BF;
    kinematics::foot_in_base(legs_[leg], q, p_BF_reached, J_BF);
    Eigen::Matrix4d constraints;
    constraints << J_BF, 0.0, 1.0, 1.0, 1.0;
    Eigen::Vector4d rates;
    rates << -base.R_WB.transpose() * (base.v_WB + base.w_WB_W.cross(base.R_WB * p_BF)), 0.0;
    const auto first = static_cast<Eigen::Index>(4 * leg);
    state_.q.segment<4>(first) = q;
    state_.qd.segment<4>(first) = constraints.fullPivLu().solve(rates);
  }
}

}  // namespace stance::sim
