#include "controller/loop/real_time_setup.hpp"

#include <sched.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstring>

namespace stance::loop {
namespace {

void prefault_stack() {
  volatile unsigned char page[256 * 1024];
  for (std::size_t i = 0; i < sizeof page; i += 4096) page[i] = 0;
}

}  // namespace

std::string enter_real_time(int priority, int cpu) {
  std::string refused;
  const auto note = [&](const char* what) {
    if (!refused.empty()) refused += "; ";
    refused += std::string(what) + ": " + std::strerror(errno);
  };
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadow memory cannot be locked
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) note("locked memory");
#endif
  prefault_stack();
  if (cpu >= 0) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(cpu), &set);
    if (sched_setaffinity(0, sizeof set, &set) != 0) note("pinned core");
  }
  sched_param parameters{};
  parameters.sched_priority = priority;
  if (sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) note("SCHED_FIFO");
  return refused;
}

}  // namespace stance::loop
