#pragma once
// The machine's clock and its real-time privileges.
#include <cstdint>
#include <string>

namespace stance::platform {

/// ns of CLOCK_MONOTONIC.
std::int64_t monotonic_ns() noexcept;

/// ns of this thread's CPU time.
std::int64_t thread_cpu_ns() noexcept;

/// Until `deadline_ns` of that clock; a signal ends it early.
void sleep_until(std::int64_t deadline_ns) noexcept;

/// Locks memory, touches the stack and asks for SCHED_FIFO at `priority`; `cpu` >= 0 pins this thread and those it
/// starts. To be called before LCM is constructed: its receiving thread inherits. Returns what was refused, empty where
/// nothing was.
std::string enter_real_time(int priority, int cpu);

}  // namespace stance::platform
