#include "controller/platform/real_time.hpp"

#include <sched.h>
#include <sys/mman.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>

namespace stance::platform {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

std::int64_t nanoseconds(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return now.tv_sec * kSecondNs + now.tv_nsec;
}

void touch_stack() noexcept {
  std::array<unsigned char, 256 * 1024> pages;
  volatile unsigned char* page = pages.data();
  for (std::size_t i = 0; i < pages.size(); i += 4096) page[i] = 0;
}

}  // namespace

std::int64_t monotonic_ns() noexcept { return nanoseconds(CLOCK_MONOTONIC); }

std::int64_t thread_cpu_ns() noexcept { return nanoseconds(CLOCK_THREAD_CPUTIME_ID); }

void sleep_until(std::int64_t deadline_ns) noexcept {
  const timespec deadline{deadline_ns / kSecondNs, deadline_ns % kSecondNs};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr);
}

std::string enter_real_time(int priority, int cpu) {
  std::string refused;
  const auto note = [&](const char* what) {
    refused += (refused.empty() ? "" : ", ") + std::string(what) + ": " + std::strerror(errno);
  };
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadow memory cannot be locked
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) note("locked memory");
#endif
  touch_stack();
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

}  // namespace stance::platform
