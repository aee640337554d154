#pragma once
// The height of the centre of mass over the ground: the operator's offset, approached at a bounded rate, and an
// integral that takes out what the model leaves over.
#include <algorithm>
#include <array>

namespace stance::behaviours {

struct HeightConfig {
  double integral_gain = 0.0;            ///< 1/s
  double integral_limit = 0.0;           ///< m
  double offset_rate = 0.0;              ///< m/s, at which the height follows the operator's
  std::array<double, 2> offset_range{};  ///< m, that an operator may ask for

  /// Throws std::invalid_argument naming the field, its value and the allowed range.
  void validate() const;
};

class Height {
 public:
  explicit Height(const HeightConfig& config) noexcept : config_(config) {}

  void reset() noexcept { offset_ = integral_ = 0.0; }

  double offset() const noexcept { return offset_; }  ///< m, over the nominal height
  /// The same, on the way to `wanted` for `dt` [s].
  double offset(double wanted, double dt) noexcept {
    const double step = config_.offset_rate * dt;
    return offset_ += std::clamp(wanted - offset_, -step, step);
  }
  /// [m], to be added to the reference, after `error` [m] (reference - measured) for `dt` [s].
  double integral(double error, double dt) noexcept {
    const double limit = config_.integral_limit;
    return integral_ = std::clamp(integral_ + config_.integral_gain * dt * error, -limit, limit);
  }

 private:
  HeightConfig config_;
  double offset_ = 0.0;
  double integral_ = 0.0;
};

}  // namespace stance::behaviours
