#pragma once
// From contact forces to joint torques of a stance leg:
//
//   tau = -J_G^T f + tau_gravity + tau_null
//
// J_G is the linear Jacobian of the ground point G under the foot (the foot is a sphere: the force acts on its lowest point),
// f the force of the ground on the foot, tau_gravity what holds the links against gravity. tau_null moves the redundant
// fourth joint towards the posture of the leg's inverse kinematics, along the direction n that leaves the foot where it is:
//   tau_null = n (n^T M n) n^T (kp (q_posture - q) - kd qd).
// Scaled by the inertia n^T M n; unscaled it is unstable on light links.
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

  /// Feed-forward torques of both legs for `force_W` [N], of the ground on each foot in W.
  void stance(const BodyDynamics& body, const ContactVectors& force_W, JointCommand& command) const noexcept;

 private:
  TorqueMapConfig config_;
  double last_link_pitch_;
  const rigid_body::Model& model_;
  std::array<rigid_body::Foot, 2> feet_;
  std::array<kinematics::LegGeometry, 2> legs_;
};

}  // namespace stance::behaviours
