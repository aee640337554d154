// The two loops over LCM in memory: the same transport carries both sides, and its handlers run where the loop
// receives.
#include <algorithm>
#include <atomic>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <stance_msgs/controller_timing_t.hpp>
#include <stance_msgs/controller_trace_t.hpp>
#include <stance_msgs/force_plan_t.hpp>
#include <stance_msgs/joint_command_t.hpp>
#include <stance_msgs/stop_t.hpp>
#include <stance_msgs/tick_input_t.hpp>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "controller/loop/loop.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::loop {
namespace {

using stance_msgs::controller_timing_t;
using stance_msgs::controller_trace_t;
using stance_msgs::force_plan_t;
using stance_msgs::joint_command_t;
using test::Answer;
using test::answer_of;
using test::bytes_of;
using test::ByteVector;
using test::decoded;

constexpr std::int64_t kRun = 7;
constexpr auto kPeriod = std::chrono::milliseconds(10);
constexpr double kClockRounding = 1e-6;               // us
constexpr double kStampStep = 1.0;                    // us, of start stamps
constexpr auto kPatience = std::chrono::seconds(60);  // for what should take a second, also under a sanitizer

/// Raises `stop` after kPatience, so that a loop that hangs fails its test.
class Watchdog {
 public:
  explicit Watchdog(std::atomic<bool>& stop)
      : thread_([&stop, this](const std::stop_token& token) {
          std::unique_lock lock(mutex_);
          if (!wake_.wait_for(lock, token, kPatience, [&] { return token.stop_requested(); })) stop = true;
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

/// A controller on memory's LCM, and all that it published.
struct Bench {
  explicit Bench(Controller controller = compose(test::biped())) : ticker(std::move(controller)) {
    for (const char* name : {io::channel::kForcePlan, io::channel::kJointCommand, io::channel::kTrace,
                             io::channel::kTiming, io::channel::kTickInput, io::channel::kRunInfo}) {
      transport.subscribe(name, [this, name](io::Bytes bytes) {
        order.emplace_back(name);
        published[name].emplace_back(bytes.begin(), bytes.end());
        const auto reaction = reactions.find(name);
        if (reaction != reactions.end()) reaction->second();
      });
    }
  }
  /// `reaction` runs within the handler of each message of the channel. Only before the loop starts.
  void on(const char* channel, std::function<void()> reaction) { reactions[channel] = std::move(reaction); }
  void send(const char* channel, const ByteVector& bytes) { static_cast<void>(transport.publish(channel, bytes)); }
  void send_state(const ByteVector& bytes) { send(io::channel::kRobotState, bytes); }

  template <typename Lcm>
  std::vector<Lcm> all(const char* channel) const {
    std::vector<Lcm> messages;
    const auto found = published.find(channel);
    if (found == published.end()) return messages;
    for (const ByteVector& bytes : found->second) messages.push_back(decoded<Lcm>(bytes));
    return messages;
  }
  std::size_t count(const char* channel) const {
    const auto found = published.find(channel);
    return found == published.end() ? 0 : found->second.size();
  }
  Answer answer(std::size_t index) const {
    return {published.at(io::channel::kForcePlan).at(index), published.at(io::channel::kJointCommand).at(index),
            published.at(io::channel::kTrace).at(index)};
  }

  io::Transport transport{"memq://"};
  Ticker ticker;
  std::atomic<bool> stop{false};
  ByteVector run_info{1, 2, 3};
  std::map<std::string, std::function<void()>> reactions;
  std::map<std::string, std::vector<ByteVector>> published;
  std::vector<std::string> order;
};

std::vector<Answer> rollout(const std::vector<ByteVector>& states) {
  Ticker ticker(compose(test::biped()));
  NoClock clock;
  std::vector<Answer> answers;
  for (const ByteVector& state : states) {
    REQUIRE(ticker.offer_state(state));
    ticker.tick(1, clock);
    answers.push_back(answer_of(ticker));
  }
  return answers;
}

ByteVector stop_message(std::int64_t seq) {
  stance_msgs::stop_t message{};
  message.seq = seq;
  return bytes_of(message);
}
ByteVector user_command(std::int64_t seq) {
  stance_msgs::user_command_t message{};
  message.seq = seq;
  message.height_offset = -0.01;
  return bytes_of(message);
}

/// Sends the states one by one, each when the last one is answered; `after_answer(k)` says whether to go on to state k.
void run_lockstep_through(Bench& bench, const std::vector<ByteVector>& states,
                          const std::function<bool(std::size_t)>& after_answer) {
  const Watchdog watchdog(bench.stop);
  std::size_t next = 0;
  bench.on(io::channel::kRunInfo, [&] {
    if (next == 0) bench.send_state(states[next++]);
  });
  bench.on(io::channel::kTrace, [&] {
    if (!after_answer(next)) return;
    if (next == states.size()) {
      bench.stop = true;
    } else {
      bench.send_state(states[next++]);
    }
  });
  run_lockstep(bench.ticker, bench.transport, bench.run_info, bench.stop);
  REQUIRE(next == states.size());
}

/// What holds of every tick's timing and of the next one's, however slow or stalled the machine.
void check_timings(const std::vector<controller_timing_t>& timings) {
  for (std::size_t k = 0; k < timings.size(); ++k) {
    CAPTURE(k);
    const controller_timing_t& timing = timings[k];
    double stages = 0.0;
    for (const double stage : timing.stage_us) {
      CHECK(stage >= 0.0);
      stages += stage;
    }
    CHECK(stages > 0.0);
    CHECK(stages <= timing.tick_us + kClockRounding);
    CHECK(timing.cpu_us >= 0.0);
    CHECK(timing.wake_latency_us >= 0.0);
    if (k == 0) {
      CHECK(timing.period_us == 0.0);
      continue;
    }
    const controller_timing_t& last = timings[k - 1];
    REQUIRE(timing.seq == last.seq + 1);
    CHECK(timing.period_us >= last.tick_us - kClockRounding);
    CHECK(std::abs(timing.period_us - static_cast<double>(timing.utime - last.utime)) <= kStampStep + kClockRounding);
  }
}

}  // namespace

TEST_CASE("LockstepAnswersEachStateOnceWithTheBytesOfARollout") {
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 100, kRun);
  Bench bench;
  run_lockstep_through(bench, states, [](std::size_t) { return true; });
  const std::vector<Answer> expected = rollout(states);
  REQUIRE(bench.count(io::channel::kTrace) == states.size());
  for (std::size_t k = 0; k < states.size(); ++k) REQUIRE(bench.answer(k) == expected[k]);
  CHECK(bench.count(io::channel::kRunInfo) >= 1);
  CHECK(bench.published.at(io::channel::kRunInfo).front() == bench.run_info);
}

TEST_CASE("LockstepPublishesThePlanBeforeTheCommandBeforeTheTrace") {
  Bench bench;
  run_lockstep_through(bench, test::recorded_states(test::quiet_stand(), 5, kRun), [](std::size_t) { return true; });
  std::vector<std::string> answers;
  for (const std::string& name : bench.order) {
    if (name != io::channel::kRunInfo && name != io::channel::kTiming) answers.push_back(name);
  }
  REQUIRE(answers.size() == 15);
  for (std::size_t k = 0; k < answers.size(); k += 3) {
    CHECK(answers[k] == io::channel::kForcePlan);
    CHECK(answers[k + 1] == io::channel::kJointCommand);
    CHECK(answers[k + 2] == io::channel::kTrace);
  }
}

TEST_CASE("InLockstepARepeatedStateGetsTheIdenticalAnswerAndTheRunGoesOn") {
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 40, kRun);
  Bench bench;
  int repeats = 0;
  run_lockstep_through(bench, states, [&](std::size_t next) {
    if (next == 20 && repeats < 3) {
      ++repeats;
      bench.send_state(states[19]);
      return false;
    }
    return true;
  });
  const std::vector<Answer> expected = rollout(states);
  REQUIRE(bench.count(io::channel::kTrace) == states.size() + 3);
  for (std::size_t k = 0; k < states.size() + 3; ++k) {
    CAPTURE(k);
    REQUIRE(bench.answer(k) == expected[k < 20 ? k : std::max<std::size_t>(k - 3, 19)]);
  }
}

TEST_CASE("InLockstepALostStateCountsAsPeriods") {
  std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 20, kRun);
  states.erase(states.begin() + 10, states.begin() + 13);
  Bench bench;
  run_lockstep_through(bench, states, [](std::size_t) { return true; });
  const auto traces = bench.all<controller_trace_t>(io::channel::kTrace);
  REQUIRE(traces.size() == 17);
  for (std::size_t k = 0; k < traces.size(); ++k) CHECK(traces[k].periods == (k == 10 ? 4 : 1));
}

TEST_CASE("InLockstepGarbageIsNotAnswered") {
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 10, kRun);
  Bench bench;
  run_lockstep_through(bench, states, [&](std::size_t) {
    bench.send_state({1, 2, 3});
    bench.send(io::channel::kUserCommand, states[0]);
    bench.send(io::channel::kStop, {});
    return true;
  });
  const std::vector<Answer> expected = rollout(states);
  REQUIRE(bench.count(io::channel::kTrace) == states.size());
  for (std::size_t k = 0; k < states.size(); ++k) REQUIRE(bench.answer(k) == expected[k]);
}

TEST_CASE("InLockstepAUserCommandAndAStopAreTakenWithTheNextState") {
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 30, kRun);
  Bench bench;
  run_lockstep_through(bench, states, [&](std::size_t next) {
    if (next == 10) bench.send(io::channel::kUserCommand, user_command(3));
    if (next == 20) bench.send(io::channel::kStop, stop_message(4));
    return true;
  });
  const auto traces = bench.all<controller_trace_t>(io::channel::kTrace);
  const auto commands = bench.all<joint_command_t>(io::channel::kJointCommand);
  REQUIRE(traces.size() == 30);
  for (std::size_t k = 0; k < 30; ++k) {
    CAPTURE(k);
    CHECK(traces[k].user_command_seq == (k < 10 ? 0 : 3));
    CHECK(traces[k].stop_seq == (k < 20 ? 0 : 4));
    CHECK(commands[k].mode == (k < 20 ? 0 : 1));
  }
}

TEST_CASE("ATickStampsEachStageItRunsOnceInTheirOrder") {
  class Recorder final : public StageClock {
   public:
    void stamp(Stage stage) noexcept override { stamps.push_back(stage); }
    std::vector<Stage> stamps;
  };
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 2, kRun);
  Ticker ticker(compose(test::biped()));
  Recorder with_state, without;
  REQUIRE(ticker.offer_state(states[0]));
  ticker.tick(1, with_state);
  ticker.tick(1, without);
  CHECK(with_state.stamps == std::vector{Stage::kDecode, Stage::kValidate, Stage::kEstimate, Stage::kPlan,
                                         Stage::kModel, Stage::kForceQp, Stage::kTorque, Stage::kSafety,
                                         Stage::kEncode});
  CHECK(without.stamps == std::vector{Stage::kDecode, Stage::kValidate, Stage::kSafety, Stage::kEncode});
}

TEST_CASE("InLockstepTimingsAddUpAndKnowNoDeadline") {
  Bench bench;
  run_lockstep_through(bench, test::recorded_states(test::quiet_stand(), 20, kRun), [](std::size_t) { return true; });
  while (bench.transport.handle(0)) continue;  // the last tick's
  const auto timings = bench.all<controller_timing_t>(io::channel::kTiming);
  REQUIRE(timings.size() == 20);
  check_timings(timings);
  for (const controller_timing_t& timing : timings) {
    CHECK(timing.wake_latency_us == 0.0);
    CHECK(timing.slack_us == 0.0);
    CHECK(timing.state_age_us == 0.0);
    CHECK(timing.missed_ticks == 0);
    CHECK(timing.dropped_states == 0);
  }
}

TEST_CASE("InRealTimeTimingsAddUpAndCountEveryMissedDeadline") {
  constexpr int num_ticks = 25;  // fewer than LCM queues
  constexpr int slow_tick = 10;
  static constexpr auto slowness = 7 * kPeriod / 2;  // three deadlines
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), num_ticks + 1, kRun);
  std::atomic<bool>* stop = nullptr;
  Controller biped = compose(test::biped());
  biped.tick = [tick = biped.tick, &stop, ticks = 0](const TickInput& input, StageClock& clock,
                                                     TickOutput& output) mutable {
    tick(input, clock, output);
    if (++ticks == slow_tick) std::this_thread::sleep_for(slowness);
    if (ticks == num_ticks) *stop = true;
  };
  Bench bench(biped);
  stop = &bench.stop;
  const Watchdog watchdog(bench.stop);
  std::size_t next = 0;
  const auto send_next = [&] {
    if (next < states.size()) bench.send_state(states[next++]);
  };
  bench.on(io::channel::kRunInfo, [&] {
    if (next == 0) send_next();
  });
  bench.on(io::channel::kTrace, send_next);
  run_real_time(bench.ticker, bench.transport, bench.run_info, {}, bench.stop);
  while (bench.transport.handle(0)) continue;  // what was published as the receiver ended

  const auto traces = bench.all<controller_trace_t>(io::channel::kTrace);
  const auto timings = bench.all<controller_timing_t>(io::channel::kTiming);
  REQUIRE(traces.size() == num_ticks);
  REQUIRE(timings.size() == num_ticks);
  check_timings(timings);
  std::int64_t missed = 0;
  for (std::size_t k = 0; k < timings.size(); ++k) {
    CAPTURE(k);
    const controller_timing_t& timing = timings[k];
    CHECK(timing.seq == traces[k].seq);
    CHECK(timing.slack_us <= 1e6 * kControlPeriod);
    // A tick that ends past the next deadline misses that and those up to its end; the next one knows how many.
    CHECK((timing.missed_ticks > missed) == (timing.slack_us < 0.0));
    if (k + 1 < timings.size()) CHECK(timing.missed_ticks - missed == traces[k + 1].periods - 1);
    if (k + 1 == slow_tick) CHECK(timing.missed_ticks - missed >= 3);
    missed = timing.missed_ticks;
  }
}

TEST_CASE("InRealTimeEveryTickNamesAStateAndAnswersComeInOrder") {
  constexpr std::size_t num_states = 30;
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), num_states, kRun);
  Bench bench;
  const Watchdog watchdog(bench.stop);
  std::atomic<std::int64_t> answered{0};
  bench.on(io::channel::kTrace,
           [&] { answered = decoded<controller_trace_t>(bench.published.at(io::channel::kTrace).back()).state_seq; });
  // A sender with the same clock as the controller, on a grid of its own.
  std::thread sender([&] {
    const auto start = std::chrono::steady_clock::now() + kPeriod;
    for (std::size_t k = 0; k < num_states; ++k) {
      const auto instant = start + kPeriod * static_cast<int>(k);
      std::this_thread::sleep_until(instant);
      auto state = decoded<stance_msgs::robot_state_t>(states[k]);
      state.utime = std::chrono::duration_cast<std::chrono::microseconds>(instant.time_since_epoch()).count();
      if (k == 10) bench.send(io::channel::kUserCommand, user_command(3));
      if (k == 20) bench.send(io::channel::kStop, stop_message(4));
      bench.send_state(bytes_of(state));
    }
    while (answered < static_cast<std::int64_t>(num_states) && !bench.stop) std::this_thread::sleep_for(kPeriod);
    bench.stop = true;
  });
  run_real_time(bench.ticker, bench.transport, bench.run_info, {}, bench.stop);
  sender.join();
  while (bench.transport.handle(0)) continue;  // what was published as the receiver ended

  const auto traces = bench.all<controller_trace_t>(io::channel::kTrace);
  const auto commands = bench.all<joint_command_t>(io::channel::kJointCommand);
  const auto plans = bench.all<force_plan_t>(io::channel::kForcePlan);
  const auto timings = bench.all<controller_timing_t>(io::channel::kTiming);
  const auto inputs = bench.all<stance_msgs::tick_input_t>(io::channel::kTickInput);
  REQUIRE_FALSE(traces.empty());
  REQUIRE(commands.size() == traces.size());
  REQUIRE(plans.size() == traces.size());
  REQUIRE(timings.size() == traces.size());
  REQUIRE(inputs.size() == traces.size());
  std::int64_t last_state = 1;
  for (std::size_t k = 0; k < traces.size(); ++k) {
    CAPTURE(k);
    const controller_trace_t& trace = traces[k];
    CHECK(trace.seq == static_cast<std::int64_t>(k + 1));
    CHECK(trace.run_id == kRun);
    CHECK(trace.state_seq >= last_state);
    CHECK(trace.state_is_new == (k == 0 || trace.state_seq > last_state ? 1 : 0));
    CHECK(trace.periods >= 1);
    for (const std::int64_t seq : {commands[k].seq, plans[k].seq, timings[k].seq, inputs[k].seq}) {
      CHECK(seq == trace.seq);
    }
    CHECK(inputs[k].time_left_us >= 0);
    CHECK(inputs[k].time_left_us <= 1e4 - timings[k].wake_latency_us);
    for (const std::int64_t seq : {commands[k].state_seq, plans[k].state_seq, timings[k].state_seq}) {
      CHECK(seq == trace.state_seq);
    }
    last_state = trace.state_seq;
  }
  CHECK(last_state == num_states);
  CHECK(traces.back().user_command_seq == 3);
  CHECK(traces.back().stop_seq == 4);
  CHECK(commands.back().mode == 1);
  CHECK(bench.count(io::channel::kRunInfo) >= 1);
}

TEST_CASE("InRealTimeATickWaitsForAStateThatIsLate") {
  constexpr std::size_t num_states = 10;
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), num_states, kRun);
  Bench bench;
  const Watchdog watchdog(bench.stop);
  std::atomic<std::size_t> answered{0};
  std::atomic<bool> listening{false};
  bench.on(io::channel::kTrace, [&] { ++answered; });
  bench.on(io::channel::kRunInfo, [&] { listening = true; });
  // Each state comes some periods after its deadline.
  std::thread sender([&] {
    while (!listening && !bench.stop) std::this_thread::sleep_for(kPeriod / 10);
    for (std::size_t k = 0; k < num_states && !bench.stop; ++k) {
      bench.send_state(states[k]);
      while (answered <= k && !bench.stop) std::this_thread::sleep_for(kPeriod / 10);
      std::this_thread::sleep_for(3 * kPeriod);
    }
    bench.stop = true;
  });
  run_real_time(bench.ticker, bench.transport, bench.run_info, {.state_wait = 2.0 * kPatience.count()}, bench.stop);
  sender.join();
  while (bench.transport.handle(0)) continue;

  const auto traces = bench.all<controller_trace_t>(io::channel::kTrace);
  REQUIRE(traces.size() >= num_states);  // and one more where it was stopped as it waited
  for (std::size_t k = 0; k < num_states; ++k) {
    CAPTURE(k);
    CHECK(traces[k].state_is_new == 1);
    CHECK(traces[k].state_seq == static_cast<std::int64_t>(k + 1));
  }
}

TEST_CASE("InRealTimeAStampFromAnotherClockIsAnsweredToo") {
  const std::vector<ByteVector> states = test::recorded_states(test::quiet_stand(), 3, kRun);
  Bench bench;
  const Watchdog watchdog(bench.stop);
  bench.on(io::channel::kRunInfo, [&] {
    for (const ByteVector& state : states) bench.send_state(state);
  });
  bench.on(io::channel::kTiming, [&] { bench.stop = bench.stop || bench.count(io::channel::kTiming) >= 5; });
  run_real_time(bench.ticker, bench.transport, bench.run_info, {}, bench.stop);
  const auto traces = bench.all<controller_trace_t>(io::channel::kTrace);
  REQUIRE(traces.size() >= 5);
  CHECK(traces[0].run_id == kRun);
  CHECK(traces[4].state_is_new == 0);
}

TEST_CASE("InRealTimeNothingIsAnsweredBeforeAStateAndItStopsAllTheSame") {
  Bench bench;
  const Watchdog watchdog(bench.stop);
  std::thread stopper([&] {
    std::this_thread::sleep_for(3 * kPeriod);
    bench.stop = true;
  });
  run_real_time(bench.ticker, bench.transport, bench.run_info, {}, bench.stop);
  stopper.join();
  CHECK(bench.count(io::channel::kJointCommand) == 0);
  CHECK(bench.count(io::channel::kTrace) == 0);
}

}  // namespace stance::loop
