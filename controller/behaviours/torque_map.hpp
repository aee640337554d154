#pragma once
// From contact forces to the joint command of a stance leg. Feed-forward torque:
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
};

class TorqueMap {
 public:
  TorqueMap(const TorqueMapConfig& config, double last_link_pitch, const rigid_body::Model& model,
            const std::array<rigid_body::Foot, 2>& feet, const std::array<kinematics::LegGeometry, 2>& legs);

  /// Commands of both legs for `force_W` [N], of the ground on each foot in W.
  void stance(const BodyDynamics& body, const ContactVectors& force_W, JointCommand& command) const noexcept;

 private:
  TorqueMapConfig config_;
  double last_link_pitch_;
  const rigid_body::Model& model_;
  std::array<rigid_body::Foot, 2> feet_;
  std::array<kinematics::LegGeometry, 2> legs_;
};

}  // namespace stance::behaviours
