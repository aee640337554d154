#include "controller/planning/velocity.hpp"

#include <algorithm>
#include <cmath>

#include "controller/interface/require.hpp"

namespace stance::planning {
namespace {

constexpr Require require{"velocity."};

}  // namespace

void VelocityConfig::validate() const {
  for (int i = 0; i < 2; ++i) {
    require(min[i] <= 0.0, "min", min[i], "<= 0 m/s");
    require(max[i] >= 0.0, "max", max[i], ">= 0 m/s");
    require(integral_share >= 0.0, "integral_share", integral_share, ">= 0");
    require(integral_limit[i] >= 0.0, "integral_limit", integral_limit[i], ">= 0 m/s");
  }
  require(max_yaw_rate >= 0.0, "max_yaw_rate", max_yaw_rate, ">= 0 rad/s");
  require(acceleration > 0.0, "acceleration", acceleration, "> 0 m/s^2");
  require(yaw_acceleration > 0.0, "yaw_acceleration", yaw_acceleration, "> 0 rad/s^2");
  require(integral_gain >= 0.0, "integral_gain", integral_gain, ">= 0");
  require(filter_time > 0.0, "filter_time", filter_time, "> 0 s");
  require(max_error >= 0.0, "max_error", max_error, ">= 0 m/s");
  require(max_yaw_error > 0.0, "max_yaw_error", max_yaw_error, "> 0 rad");
}

void VelocityReference::reset(double yaw) noexcept {
  ramped_.setZero();
  integral_.setZero();
  filtered_.setZero();
  yaw_ = yaw;
  yaw_rate_ = 0.0;
}

void VelocityReference::step(const Vector2& command, double yaw_rate, const Vector2& measured, double yaw,
                             bool integrate, double dt) noexcept {
  const double turn = config_.yaw_acceleration * dt;
  yaw_rate_ += std::clamp(std::clamp(yaw_rate, -config_.max_yaw_rate, config_.max_yaw_rate) - yaw_rate_, -turn, turn);
  yaw_ += yaw_rate_ * dt;
  yaw_ = std::clamp(yaw_, yaw - config_.max_yaw_error, yaw + config_.max_yaw_error);
  const double change = config_.acceleration * dt;
  filtered_ += std::min(dt / config_.filter_time, 1.0) * (measured - filtered_);
  for (int i = 0; i < 2; ++i) {
    const double wanted = std::clamp(command[i], config_.min[i], config_.max[i]);
    ramped_[i] += std::clamp(wanted - ramped_[i], -change, change);
    if (!integrate) continue;
    const double error = std::clamp(ramped_[i] - filtered_[i], -config_.max_error, config_.max_error);
    const double limit = config_.integral_limit[i] + config_.integral_share * std::abs(ramped_[i]);
    integral_[i] = std::clamp(integral_[i] + config_.integral_gain * dt * error, -limit, limit);
  }
}

}  // namespace stance::planning
