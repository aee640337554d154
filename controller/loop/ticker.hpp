#pragma once
// One tick of any robot, from the newest messages' bytes to the bytes to publish. The real-time loop, the lockstep
// loop, the rollout and the replay all run this, so that the same inputs give the same bits.
#include <functional>
#include <span>
#include <vector>

#include "controller/io/codec.hpp"

namespace stance::loop {

/// A robot's tick. Must not throw.
using TickFunction = std::function<void(const TickInput&, StageClock&, TickOutput&)>;

/// A message that a robot's ticks publish besides the joint command and the trace, which every robot's do.
struct Publication {
  const char* channel;
  void (*encode)(const io::Header& header, const TickOutput& output, io::Message& out) noexcept;
};
/// Of one part of the tick's output, as in publication<&TickOutput::plan>(channel::kForcePlan).
template <auto part>
constexpr Publication publication(const char* channel) noexcept {
  return {channel, [](const io::Header& header, const TickOutput& output, io::Message& out) noexcept {
            io::encode(header, output.*part, out);
          }};
}
inline constexpr Publication kForcePlan = publication<&TickOutput::plan>(io::channel::kForcePlan);
inline constexpr Publication kArm3Motion = publication<&TickOutput::arm3_motion>(io::channel::kArm3Motion);

/// What a loop needs of a robot's controller.
struct Controller {
  TickFunction tick;
  std::vector<Publication> publications;
};

/// What a tick published, and where.
struct Published {
  const char* channel;
  io::Message message;
};

/// Control periods from one state's stamp to the next one's, at least 1.
int periods_between(std::int64_t utime, std::int64_t next_utime) noexcept;

inline constexpr std::int32_t kWholePeriodUs = 10'000;

/// TickInput::time_left [us] on its grid of 0.5 ms, of `ns` [ns] to the next tick's deadline; rounded down, so that a
/// tick has at least what it is told.
std::int32_t time_left_us(std::int64_t ns) noexcept;

/// Of the messages that a tick took anew, 0 for none; and its time left [us].
struct TakenHashes {
  std::uint64_t state = 0, user_command = 0, stop = 0, ball = 0, calibration = 0;
  std::int32_t time_left_us = kWholePeriodUs;
};
/// Consumed::hash.
std::uint64_t consumed_hash(const TakenHashes& taken) noexcept;

class Ticker {
 public:
  explicit Ticker(Controller controller);

  /// The newest message of a kind, for the next tick. False where the bytes are not a message of that type.
  [[nodiscard]] bool offer_state(io::Bytes bytes) noexcept;
  [[nodiscard]] bool offer_user_command(io::Bytes bytes) noexcept;
  [[nodiscard]] bool offer_stop(io::Bytes bytes) noexcept;
  [[nodiscard]] bool offer_ball(io::Bytes bytes) noexcept;
  [[nodiscard]] bool offer_calibration(io::Bytes bytes) noexcept;

  /// Is there a state that no tick has consumed?
  bool has_new_state() const noexcept { return consumed_.state_is_new; }
  const RobotState& state() const noexcept { return input_.state; }

  /// Runs the tick, `periods` control periods after the last one, with `time_left_us` [us] to the next one's deadline.
  void tick(int periods, StageClock& clock, std::int32_t time_left_us = kWholePeriodUs) noexcept;

  const io::Header& header() const noexcept { return header_; }
  const TickOutput& output() const noexcept { return output_; }
  /// All that the last tick published, in the order in which it goes out: the robot's own messages, its command, its
  /// trace.
  std::span<const Published> published() const noexcept { return published_; }
  const io::Message& command() const noexcept { return published_[published_.size() - 2].message; }
  const io::Message& trace() const noexcept { return published_.back().message; }

 private:
  /// What earlier ticks consumed ends with their run; what came since may be the new run's, and stays.
  void end_run() noexcept;

  Controller controller_;
  TickInput input_;
  TickOutput output_;
  io::Header header_;
  io::Consumed consumed_;          ///< by the coming tick
  TakenHashes hashes_;             ///< of the newest bytes of each kind since the last tick
  std::int64_t late_periods_ = 0;  ///< since the state in use
  std::vector<Published> published_;
};

}  // namespace stance::loop
