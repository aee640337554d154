#pragma once
// From contact forces to the joint command of a stance leg, and from a path to that of a swing leg. Stance,
// feed-forward torque:
//
//   tau = -J_G^T f + tau_gravity
//
// J_G is the linear Jacobian of the ground point G under the foot (the foot is a sphere: the force acts on its lowest
// point), f the force of the ground on the foot, tau_gravity what holds the links against gravity.
//
// The fourth joint is redundant; the drives keep it, at their own rate, on the posture of the leg's inverse kinematics:
//   position   q_posture + lead qd_posture
//   velocity   qd_posture = qd + alpha n, alpha such that the last link stays
//   gains      (n^T M n) kp, (n^T M n) kd on the three pitch joints
// with n the joint motion that leaves the foot where it is, and `lead` the middle of the time that the command is in
// force. Position and velocity follow the foot's motion, so the gains act along n and hardly on the force. They are
// scaled by the inertia along n: unscaled they are unstable on light links. The posture keeps the last link's pitch
// against the world, not against the trunk: a pitching trunk then turns about its hips on legs that keep their shape,
// far from the joints' limits.
//
// A swing leg follows its foot's reference, taken `swing_lead` on: position, velocity and acceleration by the leg's
// inverse kinematics and its differences, feed-forward by inverse dynamics on the base's acceleration, gains kp and kd
// times each joint's own inertia. Where the ankle would be farther than `max_ankle` from the hip the last link
// stretches instead of the knee; a foot farther than `max_reach`, or joints beyond their range less `limit_margin`, are
// not asked for.
#include "controller/behaviours/biped_config.hpp"
#include "controller/kinematics/leg.hpp"
#include "controller/rigid_body/dynamics.hpp"

namespace stance::behaviours {

/// What the tree's dynamics say in one configuration.
struct BodyDynamics {
  rigid_body::State state;
  rigid_body::Kinematics kinematics;
  rigid_body::Centroidal centroidal;
  rigid_body::MatrixNu mass_matrix;
  rigid_body::VectorNu gravity;
  Vector3 a_WB = Vector3::Zero();       ///< m/s^2, of the base, mean since the last tick
  Vector3 wdot_WB_W = Vector3::Zero();  ///< rad/s^2
};

/// What a leg is to do: bear a force, or swing its foot.
struct LegTask {
  bool stance = true;
  Vector3 force_W = Vector3::Zero();  ///< N, of the ground on the foot
  planning::SwingReference swing;     ///< where the foot is to be now, in W
};

class TorqueMap {
 public:
  TorqueMap(const TorqueMapConfig& config, double last_link_pitch, const rigid_body::Model& model,
            const std::array<rigid_body::Foot, 2>& feet, const std::array<kinematics::LegGeometry, 2>& legs);

  /// Commands of both legs.
  void map(const BodyDynamics& body, const std::array<LegTask, 2>& tasks, JointCommand& command) const noexcept;

 private:
  void stance(const BodyDynamics& body, int leg, const Vector3& force_W, JointCommand& command) const noexcept;
  void swing(const BodyDynamics& body, int leg, const planning::SwingReference& reference,
             JointCommand& command) const noexcept;
  /// Joints of a leg whose foot is at `p_BF` [m], or as near as its reach and its joints' ranges let it come.
  kinematics::LegVector posture(int leg, const Matrix3& R_WB, const Vector3& p_BF) const noexcept;
  /// What the last link's angle q1 + q2 + q3 should be for a foot at `p_LF` [m], the trunk pitched by `trunk_pitch`
  /// [rad].
  double pitch_sum(int leg, const Vector3& p_LF, double trunk_pitch) const noexcept;

  TorqueMapConfig config_;
  double last_link_pitch_;
  const rigid_body::Model& model_;
  std::array<rigid_body::Foot, 2> feet_;
  std::array<kinematics::LegGeometry, 2> legs_;
};

}  // namespace stance::behaviours
