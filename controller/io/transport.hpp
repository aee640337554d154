#pragma once
// LCM as the loop sees it: channels of bytes.
#include <functional>
#include <memory>
#include <string>

#include "controller/io/codec.hpp"

namespace stance::io {

class Transport {
 public:
  /// Throws std::runtime_error, saying what to do, where LCM cannot be brought up on `url`.
  explicit Transport(const std::string& url);
  ~Transport();

  /// `handler` runs within handle(), and must not throw.
  void subscribe(const char* channel, std::function<void(Bytes)> handler);

  /// Waits up to `timeout_ms` for one message and hands it over; false where none came.
  bool handle(int timeout_ms);

  /// Allocates nothing. False where LCM refuses. Thread-safe.
  bool publish(const char* channel, Bytes bytes) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stance::io
