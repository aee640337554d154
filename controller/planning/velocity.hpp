#pragma once
// The operator's velocity as the gait takes it: ramped, and corrected by what the robot really does.
#include "controller/planning/pendulum.hpp"

namespace stance::planning {

struct VelocityConfig {
  Vector2 min = Vector2::Zero();             ///< m/s, of the command, in H
  Vector2 max = Vector2::Zero();             ///< m/s
  double max_yaw_rate = 0.0;                 ///< rad/s
  double acceleration = 0.0;                 ///< m/s^2, of the ramp
  double yaw_acceleration = 0.0;             ///< rad/s^2
  double integral_gain = 0.0;                ///< 1/s
  Vector2 integral_limit = Vector2::Zero();  ///< m/s, at rest
  double integral_share = 0.0;               ///< of the speed, by which the limit grows
  double filter_time = 0.0;                  ///< s, of the measured velocity
  double max_error = 0.0;                    ///< m/s, that is integrated
  double max_yaw_error = 0.0;                ///< rad, by which the heading's reference may lead
  void validate() const;                     ///< throws std::invalid_argument naming the field, its value and the range
};

class VelocityReference {
 public:
  explicit VelocityReference(const VelocityConfig& config) : config_(config) {}

  void reset(double yaw) noexcept;

  /// `command` [m/s, in H] and `yaw_rate` [rad/s] as wanted, `measured` [m/s, in H]. `integrate`: has the gait settled?
  void step(const Vector2& command, double yaw_rate, const Vector2& measured, double yaw, bool integrate,
            double dt) noexcept;

  const Vector2& ramped() const noexcept { return ramped_; }          ///< m/s, in H
  Vector2 effective() const noexcept { return ramped_ + integral_; }  ///< m/s, what the footholds are laid for
  double yaw() const noexcept { return yaw_; }                        ///< rad, reference
  double yaw_rate() const noexcept { return yaw_rate_; }              ///< rad/s

 private:
  VelocityConfig config_;
  Vector2 ramped_ = Vector2::Zero(), integral_ = Vector2::Zero(), filtered_ = Vector2::Zero();
  double yaw_ = 0.0, yaw_rate_ = 0.0;
};

}  // namespace stance::planning
