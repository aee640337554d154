#include "controller/estimation/com_offset_observer.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace stance::estimation {
namespace {

constexpr double kMinFootDistance = 0.02;  ///< m, below which the feet give no line

void require(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw std::invalid_argument("centre-of-mass offset: " + std::string(name) + " = " + std::to_string(value) +
                              " is not within [" + std::to_string(low) + ", " + std::to_string(high) + "]");
}

}  // namespace

void CentreOfMassOffsetConfig::validate() const {
  require("bandwidth", bandwidth, 0.0, 20.0);
  require("limit", limit, 0.0, 0.2);
}

CentreOfMassOffsetObserver::CentreOfMassOffsetObserver(const CentreOfMassOffsetConfig& config, double mass,
                                                       double foot_radius)
    : config_(config), mass_(mass), foot_radius_(foot_radius) {
  config_.validate();
  if (!(mass > 0.0))
    throw std::invalid_argument("centre-of-mass offset: mass = " + std::to_string(mass) + " is not positive");
}

void CentreOfMassOffsetObserver::reset() noexcept {
  offset_ = 0.0;
  observing_ = false;
}

Vector3 CentreOfMassOffsetObserver::step(const CentreOfMassOffsetInput& input, double dt) noexcept {
  const Vector3 heading(std::cos(input.yaw), std::sin(input.yaw), 0.0);
  Vector3 line = input.p_WF[0] - input.p_WF[1];
  line.z() = 0.0;
  const double distance = line.norm();
  if (!input.standing || distance < kMinFootDistance) {
    observing_ = false;
    return offset_ * heading;
  }

  // n forward, whichever foot is the left one.
  Vector3 a = line / distance;
  Vector3 n = a.cross(Vector3::UnitZ());
  if (n.dot(heading) < 0.0) {
    a = -a;
    n = -n;
  }
  const Vector3 r = input.p_WC - 0.5 * (input.p_WF[0] + input.p_WF[1]) + foot_radius_ * Vector3::UnitZ();
  const double angular_momentum = a.dot(input.L_C_W + mass_ * r.cross(input.v_WC));
  if (!observing_) angular_momentum_ = angular_momentum;
  observing_ = true;

  const double weight = mass_ * kGravity;
  const double w = config_.bandwidth;
  const double error = angular_momentum - angular_momentum_;
  angular_momentum_ += dt * (weight * (n.dot(r) + offset_) + 2.0 * w * error);
  offset_ = std::clamp(offset_ + dt * w * w / weight * error, -config_.limit, config_.limit);
  return offset_ * n;
}

}  // namespace stance::estimation
