#include "controller/loop/loop.hpp"
#include "controller/loop/wall_clock.hpp"
#include "controller/platform/program.hpp"

namespace stance::loop {

void run_lockstep(Ticker& ticker, io::Transport& transport, const std::vector<std::uint8_t>& run_info,
                  const std::atomic<bool>& stop) {
  WallClock clock;
  io::Message timing;
  std::int64_t last_utime = 0;

  const auto answer = [&] {
    for (const Published& out : ticker.published()) transport.publish(out.channel, out.message.bytes());
  };
  transport.subscribe(io::channel::kUserCommand,
                      [&](io::Bytes bytes) { static_cast<void>(ticker.offer_user_command(bytes)); });
  transport.subscribe(io::channel::kStop, [&](io::Bytes bytes) { static_cast<void>(ticker.offer_stop(bytes)); });
  transport.subscribe(io::channel::kBallObservation,
                      [&](io::Bytes bytes) { static_cast<void>(ticker.offer_ball(bytes)); });
  transport.subscribe(io::channel::kCalibrationPoints,
                      [&](io::Bytes bytes) { static_cast<void>(ticker.offer_calibration(bytes)); });
  transport.subscribe(io::channel::kRobotState, [&](io::Bytes bytes) {
    RobotState state;
    if (!io::decode(bytes, state)) return;
    const io::Header& answered = ticker.header();
    if (answered.seq > 0 && state.run_id == answered.run_id && state.seq == answered.state_seq) {
      answer();
      return;
    }
    clock.start();
    const bool same_run = answered.seq > 0 && state.run_id == answered.run_id;
    static_cast<void>(ticker.offer_state(bytes));
    ticker.tick(same_run ? periods_between(last_utime, state.utime) : 1, clock);
    last_utime = state.utime;
    answer();
    clock.finish();
    io::encode(ticker.header(), clock.timing(), timing);
    transport.publish(io::channel::kTiming, timing.bytes());
  });

  platform::EverySecond info_pace;
  while (!stop.load(std::memory_order_relaxed)) {
    if (info_pace.due()) transport.publish(io::channel::kRunInfo, run_info);
    transport.handle(100);
  }
}

}  // namespace stance::loop
