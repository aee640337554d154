#pragma once
// The newest message, from one writing thread to one reading thread, without locks: three buffers that change places.
#include <array>
#include <atomic>
#include <cstdint>

namespace stance::loop {

template <typename T>
class Mailbox {
 public:
  /// Where the writer prepares the next message.
  T& draft() noexcept { return buffers_[writer_]; }
  /// Makes the draft the newest; true where it replaced one that was never read.
  bool send() noexcept {
    const std::uint8_t old = shared_.exchange(static_cast<std::uint8_t>(writer_ | kUnread), std::memory_order_acq_rel);
    writer_ = old & kIndex;
    return (old & kUnread) != 0;
  }

  /// The newest message if there is one that was not taken yet, else null. Valid until the next call.
  const T* take() noexcept {
    if ((shared_.load(std::memory_order_relaxed) & kUnread) == 0) return nullptr;
    reader_ = shared_.exchange(reader_, std::memory_order_acq_rel) & kIndex;
    return &buffers_[reader_];
  }

 private:
  static constexpr std::uint8_t kIndex = 3, kUnread = 4;
  std::array<T, 3> buffers_{};
  std::uint8_t writer_ = 0, reader_ = 1;
  std::atomic<std::uint8_t> shared_{2};
};

}  // namespace stance::loop
