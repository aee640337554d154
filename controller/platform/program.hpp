#pragma once
// What the programs that speak LCM have in common.
#include <atomic>
#include <cstdint>
#include <string>

namespace stance::platform {

inline constexpr const char* kDefaultLcmUrl = "udpm://239.255.76.67:7667?ttl=0";  ///< stays on this machine

/// The arguments after the program's name, separated by blanks: what a log says of a run.
std::string command_line(int argc, const char* const* argv);

/// True from the first SIGINT or SIGTERM on, which end a sleep at once.
const std::atomic<bool>& stop_on_signals();

/// For what is said once a second.
class EverySecond {
 public:
  /// True at the first call, and then once a second.
  bool due() noexcept;

 private:
  std::int64_t next_ns_ = 0;
};

}  // namespace stance::platform
