#include "controller/behaviours/torque_map.hpp"

namespace stance::behaviours {

TorqueMap::TorqueMap(const TorqueMapConfig& config, double last_link_pitch, const rigid_body::Model& model,
                     const std::array<rigid_body::Foot, 2>& feet,
                     const std::array<kinematics::LegGeometry, 2>& legs)
    : config_(config), last_link_pitch_(last_link_pitch), model_(model), feet_(feet), legs_(legs) {}

void TorqueMap::stance(const BodyDynamics& body, const ContactVectors& force_W, JointCommand& command) const noexcept {
  command.mode = DriveMode::kActive;
  command.num_joints = model_.num_joints;
  command.position = body.state.q;
  command.velocity.setZero();
  command.kp.setZero();
  command.kd.setZero();
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
    static_cast<void>(kinematics::leg_ik(legs_[side], leg.foot, last_link_pitch_, posture));
    const kinematics::LegVector n = kinematics::null_direction(leg.J_foot);
    const double inertia = n.dot(body.mass_matrix.block<4, 4>(6 + first, 6 + first) * n);
    const double acceleration = n.dot(config_.null_space_kp * (posture - q) - config_.null_space_kd * qd);

    command.feedforward_torque.segment<4>(first) = -J.block<3, 4>(3, 6 + first).transpose() * force_W[side] +
                                                   body.gravity.segment<4>(6 + first) + n * (inertia * acceleration);
  }
}

}  // namespace stance::behaviours
