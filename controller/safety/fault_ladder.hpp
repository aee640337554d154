#pragma once
// From faults to what the robot does about them: run -> hold -> damp -> stop.
//
//   state stale or invalid, QP failed   hold the last plan, where there is one, for at most hold_time, then damp; run
//                                       again when it is over
//   robot fallen, operator's stop       damp at once, and stay
//   damped for damp_time                stop: no torque, until a new run
#include <array>
#include <cstdint>

#include "controller/interface/signals.hpp"

namespace stance::safety {

struct FaultLadderConfig {
  double hold_time = 0.0;  ///< s
  double damp_time = 0.0;  ///< s
  void validate() const;   ///< throws std::invalid_argument naming the field, its value and the range
};

class FaultLadder {
 public:
  explicit FaultLadder(const FaultLadderConfig& config);

  /// Notes a fault of this tick; each kind counts once a tick.
  void report(Fault fault) noexcept { faults_ |= bit(fault); }

  /// Ends the tick: counts its faults, and decides. `periods` control periods have passed since the last call;
  /// `can_hold`: is there a plan to hold?
  SafetyMode step(int periods, bool can_hold = true) noexcept;

  SafetyMode mode() const noexcept { return mode_; }
  /// No good tick leads back to run: the robot fell, the operator stopped it, or it stopped.
  bool latched() const noexcept { return latched_ || mode_ == SafetyMode::kStop; }
  /// Of the last finished tick.
  std::uint32_t faults() const noexcept { return finished_faults_; }
  const std::array<std::int64_t, kNumFaults>& counts() const noexcept { return counts_; }
  /// Writes mode, faults and counts of the last finished tick.
  void write(Trace& trace) const noexcept {
    trace.safety = mode_;
    trace.faults = finished_faults_;
    trace.fault_count = counts_;
  }

 private:
  static constexpr std::uint32_t bit(Fault fault) { return 1U << static_cast<int>(fault); }

  FaultLadderConfig config_;
  SafetyMode mode_ = SafetyMode::kRun;
  std::uint32_t faults_ = 0;
  std::uint32_t finished_faults_ = 0;
  std::array<std::int64_t, kNumFaults> counts_{};
  double time_in_mode_ = 0.0;  ///< s
  bool latched_ = false;       ///< a fault that no good tick undoes
};

}  // namespace stance::safety
