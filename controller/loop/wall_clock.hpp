#pragma once
// The clocks that the loop reads, so that no module has to.
#include "controller/io/codec.hpp"
#include "controller/platform/real_time.hpp"

namespace stance::loop {

/// Times a tick: each stage lasts from the stamp before it to its own.
class WallClock final : public StageClock {
 public:
  void start() noexcept {
    timing_.stage_us.fill(0.0);
    const std::int64_t now = platform::monotonic_ns();
    timing_.period_us = start_ns_ > 0 ? us(now - start_ns_) : 0.0;
    timing_.start_utime = now / 1000;
    start_ns_ = last_ns_ = now;
    cpu_ns_ = platform::thread_cpu_ns();
  }
  void stamp(Stage stage) noexcept override {
    const std::int64_t now = platform::monotonic_ns();
    timing_.stage_us[static_cast<std::size_t>(stage)] += us(now - last_ns_);
    last_ns_ = now;
  }
  void finish() noexcept {
    timing_.tick_us = us(platform::monotonic_ns() - start_ns_);
    timing_.cpu_us = us(platform::thread_cpu_ns() - cpu_ns_);
  }
  io::Timing& timing() noexcept { return timing_; }

 private:
  static double us(std::int64_t ns) noexcept { return static_cast<double>(ns) * 1e-3; }
  io::Timing timing_;
  std::int64_t start_ns_ = 0, last_ns_ = 0, cpu_ns_ = 0;
};

/// For replay, where nobody asks how long a stage took.
class NoClock final : public StageClock {
 public:
  void stamp(Stage /*stage*/) noexcept override {}
};

}  // namespace stance::loop
