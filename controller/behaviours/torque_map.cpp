#include "controller/behaviours/torque_map.hpp"

#include <cmath>

namespace stance::behaviours {
namespace {

constexpr double kMinNullSum = 1e-2;  // below it the last link's angle cannot be kept by moving along n

}  // namespace

TorqueMap::TorqueMap(const TorqueMapConfig& config, double last_link_pitch, const rigid_body::Model& model,
                     const std::array<rigid_body::Foot, 2>& feet, const std::array<kinematics::LegGeometry, 2>& legs)
    : config_(config), last_link_pitch_(last_link_pitch), model_(model), feet_(feet), legs_(legs) {}

void TorqueMap::stance(const BodyDynamics& body, const ContactVectors& force_W, JointCommand& command) const noexcept {
  command.mode = DriveMode::kActive;
  command.num_joints = model_.num_joints;
  command.position.setZero();
  command.velocity.setZero();
  command.kp.setZero();
  command.kd.setZero();
  const double trunk_pitch = math::rpy_from_rotation(body.state.R_WB).y();
  const Vector3 w_WB_B = body.state.R_WB.transpose() * body.state.w_WB_W;
  rigid_body::Jacobian J;
  kinematics::LegKinematics leg;
  for (int i = 0; i < 2; ++i) {
    const auto side = static_cast<std::size_t>(i);
    const int first = 4 * i;
    const rigid_body::Foot& foot = feet_[side];
    const auto link = static_cast<std::size_t>(foot.body);
    const Vector3 p_WF = body.kinematics.p_W[link] + body.kinematics.R_W[link] * foot.tip;
    const Vector3 p_WG = p_WF - Vector3(0.0, 0.0, foot.radius);
    rigid_body::geometric_jacobian(model_, body.state, body.kinematics, foot.body, p_WG, J);

    const kinematics::LegVector q = body.state.q.segment<4>(first), qd = body.state.qd.segment<4>(first);
    kinematics::leg_kinematics(legs_[side], q, leg);
    kinematics::LegVector posture;
    static_cast<void>(kinematics::leg_ik(legs_[side], leg.foot, last_link_pitch_ - trunk_pitch, posture));
    const kinematics::LegVector n = kinematics::null_direction(leg.J_foot);
    const double n_sum = n.tail<3>().sum();
    const Vector3 pitch_axis_B(0.0, std::cos(q[0]), std::sin(q[0]));
    const double link_rate = qd.tail<3>().sum() + pitch_axis_B.dot(w_WB_B);
    const double alpha = std::abs(n_sum) > kMinNullSum ? -link_rate / n_sum : 0.0;
    const kinematics::LegVector posture_rate = qd + alpha * n;
    const double inertia = n.dot(body.mass_matrix.block<4, 4>(6 + first, 6 + first) * n);

    command.feedforward_torque.segment<4>(first) =
        -J.block<3, 4>(3, 6 + first).transpose() * force_W[side] + body.gravity.segment<4>(6 + first);
    command.position.segment<4>(first) = posture + config_.lead * posture_rate;
    command.velocity.segment<4>(first) = posture_rate;
    command.kp.segment<3>(first + 1).setConstant(inertia * config_.null_space_kp);
    command.kd.segment<3>(first + 1).setConstant(inertia * config_.null_space_kd);
  }
}

}  // namespace stance::behaviours
