#pragma once
// LCM log files: the format of lcm-logger, without a network.
#include <cstdint>
#include <memory>
#include <string>

#include "controller/io/codec.hpp"

namespace stance::io {

class LogWriter {
 public:
  /// Throws std::runtime_error naming the file where it cannot be created.
  explicit LogWriter(const std::string& file);
  ~LogWriter();
  /// `utime` [us] stands as the event's time.
  void write(std::int64_t utime, const std::string& channel, Bytes bytes);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct LogEvent {
  std::int64_t utime = 0;  ///< us
  std::string channel;
  Bytes bytes;  ///< valid until the next event is read
};

class LogReader {
 public:
  /// Throws std::runtime_error naming the file where it cannot be opened.
  explicit LogReader(const std::string& file);
  ~LogReader();
  /// The next whole event; false at the end, or at a torn tail.
  bool next(LogEvent& event);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stance::io
