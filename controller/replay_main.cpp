// stance-replay: feeds a log's states and commands through the controller that the log itself describes, and compares
// every byte.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <iostream>
#include <map>
#include <vector>

#include "controller/compose.hpp"
#include "controller/io/log.hpp"
#include "controller/io/run_info.hpp"
#include "controller/loop/wall_clock.hpp"

namespace {

using namespace stance;
using Payload = std::vector<std::uint8_t>;

/// What a log holds of one controller, by tick and by sequence number.
struct Recording {
  io::RunInfo info;
  bool has_info = false;
  std::map<std::int64_t, io::TraceKey> ticks;
  std::map<std::int64_t, Payload> traces, commands, plans;          // by tick
  std::map<std::pair<std::int64_t, std::int64_t>, Payload> states;  // by run and seq
  std::map<std::int64_t, Payload> user_commands, stops;             // by seq
};

template <typename Message, typename Map>
void keep(io::Bytes bytes, Map& map) {
  Message message;
  if (io::decode(bytes, message)) map[message.seq] = Payload(bytes.begin(), bytes.end());
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
      if (io::decode(event.bytes, state)) recording.states[{state.run_id, state.seq}] = payload;
    } else if (event.channel == io::channel::kUserCommand) {
      keep<UserCommand>(event.bytes, recording.user_commands);
    } else if (event.channel == io::channel::kStop) {
      keep<io::Stop>(event.bytes, recording.stops);
    } else if (event.channel == io::channel::kTrace) {
      io::TraceKey key;
      if (!io::decode(event.bytes, key)) continue;
      recording.ticks[key.header.seq] = key;
      recording.traces[key.header.seq] = payload;
    } else if (const auto seq = io::tick_of(event.channel, event.bytes)) {
      (event.channel == io::channel::kForcePlan ? recording.plans : recording.commands)[*seq] = payload;
    }
  }
  return recording;
}

struct Outcome {
  std::int64_t ticks = 0;
  std::int64_t messages = 0;  ///< compared
  std::int64_t differing = 0;
  std::int64_t first_differing = 0;  ///< tick, 0 for none
  std::string incomplete;            ///< why the replay ended early, empty where it did not
};

Outcome verify(const Recording& recording) {
  Outcome outcome;
  loop::Ticker ticker(compose(config::robot_from_texts(recording.info.configuration, recording.info.urdf)));
  loop::NoClock clock;
  std::int64_t user_command_seq = 0, stop_seq = 0, expected = 1;
  for (const auto& [seq, tick] : recording.ticks) {
    const auto missing = [&](const char* what, std::int64_t which) {
      outcome.incomplete = "tick " + std::to_string(seq) + " needs " + what + " " + std::to_string(which) +
                           ", which the log does not hold";
    };
    if (seq != expected++) {
      missing("the trace of tick", seq - 1);
      break;
    }
    if (tick.consumed.user_command_seq != user_command_seq) {
      user_command_seq = tick.consumed.user_command_seq;
      const auto found = recording.user_commands.find(user_command_seq);
      if (found == recording.user_commands.end()) return missing("user command", user_command_seq), outcome;
      static_cast<void>(ticker.offer_user_command(found->second));
    }
    if (tick.consumed.state_is_new) {
      const auto found = recording.states.find({tick.header.run_id, tick.header.state_seq});
      if (found == recording.states.end()) return missing("state", tick.header.state_seq), outcome;
      static_cast<void>(ticker.offer_state(found->second));
    }
    if (tick.consumed.stop_seq != stop_seq) {
      stop_seq = tick.consumed.stop_seq;
      if (stop_seq != 0) {
        const auto found = recording.stops.find(stop_seq);
        if (found == recording.stops.end()) return missing("stop", stop_seq), outcome;
        static_cast<void>(ticker.offer_stop(found->second));
      }
    }
    ticker.tick(tick.consumed.periods, clock);
    ++outcome.ticks;

    const auto compare = [&](const std::map<std::int64_t, Payload>& recorded, const io::Message& replayed) {
      const auto found = recorded.find(seq);
      if (found == recorded.end()) return;
      ++outcome.messages;
      const io::Bytes bytes = replayed.bytes();
      if (std::equal(bytes.begin(), bytes.end(), found->second.begin(), found->second.end())) return;
      ++outcome.differing;
      if (outcome.first_differing == 0) outcome.first_differing = seq;
    };
    compare(recording.plans, ticker.plan());
    compare(recording.commands, ticker.command());
    compare(recording.traces, ticker.trace());
  }
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Replays a log through the controller and compares every joint command, force plan and trace, byte for byte."};
  app.set_version_flag("--version", STANCE_VERSION);
  std::string file;
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
    const Outcome outcome = verify(recording);
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
