#pragma once
// The swing foot's way to its foothold: minimum jerk in x and y, up and down in z by the swing's phase, planned anew
// each tick from where the reference is.
#include "controller/math/so3.hpp"
#include "controller/planning/pendulum.hpp"

namespace stance::planning {

struct SwingConfig {
  double height = 0.0;         ///< m, over the higher of lift-off and touchdown
  double apex = 0.0;           ///< phase of the highest point, 0..1
  double depth = 0.0;          ///< m, below the expected ground, where the foot is sent
  double late_speed = 0.0;     ///< m/s, down, of a foot that finds no ground in time
  double late_depth = 0.0;     ///< m, below the expected ground, where that ends
  double min_time_left = 0.0;  ///< s, in which the horizontal way is planned at the least
  void validate() const;       ///< throws std::invalid_argument naming the field, its value and the range
};

struct SwingReference {
  Vector3 p = Vector3::Zero();  ///< m, tip of the foot, in W
  Vector3 v = Vector3::Zero();  ///< m/s
  Vector3 a = Vector3::Zero();  ///< m/s^2
};

class Swing {
 public:
  explicit Swing(const SwingConfig& config) : config_(config) {}

  /// The foot leaves the ground at `p` [m, in W].
  void lift_off(const Vector3& p) noexcept;

  /// `dt` [s] on, with `time_left` [s] before this step to a touchdown at `foothold` [m], whose tip will be at
  /// `ground_z` [m].
  void step(const Vector2& foothold, double ground_z, double time_left, double dt) noexcept;

  double phase() const noexcept { return phase_; }  ///< 0 at lift-off, 1 at the planned touchdown
  const SwingReference& reference() const noexcept { return reference_; }

 private:
  SwingConfig config_;
  SwingReference reference_;
  double phase_ = 0.0;
  double lift_off_z_ = 0.0;
  double overdue_ = 0.0;  // s, since the planned touchdown
};

}  // namespace stance::planning
