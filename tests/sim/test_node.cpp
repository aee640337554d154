#include <atomic>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <stance_msgs/run_info_t.hpp>
#include <string>
#include <vector>

#include "controller/platform/real_time.hpp"
#include "sim/node.hpp"
#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;
using stance_msgs::joint_command_t;
using stance_msgs::robot_state_t;

/// A node on memory's LCM, with a stand-in for the controller that answers each state within the same thread.
struct Bench {
  explicit Bench(std::int64_t start_utime = 0)
      : robot(test::biped()),
        scenario(test::biped_scenario("demo")),
        options{.seed = 3, .run_id = 11, .start_utime = start_utime, .plant = {}},
        lcm("memq://"),
        simulator(robot, scenario, options),
        node(lcm, simulator, encode_run_info(robot, scenario, options, "--robot biped")) {
    lcm.subscribeFunction("ROBOT_STATE", &Bench::on_state, this)->setQueueCapacity(0);
    for (const char* channel : {"TRUTH", "USER_COMMAND", "RUN_INFO_SIMULATOR"}) {
      lcm.subscribeFunction(channel, &Bench::on_other, this)->setQueueCapacity(0);
    }
  }

  static void on_state(const lcm::ReceiveBuffer* buffer, const std::string& channel, Bench* bench) {
    const auto* data = static_cast<const std::uint8_t*>(buffer->data);
    bench->states.emplace_back(data, data + buffer->data_size);
    bench->order.push_back(channel);
    robot_state_t state{};
    if (state.decode(data, 0, static_cast<int>(buffer->data_size)) <= 0) return;
    if (bench->silent_from > 0 && state.seq >= bench->silent_from && bench->ignored < bench->ignore) {
      ++bench->ignored;
      return;
    }
    joint_command_t command = test::hold_command(bench->robot, bench->simulator);
    command.seq = command.state_seq = state.seq;
    if (bench->spoil_seq == state.seq) command.kp[0] = -1.0;
    bench->lcm.publish("JOINT_COMMAND", &command);
  }
  static void on_other(const lcm::ReceiveBuffer* buffer, const std::string& channel, Bench* bench) {
    const auto* data = static_cast<const std::uint8_t*>(buffer->data);
    bench->order.push_back(channel);
    bench->others[channel].emplace_back(data, data + buffer->data_size);
  }
  void drain() {
    while (lcm.handleTimeout(1) > 0) {
    }
  }

  config::RobotDescription robot;
  Scenario scenario;
  SimulatorOptions options;
  lcm::LCM lcm;
  Simulator simulator;
  Node node;
  std::atomic<bool> stop{false};
  std::vector<Bytes> states;
  std::vector<std::string> order;
  std::map<std::string, std::vector<Bytes>> others;
  std::int64_t silent_from = 0;  // ignores states from this one on, `ignore` times
  int ignore = 1 << 30;
  int ignored = 0;
  std::int64_t spoil_seq = 0;  // answers this state with a command that must be refused
};

constexpr LockstepTiming kShort{.repeat = 0.02, .silence = 0.2, .first_answer = 0.3};

}  // namespace

TEST_CASE("LockstepAdvancesWithEachAnswer") {
  Bench bench;
  const NodeReport report = bench.node.run_lockstep(50, kShort, bench.stop);
  bench.drain();
  CHECK(report.ending == Ending::kCompleted);
  CHECK(report.times_damped == 0);
  CHECK(bench.simulator.state().seq == 51);
  CHECK(bench.states.size() == 50);
  CHECK(bench.others["TRUTH"].size() == 51);
  CHECK(bench.others["USER_COMMAND"].size() == 5);  // every 10 periods
  CHECK(bench.simulator.refused().total() == 0);
}

TEST_CASE("AnInstantsMessagesComeInOrder") {
  Bench bench;
  static_cast<void>(bench.node.run_lockstep(2, kShort, bench.stop));
  bench.drain();
  REQUIRE(bench.order.size() >= 5);
  CHECK(bench.order[0] == "RUN_INFO_SIMULATOR");
  CHECK(bench.order[1] == "USER_COMMAND");
  CHECK(bench.order[2] == "ROBOT_STATE");
  CHECK(bench.order[3] == "TRUTH");
  CHECK(bench.order[4] == "ROBOT_STATE");
}

TEST_CASE("LockstepTwiceGivesTheSameBytes") {
  Bench first, second;
  static_cast<void>(first.node.run_lockstep(40, kShort, first.stop));
  static_cast<void>(second.node.run_lockstep(40, kShort, second.stop));
  first.drain();
  second.drain();
  CHECK(first.states == second.states);
  CHECK(first.others["TRUTH"] == second.others["TRUTH"]);
}

TEST_CASE("AnUnansweredStateIsSentAgainUnchangedUntilSilenceEndsTheRun") {
  Bench bench;
  bench.silent_from = 5;
  const std::int64_t start = platform::monotonic_ns();
  const NodeReport report = bench.node.run_lockstep(50, kShort, bench.stop);
  const double seconds = static_cast<double>(platform::monotonic_ns() - start) * 1e-9;
  bench.drain();
  CHECK(report.ending == Ending::kSilence);
  CHECK(seconds >= kShort.silence);
  CHECK(bench.simulator.state().seq == 5);
  REQUIRE(bench.states.size() > 7);
  for (std::size_t i = 5; i < bench.states.size(); ++i) CHECK(bench.states[i] == bench.states[4]);
}

TEST_CASE("ALateAnswerGoesOnAsIfNothingHadHappened") {
  Bench bench, prompt;
  bench.silent_from = 5;
  bench.ignore = 3;
  CHECK(bench.node.run_lockstep(20, kShort, bench.stop).ending == Ending::kCompleted);
  CHECK(prompt.node.run_lockstep(20, kShort, prompt.stop).ending == Ending::kCompleted);
  CHECK(bench.ignored == 3);
  bench.drain();
  prompt.drain();
  CHECK(bench.others["TRUTH"] == prompt.others["TRUTH"]);
}

TEST_CASE("NobodyAtTheStartEndsTheRunAfterTheLongerWait") {
  Bench bench;
  bench.silent_from = 1;
  const std::int64_t start = platform::monotonic_ns();
  CHECK(bench.node.run_lockstep(50, kShort, bench.stop).ending == Ending::kSilence);
  CHECK(static_cast<double>(platform::monotonic_ns() - start) * 1e-9 >= kShort.first_answer);
}

TEST_CASE("ARefusedAnswerCountsAndTheRunGoesOn") {
  Bench bench;
  bench.spoil_seq = 7;
  CHECK(bench.node.run_lockstep(20, kShort, bench.stop).ending == Ending::kCompleted);
  CHECK(bench.simulator.refused().not_finite == 1);
}

TEST_CASE("StopEndsARunBetweenInstants") {
  Bench bench;
  bench.stop = true;
  CHECK(bench.node.run_lockstep(20, kShort, bench.stop).ending == Ending::kStopped);
  CHECK(bench.node.run_real_time(20, platform::monotonic_ns(), bench.stop).ending == Ending::kStopped);
}

TEST_CASE("ARealTimeRunWithEveryCommandOnTimeEqualsLockstep") {
  const std::int64_t start_utime = platform::monotonic_ns() / 1000 + 20'000;
  Bench real_time(start_utime), lockstep(start_utime);
  constexpr int periods = 60;
  const NodeReport report = real_time.node.run_real_time(periods, start_utime * 1000, real_time.stop);
  CHECK(report.ending == Ending::kCompleted);
  const double seconds = static_cast<double>(platform::monotonic_ns() - start_utime * 1000) * 1e-9;
  CHECK(seconds >= (periods - 1) * kControlPeriod);
  static_cast<void>(lockstep.node.run_lockstep(periods, kShort, lockstep.stop));
  real_time.drain();
  lockstep.drain();
  REQUIRE(real_time.states.size() == periods);
  CHECK(real_time.states == lockstep.states);
  CHECK(real_time.others["TRUTH"] == lockstep.others["TRUTH"]);
}

TEST_CASE("ARealTimeRunNeverWaitsForACommand") {
  const std::int64_t start_utime = platform::monotonic_ns() / 1000 + 1'000;
  Bench bench(start_utime);
  bench.silent_from = 11;
  const NodeReport report = bench.node.run_real_time(30, start_utime * 1000, bench.stop);
  CHECK(report.ending == Ending::kCompleted);
  CHECK(report.times_damped == 1);
  CHECK(bench.simulator.state().seq == 31);
  CHECK(bench.simulator.truth().drives_damped == 1);
}

TEST_CASE("RunInfoHoldsEverythingThatARunNeeds") {
  Bench bench;
  static_cast<void>(bench.node.run_lockstep(1, kShort, bench.stop));
  bench.drain();
  REQUIRE(bench.others["RUN_INFO_SIMULATOR"].size() == 1);
  const Bytes& bytes = bench.others["RUN_INFO_SIMULATOR"].front();
  stance_msgs::run_info_t info;
  REQUIRE(info.decode(bytes.data(), 0, static_cast<int>(bytes.size())) == static_cast<int>(bytes.size()));
  CHECK(info.program == "stance-sim");
  CHECK(info.robot == "biped");
  CHECK(info.run_id == 11);
  CHECK(info.seed == 3);
  CHECK(info.options == "--robot biped");
  CHECK(info.urdf == bench.robot.urdf_text);
  CHECK(info.configuration == bench.robot.yaml_text);
  CHECK(info.scenario == bench.scenario.text);
  CHECK(info.input_hash.size() == 16);
  CHECK_FALSE(info.version.empty());
  CHECK_FALSE(info.source.empty());
  CHECK_FALSE(info.build.empty());
}

TEST_CASE("APushMessageReachesTheRobot") {
  Bench bench;
  stance_msgs::push_t push{};
  push.run_id = 11;
  push.duration = 0.1;
  push.force_W[1] = 10.0;
  bench.lcm.publish("PUSH", &push);
  static_cast<void>(bench.node.run_lockstep(5, kShort, bench.stop));
  CHECK(std::abs(bench.simulator.truth().push_W[1] - 10.0) < 1e-9);
}

}  // namespace stance::sim
