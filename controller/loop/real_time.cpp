#include <thread>

#include "controller/loop/loop.hpp"
#include "controller/loop/mailbox.hpp"
#include "controller/loop/wall_clock.hpp"
#include "controller/platform/program.hpp"

namespace stance::loop {
namespace {

constexpr std::int64_t kPeriodNs = 10'000'000;
constexpr std::int64_t kStatePollNs = 100'000;
static_assert(kPeriodNs * 1e-9 == kControlPeriod);

/// What the receiving thread leaves for the control thread.
struct Inbox {
  Mailbox<io::Message> state, user_command, stop, ball, calibration;
  std::atomic<std::int64_t> dropped_states{0};

  static bool put(Mailbox<io::Message>& box, io::Bytes bytes) noexcept {
    io::Message& draft = box.draft();
    if (bytes.size() > draft.data.size()) return false;
    std::copy(bytes.begin(), bytes.end(), draft.data.begin());
    draft.size = bytes.size();
    return box.send();
  }
};

/// The first deadline on the grid of the states' stamps, `phase` after them: the nearest one, which may just have
/// passed. On our own grid where the stamps are of another clock.
std::int64_t first_deadline(std::int64_t state_utime, std::int64_t phase_ns) noexcept {
  constexpr std::int64_t same_clock_us = 1'000'000;
  const std::int64_t now = platform::monotonic_ns();
  const std::int64_t now_us = now / 1000;
  if (state_utime > now_us + same_clock_us || state_utime < now_us - same_clock_us) return now;
  const std::int64_t origin = state_utime * 1000 + phase_ns;
  return origin >= now ? origin : origin + (now - origin + kPeriodNs / 2) / kPeriodNs * kPeriodNs;
}

}  // namespace

void run_real_time(Ticker& ticker, io::Transport& transport, const std::vector<std::uint8_t>& run_info,
                   const RealTimeConfig& config, const std::atomic<bool>& stop) {
  Inbox inbox;
  transport.subscribe(io::channel::kRobotState, [&](io::Bytes bytes) {
    if (Inbox::put(inbox.state, bytes)) inbox.dropped_states.fetch_add(1, std::memory_order_relaxed);
  });
  transport.subscribe(io::channel::kUserCommand, [&](io::Bytes bytes) { Inbox::put(inbox.user_command, bytes); });
  transport.subscribe(io::channel::kStop, [&](io::Bytes bytes) { Inbox::put(inbox.stop, bytes); });
  transport.subscribe(io::channel::kBallObservation, [&](io::Bytes bytes) { Inbox::put(inbox.ball, bytes); });
  transport.subscribe(io::channel::kCalibrationPoints, [&](io::Bytes bytes) { Inbox::put(inbox.calibration, bytes); });
  std::thread receiver([&] {
    platform::EverySecond info_pace;
    while (!stop.load(std::memory_order_relaxed)) {
      if (info_pace.due()) transport.publish(io::channel::kRunInfo, run_info);
      transport.handle(100);
    }
  });

  const auto take_messages = [&] {
    if (const io::Message* bytes = inbox.user_command.take())
      static_cast<void>(ticker.offer_user_command(bytes->bytes()));
    if (const io::Message* bytes = inbox.stop.take()) static_cast<void>(ticker.offer_stop(bytes->bytes()));
    if (const io::Message* bytes = inbox.ball.take()) static_cast<void>(ticker.offer_ball(bytes->bytes()));
    if (const io::Message* bytes = inbox.calibration.take())
      static_cast<void>(ticker.offer_calibration(bytes->bytes()));
    if (const io::Message* bytes = inbox.state.take()) static_cast<void>(ticker.offer_state(bytes->bytes()));
  };

  const auto phase_ns = static_cast<std::int64_t>(config.phase * 1e9);
  const auto state_wait_ns = static_cast<std::int64_t>(config.state_wait * 1e9);
  WallClock clock;
  io::Timing& timing = clock.timing();
  io::Message timing_message, input_message;
  std::int64_t deadline_ns = 0;
  std::int64_t run_id = 0;
  bool running = false;
  int periods = 1;
  while (!stop.load(std::memory_order_relaxed)) {
    if (!running) {
      // Nothing to do before the first state.
      platform::sleep_until(platform::monotonic_ns() + 1'000'000);
      take_messages();
      if (!ticker.has_new_state()) continue;
      running = true;
      run_id = ticker.state().run_id;
      deadline_ns = first_deadline(ticker.state().utime, phase_ns);
    }
    while (!stop.load(std::memory_order_relaxed) && platform::monotonic_ns() < deadline_ns)
      platform::sleep_until(deadline_ns);
    timing.wake_latency_us = static_cast<double>(platform::monotonic_ns() - deadline_ns) * 1e-3;
    take_messages();
    // A state a little late is better than none.
    while (!ticker.has_new_state() && platform::monotonic_ns() < deadline_ns + state_wait_ns &&
           !stop.load(std::memory_order_relaxed)) {
      platform::sleep_until(platform::monotonic_ns() + kStatePollNs);
      take_messages();
    }
    clock.start();
    timing.state_age_us = static_cast<double>(timing.start_utime) - static_cast<double>(ticker.state().utime);
    const std::int32_t time_left = time_left_us(deadline_ns + kPeriodNs - platform::monotonic_ns());
    ticker.tick(periods, clock, time_left);
    for (const Published& out : ticker.published()) transport.publish(out.channel, out.message.bytes());
    io::encode(ticker.header(), time_left, input_message);
    transport.publish(io::channel::kTickInput, input_message.bytes());
    clock.finish();

    if (ticker.state().run_id != run_id) {
      // Another simulator, another grid.
      run_id = ticker.state().run_id;
      deadline_ns = first_deadline(ticker.state().utime, phase_ns) - kPeriodNs;
    }
    deadline_ns += kPeriodNs;
    const std::int64_t now = platform::monotonic_ns();
    const std::int64_t missed = now > deadline_ns ? (now - deadline_ns + kPeriodNs - 1) / kPeriodNs : 0;
    deadline_ns += missed * kPeriodNs;
    periods = 1 + static_cast<int>(missed);
    timing.missed_ticks += missed;
    timing.slack_us = static_cast<double>(deadline_ns - missed * kPeriodNs - now) * 1e-3;
    timing.dropped_states = inbox.dropped_states.load(std::memory_order_relaxed);
    io::encode(ticker.header(), timing, timing_message);
    transport.publish(io::channel::kTiming, timing_message.bytes());
  }
  receiver.join();
}

}  // namespace stance::loop
