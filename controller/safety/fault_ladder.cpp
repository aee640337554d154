#include "controller/safety/fault_ladder.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace stance::safety {

void FaultLadderConfig::validate() const {
  if (!(hold_time >= 0.0 && hold_time <= 0.2)) {
    throw std::invalid_argument("safety.hold_time is " + std::to_string(hold_time) + " s, but must be in 0..0.2");
  }
  if (!(damp_time > 0.0) || !std::isfinite(damp_time)) {
    throw std::invalid_argument("safety.damp_time is " + std::to_string(damp_time) + " s, but must be > 0");
  }
}

FaultLadder::FaultLadder(const FaultLadderConfig& config) : config_(config) { config_.validate(); }

SafetyMode FaultLadder::step(int periods, bool can_hold) noexcept {
  constexpr std::uint32_t latching = bit(Fault::kRobotFallen) | bit(Fault::kOperatorStop);
  constexpr std::uint32_t passing = bit(Fault::kStateStale) | bit(Fault::kStateInvalid) | bit(Fault::kQpFailed);
  constexpr double rounding = 1e-9;

  finished_faults_ = faults_;
  faults_ = 0;
  for (int i = 0; i < kNumFaults; ++i) {
    if (finished_faults_ & (1U << i)) ++counts_[static_cast<std::size_t>(i)];
  }
  time_in_mode_ += periods * kControlPeriod;
  latched_ = latched_ || (finished_faults_ & latching) != 0;

  SafetyMode next = mode_;
  if (mode_ == SafetyMode::kStop) return mode_;
  if (mode_ == SafetyMode::kDamp && time_in_mode_ >= config_.damp_time - rounding) {
    next = SafetyMode::kStop;
  } else if (latched_) {
    next = SafetyMode::kDamp;
  } else if ((finished_faults_ & passing) == 0) {
    next = SafetyMode::kRun;
  } else if (mode_ == SafetyMode::kRun && can_hold && config_.hold_time > 0.0) {
    next = SafetyMode::kHold;
  } else if (mode_ == SafetyMode::kRun || time_in_mode_ >= config_.hold_time - rounding) {
    next = SafetyMode::kDamp;
  }
  if (next != mode_) {
    time_in_mode_ = 0.0;
    mode_ = next;
  }
  return mode_;
}

}  // namespace stance::safety
