#pragma once
// The controller's own model as a plant: one rigid body in Bullet at the robot's centre of mass, with its total mass
// and standing's inertia (kinematics::standing_inertia). Gravity, the pushes, and the planned forces under its feet act
// on it.
//
// What the sensors see is the robot whose centre of mass is there and whose trunk is turned so: its feet stay where
// they are, those that the plan lifts follow the joint command, each leg's last link keeps its pitch in W, and the
// trunk stands where the legs' weight asks it to, at the speed that gives C its own.
#include <array>
#include <vector>

#include "controller/kinematics/leg.hpp"
#include "sim/world.hpp"

namespace stance::sim {

class SingleBody {
 public:
  /// `setup` as of the whole robot, with two legs of document 000. Throws std::invalid_argument for another robot.
  explicit SingleBody(const WorldSetup& setup);

  /// One step of kPhysicsStep under the ground's forces `force_W` [N] at the feet's ground points, and the wrench
  /// `push` about the trunk's origin.
  void step(const ContactVectors& force_W, const Wrench& push);

  /// The foot goes, in the steps to come, where the leg's joints at `q` [rad] have it, down to the ground, with a lag
  /// of a control period; `stand` ends that.
  void swing(std::size_t foot, const kinematics::LegVector& q) noexcept;
  void stand(std::size_t foot) noexcept { v_WF_[foot].setZero(); }
  bool on_ground(std::size_t foot) const noexcept { return p_WF_[foot].z() <= ground_z_[foot] + kTouch; }

  const rigid_body::State& state() const { return state_; }
  /// Forces of the last step: those that were asked for [N].
  const ContactVectors& foot_force_W() const { return foot_force_W_; }
  const ContactVectors& foot_tips_W() const { return p_WF_; }
  int body_on_ground() const { return -1; }
  Mechanics mechanics() const noexcept { return body_.mechanics(); }

 private:
  static constexpr double kTouch = 1e-9;  // m

  void follow() noexcept;
  void place_legs() noexcept;
  void move_legs() noexcept;

  rigid_body::Model model_;
  std::array<kinematics::LegGeometry, 2> legs_;
  std::array<double, 2> last_link_pitch_{};  // rad, q1 + q2 + q3 with the trunk upright
  ContactVectors p_WF_{};                    // tips of the feet, and their velocities
  ContactVectors v_WF_ = zero_contact_vectors();
  std::array<double, 2> radius_{}, ground_z_{};  // m, of a foot, and of its tip on the ground
  World body_;
  rigid_body::State state_;
  ContactVectors foot_force_W_{};
};

}  // namespace stance::sim
