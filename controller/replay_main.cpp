// stance-replay: feeds a log's states and commands through the controller that the log itself describes, and compares
// every byte.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "controller/behaviours/biped_controller.hpp"
#include "controller/compose.hpp"
#include "controller/force_qp/tick_file.hpp"
#include "controller/io/log.hpp"
#include "controller/io/run_info.hpp"
#include "controller/loop/wall_clock.hpp"
#include "controller/platform/hash.hpp"

namespace {

using namespace stance;
using Payload = std::vector<std::uint8_t>;

/// Messages by what a trace calls them; a name may stand for several, whose hash tells them apart.
template <typename Key>
using Named = std::map<Key, std::vector<Payload>>;

/// What a log holds of one controller.
struct Recording {
  io::RunInfo info;
  bool has_info = false;
  std::map<std::int64_t, io::TraceKey> ticks;
  std::map<std::string, std::map<std::int64_t, Payload>, std::less<>> published;  // by channel and tick
  Named<std::pair<std::int64_t, std::int64_t>> states;                            // by run and seq
  Named<std::int64_t> user_commands, stops, balls, calibrations;                  // by seq
  std::map<std::int64_t, std::int32_t> time_left_us;                              // by tick, where it was told
};

template <typename Key>
void keep(Named<Key>& messages, const Key& name, const Payload& payload) {
  std::vector<Payload>& known = messages[name];
  if (std::find(known.begin(), known.end(), payload) == known.end()) known.push_back(payload);
}

Recording read(const std::string& file) {
  Recording recording;
  io::LogReader log(file);
  io::LogEvent event;
  while (log.next(event)) {
    const Payload payload(event.bytes.begin(), event.bytes.end());
    if (event.channel == io::channel::kRunInfo) {
      recording.has_info = io::decode(event.bytes, recording.info) || recording.has_info;
    } else if (event.channel == io::channel::kRobotState) {
      RobotState state;
      if (io::decode(event.bytes, state)) keep(recording.states, {state.run_id, state.seq}, payload);
    } else if (event.channel == io::channel::kUserCommand) {
      UserCommand command;
      if (io::decode(event.bytes, command)) keep(recording.user_commands, command.seq, payload);
    } else if (event.channel == io::channel::kStop) {
      io::Stop stop;
      if (io::decode(event.bytes, stop)) keep(recording.stops, stop.seq, payload);
    } else if (event.channel == io::channel::kBallObservation) {
      BallObservation ball;
      if (io::decode(event.bytes, ball)) keep(recording.balls, ball.seq, payload);
    } else if (event.channel == io::channel::kCalibrationPoints) {
      CalibrationPoints points;
      if (io::decode(event.bytes, points)) keep(recording.calibrations, points.seq, payload);
    } else if (event.channel == io::channel::kTickInput) {
      io::TickTime input;
      if (io::decode(event.bytes, input)) recording.time_left_us[input.seq] = input.time_left_us;
    } else if (event.channel == io::channel::kTrace) {
      io::TraceKey key;
      if (!io::decode(event.bytes, key)) continue;
      recording.ticks[key.header.seq] = key;
      recording.published[event.channel][key.header.seq] = payload;
    } else if (const auto seq = io::tick_of(event.channel, event.bytes)) {
      recording.published[event.channel][*seq] = payload;
    }
  }
  return recording;
}

/// What a tick took anew, null where nothing of a kind.
struct Taken {
  const Payload* state = nullptr;
  const Payload* user_command = nullptr;
  const Payload* stop = nullptr;
  const Payload* ball = nullptr;
  const Payload* calibration = nullptr;
  std::int32_t time_left_us = loop::kWholePeriodUs;
};

/// The recorded messages with the hash that the tick's trace states; nothing where the log does not hold them all.
std::optional<Taken> taken_by(const Recording& recording, const io::TraceKey& tick) {
  const auto choices = [](const auto& messages, const auto& name, bool none_too) {
    std::vector<const Payload*> found;
    if (none_too) found.push_back(nullptr);
    const auto named = messages.find(name);
    if (named == messages.end()) return found;
    for (const Payload& payload : named->second) found.push_back(&payload);
    return found;
  };
  const auto told = recording.time_left_us.find(tick.header.seq);
  const std::int32_t time_left = told == recording.time_left_us.end() ? loop::kWholePeriodUs : told->second;
  const auto hash = [](const Payload* payload) { return payload == nullptr ? 0 : platform::hash(*payload); };
  std::vector<const Payload*> states{nullptr};
  if (tick.consumed.state_is_new) {
    states = choices(recording.states, std::pair(tick.header.run_id, tick.header.state_seq), false);
  }
  for (const Payload* state : states) {
    for (const Payload* user_command : choices(recording.user_commands, tick.consumed.user_command_seq, true)) {
      for (const Payload* stop : choices(recording.stops, tick.consumed.stop_seq, true)) {
        for (const Payload* ball : choices(recording.balls, tick.consumed.ball_seq, true)) {
          for (const Payload* calibration : choices(recording.calibrations, tick.consumed.calibration_seq, true)) {
            const loop::TakenHashes taken{hash(state), hash(user_command), hash(stop),
                                          hash(ball),  hash(calibration),  time_left};
            if (loop::consumed_hash(taken) == tick.consumed.hash) {
              return Taken{state, user_command, stop, ball, calibration, time_left};
            }
          }
        }
      }
    }
  }
  return std::nullopt;
}

struct Outcome {
  std::int64_t ticks = 0;
  std::int64_t messages = 0;  ///< compared
  std::int64_t differing = 0;
  std::int64_t first_differing = 0;  ///< tick, 0 for none
  std::string incomplete;            ///< why the replay ended early, empty where it did not
};

/// `ticked` is called after each tick with what it decided, until it is false.
template <typename Ticked>
Outcome verify(const Recording& recording, loop::Controller controller, const Ticked& ticked) {
  Outcome outcome;
  loop::Ticker ticker(std::move(controller));
  loop::NoClock clock;
  std::int64_t expected = 1;
  for (const auto& entry : recording.ticks) {
    const std::int64_t seq = entry.first;
    const io::TraceKey& tick = entry.second;
    if (seq != expected++) {
      outcome.incomplete = "the log does not hold the trace of tick " + std::to_string(seq - 1);
      break;
    }
    const std::optional<Taken> taken = taken_by(recording, tick);
    if (!taken) {
      outcome.incomplete = "the log does not hold what tick " + std::to_string(seq) + " took: state " +
                           std::to_string(tick.header.state_seq) + ", user command " +
                           std::to_string(tick.consumed.user_command_seq) + ", stop " +
                           std::to_string(tick.consumed.stop_seq) + ", ball " + std::to_string(tick.consumed.ball_seq) +
                           ", calibration points " + std::to_string(tick.consumed.calibration_seq) +
                           ", as they were, and the time that it had";
      break;
    }
    if (taken->state != nullptr) static_cast<void>(ticker.offer_state(*taken->state));
    if (taken->user_command != nullptr) static_cast<void>(ticker.offer_user_command(*taken->user_command));
    if (taken->stop != nullptr) static_cast<void>(ticker.offer_stop(*taken->stop));
    if (taken->ball != nullptr) static_cast<void>(ticker.offer_ball(*taken->ball));
    if (taken->calibration != nullptr) static_cast<void>(ticker.offer_calibration(*taken->calibration));
    ticker.tick(tick.consumed.periods, clock, taken->time_left_us);
    ++outcome.ticks;

    for (const loop::Published& replayed : ticker.published()) {
      const auto channel = recording.published.find(std::string_view(replayed.channel));
      if (channel == recording.published.end()) continue;
      const auto found = channel->second.find(seq);
      if (found == channel->second.end()) continue;
      ++outcome.messages;
      const io::Bytes bytes = replayed.message.bytes();
      if (std::equal(bytes.begin(), bytes.end(), found->second.begin(), found->second.end())) continue;
      ++outcome.differing;
      if (outcome.first_differing == 0) outcome.first_differing = seq;
    }
    if (!ticked(ticker.output().trace)) break;
  }
  return outcome;
}

/// Replays, and writes the force QPs of the first `most` ticks that step to `file`. Throws where it cannot.
Outcome write_force_qps(const Recording& recording, const config::RobotDescription& robot, const std::string& file,
                        int most) {
  std::ofstream out(file, std::ios::binary);
  force_qp::TickWriter writer(out, robot.model.total_mass * kGravity);
  const ComposedBiped composed = compose_biped(robot);
  const Outcome outcome = verify(recording, composed.controller, [&](const Trace& trace) {
    if (trace.behaviour == Behaviour::kWalk && trace.qp_status != QpStatus::kNotRun) {
      writer.write(composed.biped->stepping_problem());
    }
    return writer.ticks() < most;
  });
  const bool written = writer.finish();
  // No file of what the log does not say.
  if (!written || writer.ticks() == 0 || outcome.differing > 0) std::filesystem::remove(file);
  if (!written) throw std::runtime_error(file + ": cannot be written");
  if (writer.ticks() == 0) throw std::runtime_error("no tick of the log steps: there is no force QP over a horizon");
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Replays a log through the controller and compares all that it published but its timing, byte for byte."};
  app.set_version_flag("--version", STANCE_VERSION);
  std::string file, qp_file;
  int qp_ticks = 1000;
  app.add_option("--qp", qp_file,
                 "Writes the force QPs of the ticks that step to this file, as bench_force_qp reads them");
  app.add_option("--qp-ticks", qp_ticks, "Of so many ticks, at most; the replay ends with the last")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("LOG", file, "An LCM log of stance-controller's run")->required()->check(CLI::ExistingFile);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const Recording recording = read(file);
    if (!recording.has_info || recording.ticks.empty()) {
      std::cerr << "stance-replay: " << file
                << " holds no run of stance-controller (RUN_INFO_CONTROLLER and CONTROLLER_TRACE)\n";
      return 3;
    }
    const auto robot = config::robot_from_texts(recording.info.configuration, recording.info.urdf);
    const Outcome outcome = qp_file.empty() ? verify(recording, compose(robot), [](const Trace&) { return true; })
                                            : write_force_qps(recording, robot, qp_file, qp_ticks);
    std::cout << outcome.ticks << " of " << recording.ticks.size() << " ticks replayed, " << outcome.messages
              << " messages compared, " << outcome.differing << " differ";
    if (outcome.first_differing > 0) std::cout << ", first at tick " << outcome.first_differing;
    if (!outcome.incomplete.empty()) std::cout << "; " << outcome.incomplete;
    std::cout << "\n";
    return outcome.differing == 0 && outcome.incomplete.empty() ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << "stance-replay: " << error.what() << "\n";
    return 3;
  }
}
