#include "sim/single_body.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace stance::sim {
namespace {

constexpr int kMaxIterations = 50;
constexpr double kTolerance = 1e-13;  // m, m/s

/// The whole robot as one body: frame at the centre of mass, axes of B.
WorldSetup as_one_body(const WorldSetup& setup) {
  rigid_body::State pose = setup.initial;
  pose.R_WB.setIdentity();
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(setup.model, pose, kinematics);
  rigid_body::Centroidal whole;
  rigid_body::centroidal(setup.model, kinematics, whole);
  const Vector3 p_BC = whole.p_WC - pose.p_WB;

  WorldSetup one;
  one.model.name = setup.model.name;
  one.model.total_mass = whole.mass;
  one.model.bodies[0] = {setup.model.name, whole.mass, Vector3::Zero(),
                         kinematics::standing_inertia(setup.model, setup.feet, setup.initial.q)};
  one.floating = true;
  one.initial.R_WB = setup.initial.R_WB;
  one.initial.p_WB = setup.initial.p_WB + setup.initial.R_WB * p_BC;
  one.initial.w_WB_W = setup.initial.w_WB_W;
  one.initial.v_WB = setup.initial.v_WB + setup.initial.w_WB_W.cross(setup.initial.R_WB * p_BC);
  return one;
}

}  // namespace

SingleBody::SingleBody(const WorldSetup& setup)
    : model_(setup.model),
      legs_(kinematics::leg_geometries(setup.model, setup.feet)),
      p_WF_(foot_tips(setup.model, setup.feet, setup.initial)),
      body_(as_one_body(setup)),
      state_(setup.initial) {
  const double pitch = math::rpy_from_rotation(setup.initial.R_WB).y();
  for (std::size_t leg = 0; leg < legs_.size(); ++leg) {
    last_link_pitch_[leg] = setup.initial.q.segment<3>(static_cast<Eigen::Index>(4 * leg + 1)).sum() + pitch;
  }
  for (std::size_t i = 0; i < legs_.size(); ++i) {
    radius_[i] = setup.feet[i].radius;
    ground_z_[i] = p_WF_[i].z();
  }
  foot_force_W_.fill(Vector3::Zero());
  follow();
}

void SingleBody::step(const ContactVectors& force_W, const Wrench& push) {
  const Vector3& p_WC = body_.state().p_WB;
  Wrench total = push;
  total.moment += (state_.p_WB - p_WC).cross(push.force);
  for (std::size_t i = 0; i < legs_.size(); ++i) {
    total.force += force_W[i];
    total.moment += (p_WF_[i] - Vector3(0.0, 0.0, radius_[i]) - p_WC).cross(force_W[i]);
    foot_force_W_[i] = force_W[i];
    p_WF_[i] += kPhysicsStep * v_WF_[i];
  }
  body_.step(JointVector::Zero(), total);
  follow();
}

void SingleBody::swing(std::size_t foot, const kinematics::LegVector& q) noexcept {
  Vector3 p_BF;
  Eigen::Matrix<double, 3, 4> J_BF;
  kinematics::foot_in_base(legs_[foot], q, p_BF, J_BF);
  const Vector3 left = state_.p_WB + state_.R_WB * p_BF - p_WF_[foot];
  // The last step down ends on the ground.
  v_WF_[foot] = left / kControlPeriod;
  v_WF_[foot].z() = std::max(v_WF_[foot].z(), (ground_z_[foot] - p_WF_[foot].z()) / kPhysicsStep);
}

void SingleBody::follow() noexcept {
  const rigid_body::State& body = body_.state();  // its origin is C
  rigid_body::Kinematics kinematics;
  rigid_body::Centroidal whole;
  const auto update = [&] {
    rigid_body::forward_kinematics(model_, state_, kinematics);
    rigid_body::centroidal(model_, kinematics, whole);
  };
  // The legs weigh a quarter of the robot, so C moves nearly as the trunk does: each correction leaves a small part of
  // the error.
  state_.R_WB = body.R_WB;
  for (int i = 0; i < kMaxIterations; ++i) {
    place_legs();
    update();
    const Vector3 error = body.p_WB - whole.p_WC;
    state_.p_WB += error;
    if (error.norm() < kTolerance) break;
  }
  state_.w_WB_W = body.w_WB_W;
  for (int i = 0; i < kMaxIterations; ++i) {
    move_legs();
    update();
    const Vector3 error = body.v_WB - whole.v_WC;
    state_.v_WB += error;
    if (error.norm() < kTolerance) break;
  }
}

void SingleBody::place_legs() noexcept {
  const Matrix3 R_LB = kinematics::leg_rotation().transpose();
  const double pitch = math::rpy_from_rotation(state_.R_WB).y();
  for (std::size_t leg = 0; leg < legs_.size(); ++leg) {
    const Vector3 p_BF = state_.R_WB.transpose() * (p_WF_[leg] - state_.p_WB);
    kinematics::LegVector q;
    // Out of reach, the joints are the nearest: the robot has fallen by then.
    static_cast<void>(
        kinematics::leg_ik(legs_[leg], R_LB * (p_BF - legs_[leg].p_BL), last_link_pitch_[leg] - pitch, q));
    state_.q.segment<4>(static_cast<Eigen::Index>(4 * leg)) = q;
  }
}

void SingleBody::move_legs() noexcept {
  const Vector3 w_B = state_.R_WB.transpose() * state_.w_WB_W;
  for (std::size_t leg = 0; leg < legs_.size(); ++leg) {
    const auto first = static_cast<Eigen::Index>(4 * leg);
    const kinematics::LegVector q = state_.q.segment<4>(first);
    Vector3 p_BF;
    Eigen::Matrix<double, 3, 4> J_BF;
    kinematics::foot_in_base(legs_[leg], q, p_BF, J_BF);
    // The foot moves as it does in W, and the last link turns about its pitch axis as little as W does.
    const Vector3 pitch_axis_B(0.0, std::cos(q[0]), std::sin(q[0]));
    Eigen::Matrix4d constraints;
    constraints << J_BF, 0.0, 1.0, 1.0, 1.0;
    Eigen::Vector4d rates;
    rates << state_.R_WB.transpose() * (v_WF_[leg] - state_.v_WB) - w_B.cross(p_BF), -pitch_axis_B.dot(w_B);
    state_.qd.segment<4>(first) = constraints.fullPivLu().solve(rates);
  }
}

}  // namespace stance::sim
