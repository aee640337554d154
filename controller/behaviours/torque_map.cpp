#include "controller/behaviours/torque_map.hpp"

#include <algorithm>
#include <cmath>

namespace stance::behaviours {
namespace {

constexpr double kMinNullSum = 1e-2;   // below it the last link's angle cannot be kept by moving along n
constexpr double kDifference = 0.003;  // s, between the postures whose differences are a swing leg's rates
constexpr double kSmallest = 1e-9;     // m

Vector3 pitch_axis_B(double q0) noexcept { return {0.0, std::cos(q0), std::sin(q0)}; }

}  // namespace

TorqueMap::TorqueMap(const TorqueMapConfig& config, double last_link_pitch, const rigid_body::Model& model,
                     const std::array<rigid_body::Foot, 2>& feet, const std::array<kinematics::LegGeometry, 2>& legs)
    : config_(config), last_link_pitch_(last_link_pitch), model_(model), feet_(feet), legs_(legs) {}

void TorqueMap::map(const BodyDynamics& body, const std::array<LegTask, 2>& tasks,
                    JointCommand& command) const noexcept {
  command = JointCommand{};
  command.mode = DriveMode::kActive;
  command.num_joints = model_.num_joints;
  for (int leg = 0; leg < 2; ++leg) {
    const LegTask& task = tasks[static_cast<std::size_t>(leg)];
    if (task.stance) {
      stance(body, leg, task.force_W, command);
    } else {
      swing(body, leg, task.swing, command);
    }
  }
}

double TorqueMap::pitch_sum(int leg, const Vector3& p_LF, double trunk_pitch) const noexcept {
  const kinematics::LegGeometry& geometry = legs_[static_cast<std::size_t>(leg)];
  const double wanted = last_link_pitch_ - trunk_pitch;
  // In the leg's plane, from the hip's pitch axis: x forward, y down.
  const double x = p_LF.x(), y = std::hypot(p_LF.y(), p_LF.z()) - geometry.length[0];
  const double L3 = geometry.length[3];
  if (std::hypot(x + L3 * std::sin(wanted), y - L3 * std::cos(wanted)) <= config_.max_ankle) return wanted;
  const double distance = std::hypot(x, y);
  const double cosine = (distance * distance + L3 * L3 - config_.max_ankle * config_.max_ankle) / (2.0 * distance * L3);
  return std::atan2(-x, y) - std::acos(std::clamp(cosine, -1.0, 1.0));
}

void TorqueMap::stance(const BodyDynamics& body, int leg, const Vector3& force_W,
                       JointCommand& command) const noexcept {
  const auto side = static_cast<std::size_t>(leg);
  const int first = 4 * leg;
  const double trunk_pitch = math::rpy_from_rotation(body.state.R_WB).y();
  const Vector3 w_WB_B = body.state.R_WB.transpose() * body.state.w_WB_W;
  const rigid_body::Foot& foot = feet_[side];
  const auto link = static_cast<std::size_t>(foot.body);
  const Vector3 p_WF = body.kinematics.p_W[link] + body.kinematics.R_W[link] * foot.tip;
  const Vector3 p_WG = p_WF - Vector3(0.0, 0.0, foot.radius);
  rigid_body::Jacobian J;
  rigid_body::geometric_jacobian(model_, body.state, body.kinematics, foot.body, p_WG, J);

  const kinematics::LegVector q = body.state.q.segment<4>(first), qd = body.state.qd.segment<4>(first);
  kinematics::LegKinematics kinematics;
  kinematics::leg_kinematics(legs_[side], q, kinematics);
  kinematics::LegVector posture;
  static_cast<void>(
      kinematics::leg_ik(legs_[side], kinematics.foot, pitch_sum(leg, kinematics.foot, trunk_pitch), posture));
  // A leg bent by its landing goes back to its posture gently: hastily it would tear its foot off the ground.
  const double error = (posture - q).cwiseAbs().maxCoeff();
  if (error > config_.max_posture_error) posture = q + config_.max_posture_error / error * (posture - q);
  const kinematics::LegVector n = kinematics::null_direction(kinematics.J_foot);
  const double n_sum = n.tail<3>().sum();
  const double link_rate = qd.tail<3>().sum() + pitch_axis_B(q[0]).dot(w_WB_B);
  const double alpha = std::abs(n_sum) > kMinNullSum ? -link_rate / n_sum : 0.0;
  const kinematics::LegVector posture_rate = qd + alpha * n;
  const double inertia = n.dot(body.mass_matrix.block<4, 4>(6 + first, 6 + first) * n);

  command.feedforward_torque.segment<4>(first) =
      -J.block<3, 4>(3, 6 + first).transpose() * force_W + body.gravity.segment<4>(6 + first);
  command.position.segment<4>(first) = posture + config_.lead * posture_rate;
  command.velocity.segment<4>(first) = posture_rate;
  command.kp.segment<3>(first + 1).setConstant(inertia * config_.null_space_kp);
  command.kd.segment<3>(first + 1).setConstant(inertia * config_.null_space_kd);
}

kinematics::LegVector TorqueMap::posture(int leg, const Matrix3& R_WB, const Vector3& p_BF) const noexcept {
  const auto side = static_cast<std::size_t>(leg);
  const kinematics::LegGeometry& geometry = legs_[side];
  Vector3 p_LF = kinematics::leg_rotation().transpose() * (p_BF - geometry.p_BL);
  // Within reach, along the line from the hip's pitch axis.
  const double lateral = std::max(std::hypot(p_LF.y(), p_LF.z()), kSmallest), y = lateral - geometry.length[0];
  const double shrink = std::min(1.0, config_.max_reach / std::max(std::hypot(p_LF.x(), y), kSmallest));
  p_LF.x() *= shrink;
  p_LF.tail<2>() *= (geometry.length[0] + shrink * y) / lateral;
  kinematics::LegVector q;
  static_cast<void>(kinematics::leg_ik(geometry, p_LF, pitch_sum(leg, p_LF, math::rpy_from_rotation(R_WB).y()), q));
  for (int i = 0; i < 4; ++i) {
    const rigid_body::Joint& joint = model_.joints[static_cast<std::size_t>(4 * leg + i)];
    q[i] = std::clamp(q[i], joint.lower + config_.limit_margin, joint.upper - config_.limit_margin);
  }
  return q;
}

void TorqueMap::swing(const BodyDynamics& body, int leg, const planning::SwingReference& now,
                      JointCommand& command) const noexcept {
  const int first = 4 * leg;
  const rigid_body::State& state = body.state;
  // Three postures along the foot's and the trunk's ways, `swing_lead` on in the middle: where the leg can not follow,
  // at a limit or out of reach, its rates stay those of a leg that moves along it.
  std::array<kinematics::LegVector, 3> q;
  for (int k = 0; k < 3; ++k) {
    const double t = config_.swing_lead + (k - 1) * kDifference;
    const Matrix3 R_WB = math::exp_so3(t * (state.w_WB_W + 0.5 * t * body.wdot_WB_W)) * state.R_WB;
    const Vector3 p_BF_W = now.p - state.p_WB + t * (now.v - state.v_WB + 0.5 * t * (now.a - body.a_WB));
    q[static_cast<std::size_t>(k)] = posture(leg, R_WB, R_WB.transpose() * p_BF_W);
  }
  const kinematics::LegVector qd = (q[2] - q[0]) / (2.0 * kDifference);
  const kinematics::LegVector qdd = (q[2] - 2.0 * q[1] + q[0]) / (kDifference * kDifference);

  rigid_body::State then = state;
  then.q.segment<4>(first) = q[1];
  then.qd.segment<4>(first) = qd;
  rigid_body::VectorNu nud = rigid_body::VectorNu::Zero(6 + model_.num_joints), torque;
  nud.head<6>() << body.wdot_WB_W, body.a_WB;
  nud.segment<4>(6 + first) = qdd;
  rigid_body::inverse_dynamics(model_, then, nud, torque);

  const auto M = body.mass_matrix.block<4, 4>(6 + first, 6 + first);
  command.feedforward_torque.segment<4>(first) = torque.segment<4>(6 + first);
  command.position.segment<4>(first) = q[1];
  command.velocity.segment<4>(first) = qd;
  command.kp.segment<4>(first) = config_.swing_kp * M.diagonal();
  command.kd.segment<4>(first) = config_.swing_kd * M.diagonal();
}

}  // namespace stance::behaviours
