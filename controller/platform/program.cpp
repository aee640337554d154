#include "controller/platform/program.hpp"

#include <csignal>

#include "controller/platform/real_time.hpp"

namespace stance::platform {
namespace {

std::atomic<bool> stop{false};
static_assert(std::atomic<bool>::is_always_lock_free);
void on_signal(int /*signal*/) { stop.store(true, std::memory_order_relaxed); }

}  // namespace

std::string command_line(int argc, const char* const* argv) {
  std::string text;
  for (int i = 1; i < argc; ++i) {
    if (i > 1) text += ' ';
    text += argv[i];
  }
  return text;
}

const std::atomic<bool>& stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;  // without SA_RESTART
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return stop;
}

bool EverySecond::due() noexcept {
  constexpr std::int64_t second_ns = 1'000'000'000;
  const std::int64_t now = monotonic_ns();
  if (now < next_ns_) return false;
  next_ns_ = now + second_ns;
  return true;
}

}  // namespace stance::platform
