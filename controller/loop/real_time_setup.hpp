#pragma once
#include <string>

namespace stance::loop {

/// Locks memory, prefaults the stack and asks for SCHED_FIFO at `priority`; `cpu` >= 0 pins this thread and those it
/// starts. Call it before LCM is constructed: its receiving thread inherits. Returns what was refused, empty where
/// nothing was.
std::string enter_real_time(int priority, int cpu);

}  // namespace stance::loop
