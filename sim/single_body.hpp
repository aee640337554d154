#pragma once
// The controller's own model as a plant: one rigid body in Bullet at the robot's centre of mass, with its total mass.
// Gravity, the pushes, and the planned forces at the planned points act on it.
//
// What the sensors see is the robot whose centre of mass is there and whose trunk is turned so: its feet stay where
// they start, each leg's last link keeps its pitch in W, and the trunk stands where the legs' weight asks it to, at the
// speed that gives C its own.
#include <array>
#include <vector>

#include "controller/kinematics/leg.hpp"
#include "sim/world.hpp"

namespace stance::sim {

/// Forces on the robot and where they act.
struct AppliedForces {
  ContactVectors force_W{};  ///< N
  ContactVectors p_WF{};     ///< m
};

class SingleBody {
 public:
  /// `setup` as of the whole robot, with two legs of document 000. Throws std::invalid_argument for another robot.
  explicit SingleBody(const WorldSetup& setup);

  /// One step of kPhysicsStep under `forces` of the ground and a wrench on the base.
  void step(const AppliedForces& forces, const Wrench& push);

  const rigid_body::State& state() const { return state_; }
  /// Forces of the last step: those that were asked for [N].
  const ContactVectors& foot_force_W() const { return foot_force_W_; }
  const ContactVectors& foot_tips_W() const { return p_WF_; }
  bool body_on_ground() const { return false; }
  Mechanics mechanics() const noexcept { return body_.mechanics(); }

 private:
  void follow() noexcept;
  void place_legs() noexcept;
  void move_legs() noexcept;

  rigid_body::Model model_;
  std::array<kinematics::LegGeometry, 2> legs_;
  std::array<double, 2> last_link_pitch_{};  // rad, q1 + q2 + q3 with the trunk upright
  ContactVectors p_WF_{};
  World body_;
  rigid_body::State state_;
  ContactVectors foot_force_W_{};
};

}  // namespace stance::sim
