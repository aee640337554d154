#pragma once
// LCM bytes to structs and back: pure functions, no socket, no allocation. This folder alone includes LCM.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "controller/interface/signals.hpp"

namespace stance::io {

using Bytes = std::span<const std::uint8_t>;

/// Channels, the same for every robot.
namespace channel {
inline constexpr const char* kRobotState = "ROBOT_STATE";
inline constexpr const char* kUserCommand = "USER_COMMAND";
inline constexpr const char* kStop = "STOP";
inline constexpr const char* kBallObservation = "BALL_OBSERVATION";
inline constexpr const char* kCalibrationPoints = "CALIBRATION_POINTS";
inline constexpr const char* kJointCommand = "JOINT_COMMAND";
inline constexpr const char* kForcePlan = "FORCE_PLAN";
inline constexpr const char* kArm3Motion = "ARM3_MOTION";
inline constexpr const char* kBallEstimate = "BALL_ESTIMATE";
inline constexpr const char* kCatchPlan = "CATCH_PLAN";
inline constexpr const char* kTrace = "CONTROLLER_TRACE";
inline constexpr const char* kTiming = "CONTROLLER_TIMING";
inline constexpr const char* kTickInput = "TICK_INPUT";
inline constexpr const char* kRunInfo = "RUN_INFO_CONTROLLER";
}  // namespace channel

/// Which message this is and what it answers.
struct Header {
  std::int64_t utime = 0;      ///< us, the consumed state's stamp and the periods since
  std::int64_t seq = 0;        ///< the tick
  std::int64_t state_seq = 0;  ///< 0 before the first state
  std::int64_t run_id = 0;     ///< the consumed state's
};

/// What a tick consumed, for the trace: with these a log replays.
struct Consumed {
  bool state_is_new = false;
  int periods = 1;
  std::int64_t user_command_seq = 0;
  std::int64_t stop_seq = 0;
  std::int64_t ball_seq = 0;
  std::int64_t calibration_seq = 0;
  std::uint64_t hash = 0;  ///< of the bytes of the newest message of each kind that came since the last tick
};

/// What the wall clock says of a tick.
struct Timing {
  std::array<double, kNumStages> stage_us{};
  double tick_us = 0.0;
  double cpu_us = 0.0;
  double period_us = 0.0;
  double wake_latency_us = 0.0;
  double slack_us = 0.0;
  double state_age_us = 0.0;
  std::int64_t start_utime = 0;  ///< us, monotonic
  std::int64_t missed_ticks = 0;
  std::int64_t dropped_states = 0;
};

/// Identity of an operator's stop.
struct Stop {
  std::int64_t utime = 0;
  std::int64_t seq = 0;
};

// Decoders return false, and leave `out` alone, where the bytes are not a whole message of the type.
[[nodiscard]] bool decode(Bytes bytes, RobotState& out) noexcept;
[[nodiscard]] bool decode(Bytes bytes, UserCommand& out) noexcept;
[[nodiscard]] bool decode(Bytes bytes, Stop& out) noexcept;
[[nodiscard]] bool decode(Bytes bytes, BallObservation& out) noexcept;
[[nodiscard]] bool decode(Bytes bytes, CalibrationPoints& out) noexcept;
/// The trace's record of what its tick consumed, for replay.
struct TraceKey {
  Header header;
  Consumed consumed;
};
[[nodiscard]] bool decode(Bytes bytes, TraceKey& out) noexcept;
/// What a tick was given that no other message told.
struct TickTime {
  std::int64_t seq = 0;           ///< the tick
  std::int32_t time_left_us = 0;  ///< us
};
[[nodiscard]] bool decode(Bytes bytes, TickTime& out) noexcept;
/// The tick that a message of one of the controller's channels is of, but for the trace; nothing for another channel or
/// broken bytes.
std::optional<std::int64_t> tick_of(std::string_view channel, Bytes bytes) noexcept;

/// Room for the largest message that the controller publishes.
inline constexpr std::size_t kMaxMessageBytes = 8192;
/// An encoded message in memory of its own.
struct Message {
  std::array<std::uint8_t, kMaxMessageBytes> data{};
  std::size_t size = 0;
  Bytes bytes() const { return {data.data(), size}; }
};

void encode(const Header& header, const JointCommand& command, Message& out) noexcept;
void encode(const Header& header, const ForcePlan& plan, Message& out) noexcept;
void encode(const Header& header, const Arm3Motion& motion, Message& out) noexcept;
/// Its nis is NaN where no observation came in the tick.
void encode(const Header& header, const BallEstimate& ball, Message& out) noexcept;
void encode(const Header& header, const CatchPlan& plan, Message& out) noexcept;
void encode(const Header& header, const Consumed& consumed, const Trace& trace, Message& out) noexcept;
void encode(const Header& header, const Timing& timing, Message& out) noexcept;
/// A TICK_INPUT; `time_left_us` [us].
void encode(const Header& header, std::int32_t time_left_us, Message& out) noexcept;

}  // namespace stance::io
