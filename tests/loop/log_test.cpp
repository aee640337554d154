#include "controller/io/log.hpp"

#include <unistd.h>

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/loop/biped_rig.hpp"

namespace stance::io {
namespace {

using test::ByteVector;

struct Event {
  std::int64_t utime;
  std::string channel;
  ByteVector bytes;
  friend bool operator==(const Event&, const Event&) = default;
};

const std::vector<Event> kEvents{{10, "ROBOT_STATE", {1, 2, 3}},
                                 {10, "JOINT_COMMAND", {}},
                                 {20, "TRUTH", ByteVector(5000, 7)},
                                 {-5, "X", {0xED, 0xA1, 0xDA, 0x01}},  // LCM's own mark of an event
                                 {1'700'000'000'000'000, "CONTROLLER_TRACE", ByteVector(600, 0xED)}};

/// A log file of this process alone, gone at the end.
struct LogFile {
  LogFile() {
    LogWriter log(file);
    for (const Event& event : kEvents) log.write(event.utime, event.channel, event.bytes);
  }
  ~LogFile() { std::filesystem::remove(file); }
  LogFile(const LogFile&) = delete;
  LogFile& operator=(const LogFile&) = delete;

  std::vector<Event> read() const {
    std::vector<Event> events;
    LogReader log(file);
    LogEvent event;
    while (log.next(event)) {
      events.push_back({event.utime, event.channel, {event.bytes.begin(), event.bytes.end()}});
    }
    return events;
  }

  std::string file =
      (std::filesystem::temp_directory_path() / ("stance_log_test_" + std::to_string(getpid()) + ".lcm")).string();
};

}  // namespace

TEST_CASE_METHOD(LogFile, "ALogIsReadAsItWasWritten") { CHECK(read() == kEvents); }

TEST_CASE_METHOD(LogFile, "ATornLogReadsUpToItsLastWholeEvent") {
  const std::vector<Event> all_but_last(kEvents.begin(), kEvents.end() - 1);
  const auto size = std::filesystem::file_size(file);
  const auto last_event = 28 + kEvents.back().channel.size() + kEvents.back().bytes.size();
  for (std::size_t cut = 1; cut <= last_event; ++cut) {
    CAPTURE(cut);
    std::filesystem::resize_file(file, size - cut);
    REQUIRE(read() == all_but_last);
  }
  std::filesystem::resize_file(file, size - last_event - 1);
  CHECK(read() == std::vector<Event>(kEvents.begin(), kEvents.end() - 2));
}

TEST_CASE("AnEmptyLogHoldsNothing") {
  LogFile log;
  std::filesystem::resize_file(log.file, 0);
  CHECK(log.read().empty());
}

TEST_CASE("ALogThatCannotBeOpenedIsNamed") {
  using Catch::Matchers::ContainsSubstring;
  using Catch::Matchers::MessageMatches;
  const std::string nowhere =
      (std::filesystem::temp_directory_path() / "stance_no_such_directory" / "log.lcm").string();
  CHECK_THROWS_MATCHES(LogWriter(nowhere), std::runtime_error, MessageMatches(ContainsSubstring(nowhere)));
  CHECK_THROWS_MATCHES(LogReader(nowhere), std::runtime_error, MessageMatches(ContainsSubstring(nowhere)));
}

}  // namespace stance::io
