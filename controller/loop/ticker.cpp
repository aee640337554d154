#include "controller/loop/ticker.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "controller/platform/hash.hpp"

namespace stance::loop {
namespace {

constexpr std::uint64_t kPeriodUs = kWholePeriodUs;
static_assert(kPeriodUs * 1e-6 == kControlPeriod);
constexpr std::int64_t kTimeLeftGridUs = 500;

}  // namespace

int periods_between(std::int64_t utime, std::int64_t next_utime) noexcept {
  const double periods = std::round((static_cast<double>(next_utime) - static_cast<double>(utime)) / kPeriodUs);
  return static_cast<int>(std::clamp(periods, 1.0, 1e6));
}

std::int32_t time_left_us(std::int64_t ns) noexcept {
  const std::int64_t us = std::clamp<std::int64_t>(ns / 1000, 0, kWholePeriodUs);
  return static_cast<std::int32_t>(us / kTimeLeftGridUs * kTimeLeftGridUs);
}

std::uint64_t consumed_hash(const TakenHashes& taken) noexcept {
  std::uint64_t hash = platform::kHashSeed;
  for (const std::uint64_t part : {taken.state, taken.user_command, taken.stop, taken.ball, taken.calibration}) {
    hash = platform::hash_step(hash, part);
  }
  // A whole period is what every tick had before some had less: those logs' hashes hold.
  if (taken.time_left_us != kWholePeriodUs) {
    hash = platform::hash_step(hash, static_cast<std::uint64_t>(taken.time_left_us));
  }
  return hash;
}

Ticker::Ticker(Controller controller) : controller_(std::move(controller)) {
  for (const Publication& publication : controller_.publications) published_.push_back({publication.channel, {}});
  published_.push_back({io::channel::kJointCommand, {}});
  published_.push_back({io::channel::kTrace, {}});
}

bool Ticker::offer_state(io::Bytes bytes) noexcept {
  if (!io::decode(bytes, input_.state)) return false;
  consumed_.state_is_new = true;
  hashes_.state = platform::hash(bytes);
  return true;
}

void Ticker::end_run() noexcept {
  if (hashes_.user_command == 0) {
    input_.user_command = UserCommand{};
    consumed_.user_command_seq = 0;
  }
  if (hashes_.ball == 0) {
    input_.ball = BallObservation{};
    consumed_.ball_seq = 0;
  }
  if (hashes_.calibration == 0) {
    input_.calibration = CalibrationPoints{};
    consumed_.calibration_seq = 0;
  }
  // A sender that counts from 1 again under the same id may be a message gone astray: no reason to undo a stop.
  if (hashes_.stop == 0 && input_.state.run_id != header_.run_id) {
    input_.operator_stop = false;
    consumed_.stop_seq = 0;
  }
}

bool Ticker::offer_user_command(io::Bytes bytes) noexcept {
  if (!io::decode(bytes, input_.user_command)) return false;
  consumed_.user_command_seq = input_.user_command.seq;
  hashes_.user_command = platform::hash(bytes);
  return true;
}

bool Ticker::offer_stop(io::Bytes bytes) noexcept {
  io::Stop stop;
  if (!io::decode(bytes, stop)) return false;
  input_.operator_stop = true;
  consumed_.stop_seq = stop.seq;
  hashes_.stop = platform::hash(bytes);
  return true;
}

bool Ticker::offer_ball(io::Bytes bytes) noexcept {
  if (!io::decode(bytes, input_.ball)) return false;
  consumed_.ball_seq = input_.ball.seq;
  hashes_.ball = platform::hash(bytes);
  return true;
}

bool Ticker::offer_calibration(io::Bytes bytes) noexcept {
  if (!io::decode(bytes, input_.calibration)) return false;
  consumed_.calibration_seq = input_.calibration.seq;
  hashes_.calibration = platform::hash(bytes);
  return true;
}

void Ticker::tick(int periods, StageClock& clock, std::int32_t time_left_us) noexcept {
  if (starts_run(header_.run_id, header_.state_seq, input_.state)) end_run();
  consumed_.periods = periods;
  hashes_.time_left_us = time_left_us;
  consumed_.hash = consumed_hash(hashes_);
  late_periods_ = consumed_.state_is_new ? 0 : late_periods_ + periods;
  input_.state_is_new = consumed_.state_is_new;
  input_.periods = periods;
  input_.ball_is_new = hashes_.ball != 0;
  input_.time_left = 1e-6 * time_left_us;
  clock.stamp(Stage::kDecode);
  controller_.tick(input_, clock, output_);

  // A stamp is whatever came: unsigned, so that it may wrap.
  header_.utime = static_cast<std::int64_t>(static_cast<std::uint64_t>(input_.state.utime) +
                                            static_cast<std::uint64_t>(late_periods_) * kPeriodUs);
  header_.seq += 1;
  header_.state_seq = input_.state.seq;
  header_.run_id = input_.state.run_id;
  const std::size_t own = controller_.publications.size();
  for (std::size_t i = 0; i < own; ++i) {
    controller_.publications[i].encode(header_, output_, published_[i].message);
  }
  io::encode(header_, output_.command, published_[own].message);
  io::encode(header_, consumed_, output_.trace, published_[own + 1].message);
  consumed_.state_is_new = false;
  hashes_ = TakenHashes{};
  clock.stamp(Stage::kEncode);
}

}  // namespace stance::loop
