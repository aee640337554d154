#pragma once
// The two ways to run a Ticker over LCM: on absolute deadlines, or in lockstep with whoever sends the states.
#include <atomic>
#include <cstdint>
#include <vector>

#include "controller/io/transport.hpp"
#include "controller/loop/ticker.hpp"

namespace stance::loop {

struct RealTimeConfig {
  double phase = 0.001;       ///< s, from a state's stamp to the tick that takes it
  double state_wait = 0.004;  ///< s, that a tick waits for a state that is late
};

/// Ends where `stop` becomes true. `run_info` is published once a second, off the control thread.
void run_real_time(Ticker& ticker, io::Transport& transport, const std::vector<std::uint8_t>& run_info,
                   const RealTimeConfig& config, const std::atomic<bool>& stop);

/// Answers each state once; a state that comes again gets the identical answer.
void run_lockstep(Ticker& ticker, io::Transport& transport, const std::vector<std::uint8_t>& run_info,
                  const std::atomic<bool>& stop);

}  // namespace stance::loop
