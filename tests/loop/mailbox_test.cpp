#include "controller/loop/mailbox.hpp"

#include <array>
#include <atomic>
#include <catch2/catch_test_macros.hpp>
#include <cstdint>
#include <thread>

namespace stance::loop {
namespace {

/// Large enough to be torn, and says whether it was.
struct Parcel {
  std::array<std::int64_t, 64> copies{};
  void write(std::int64_t number) { copies.fill(number); }
  bool whole() const {
    for (const std::int64_t copy : copies) {
      if (copy != copies.front()) return false;
    }
    return true;
  }
  std::int64_t number() const { return copies.front(); }
};

}  // namespace

TEST_CASE("AnEmptyMailboxGivesNothing") {
  Mailbox<int> box;
  CHECK(box.take() == nullptr);
}

TEST_CASE("AMailboxGivesTheNewestMessageOnceAndSaysWhatItReplaced") {
  Mailbox<int> box;
  box.draft() = 1;
  CHECK_FALSE(box.send());
  box.draft() = 2;
  CHECK(box.send());
  const int* taken = box.take();
  REQUIRE(taken != nullptr);
  CHECK(*taken == 2);
  CHECK(box.take() == nullptr);
  box.draft() = 3;
  CHECK_FALSE(box.send());
  CHECK(*taken == 2);  // until the next call
  taken = box.take();
  REQUIRE(taken != nullptr);
  CHECK(*taken == 3);
}

TEST_CASE("BetweenTwoThreadsEachMessageIsWholeNewerAndTakenOrReplaced") {
  constexpr std::int64_t messages = 200'000;
  Mailbox<Parcel> box;
  std::int64_t replaced = 0;
  std::thread writer([&] {
    for (std::int64_t number = 1; number <= messages; ++number) {
      box.draft().write(number);
      if (box.send()) ++replaced;
    }
  });
  std::int64_t taken = 0, last = 0, torn = 0, out_of_order = 0;
  while (last < messages) {
    const Parcel* parcel = box.take();
    if (parcel == nullptr) {
      std::this_thread::yield();
      continue;
    }
    ++taken;
    torn += !parcel->whole();
    out_of_order += parcel->number() <= last;
    last = parcel->number();
  }
  writer.join();
  CHECK(torn == 0);
  CHECK(out_of_order == 0);
  CHECK(taken + replaced == messages);
}

}  // namespace stance::loop
