#include "controller/loop/ticker.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <set>
#include <stance_msgs/controller_trace_t.hpp>
#include <stance_msgs/force_plan_t.hpp>
#include <stance_msgs/joint_command_t.hpp>
#include <stance_msgs/stop_t.hpp>
#include <vector>

#include "controller/loop/wall_clock.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::loop {
namespace {

using stance_msgs::controller_trace_t;
using test::Answer;
using test::answer_of;
using test::bytes_of;
using test::ByteVector;
using test::decoded;

constexpr std::int64_t kRun = 7;

ByteVector state(std::int64_t seq, std::int64_t run_id = kRun) {
  stance_msgs::robot_state_t message{};
  message.utime = seq * 10'000;
  message.seq = seq;
  message.run_id = run_id;
  return bytes_of(message);
}
ByteVector user_command(std::int64_t seq, double height_offset = 0.0) {
  stance_msgs::user_command_t message{};
  message.seq = seq;
  message.height_offset = height_offset;
  return bytes_of(message);
}
ByteVector stop(std::int64_t seq) {
  stance_msgs::stop_t message{};
  message.seq = seq;
  return bytes_of(message);
}

/// A ticker whose robot only notes what it is given.
struct Bench {
  const TickInput& tick(int periods = 1) {
    ticker.tick(periods, clock);
    trace = decoded<controller_trace_t>(ticker.trace().bytes());
    return inputs.back();
  }
  const TickInput& tick_with(const ByteVector& bytes) {
    REQUIRE(ticker.offer_state(bytes));
    return tick();
  }

  std::vector<TickInput> inputs;
  NoClock clock;
  Ticker ticker{
      Controller{[this](const TickInput& input, StageClock&, TickOutput&) { inputs.push_back(input); }, {kForcePlan}}};
  controller_trace_t trace{};
};

}  // namespace

TEST_CASE_METHOD(Bench, "ATickIsGivenTheNewestMessages") {
  REQUIRE(ticker.offer_state(state(1)));
  REQUIRE(ticker.offer_user_command(user_command(4, 0.1)));
  REQUIRE(ticker.offer_state(state(2)));
  REQUIRE(ticker.offer_user_command(user_command(5, 0.2)));
  CHECK(ticker.has_new_state());
  const TickInput& input = tick();
  CHECK(input.state.seq == 2);
  CHECK(input.state_is_new);
  CHECK(input.periods == 1);
  CHECK(input.user_command.seq == 5);
  CHECK(input.user_command.height_offset == 0.2);
  CHECK_FALSE(input.operator_stop);
  CHECK_FALSE(ticker.has_new_state());
}

TEST_CASE_METHOD(Bench, "AStateIsNewOnce") {
  CHECK(tick_with(state(1)).state_is_new);
  CHECK_FALSE(tick().state_is_new);
  CHECK(tick().state.seq == 1);
  CHECK(tick_with(state(2)).state_is_new);
}

TEST_CASE_METHOD(Bench, "EveryMessageNamesItsTickItsStateAndItsRun") {
  tick_with(state(41));
  tick_with(state(42));
  const auto check = [&](const auto& message) {
    CHECK(message.seq == 2);
    CHECK(message.state_seq == 42);
    CHECK(message.run_id == kRun);
    CHECK(message.utime == 420'000);
  };
  check(decoded<stance_msgs::joint_command_t>(ticker.command().bytes()));
  check(decoded<stance_msgs::force_plan_t>(ticker.published().front().message.bytes()));
  check(trace);
  check(ticker.header());
  CHECK(trace.state_is_new == 1);
}

TEST_CASE_METHOD(Bench, "WithoutANewStateTimeGoesOnByThePeriods") {
  tick_with(state(1));
  tick();
  CHECK(trace.utime == 20'000);
  CHECK(trace.state_seq == 1);
  CHECK(trace.state_is_new == 0);
  CHECK(tick(3).periods == 3);
  CHECK(trace.utime == 50'000);
  CHECK(trace.periods == 3);
  tick_with(state(9));
  CHECK(trace.utime == 90'000);
}

TEST_CASE_METHOD(Bench, "TheTraceNamesTheUserCommandAndTheStopThatAreInForce") {
  tick_with(state(1));
  CHECK(trace.user_command_seq == 0);
  CHECK(trace.stop_seq == 0);
  REQUIRE(ticker.offer_user_command(user_command(5)));
  REQUIRE(ticker.offer_stop(stop(6)));
  CHECK(tick_with(state(2)).operator_stop);
  CHECK(trace.user_command_seq == 5);
  CHECK(trace.stop_seq == 6);
  CHECK(tick_with(state(3)).operator_stop);
  CHECK(trace.user_command_seq == 5);
  CHECK(trace.stop_seq == 6);
}

TEST_CASE_METHOD(Bench, "AStopAndAUserCommandThatATickTookEndWithTheirRun") {
  REQUIRE(ticker.offer_user_command(user_command(5)));
  REQUIRE(ticker.offer_stop(stop(6)));
  tick_with(state(1));
  CHECK(trace.stop_seq == 6);
  const TickInput& input = tick_with(state(1, kRun + 1));
  CHECK_FALSE(input.operator_stop);
  CHECK(input.user_command.seq == 0);
  CHECK(trace.user_command_seq == 0);
  CHECK(trace.stop_seq == 0);
}

TEST_CASE_METHOD(Bench, "AStopAndAUserCommandThatComeBeforeARunsFirstStateAreOfThatRun") {
  REQUIRE(ticker.offer_user_command(user_command(5)));
  REQUIRE(ticker.offer_stop(stop(6)));
  CHECK(tick_with(state(1)).operator_stop);
  CHECK(inputs.back().user_command.seq == 5);
  CHECK(trace.stop_seq == 6);

  REQUIRE(ticker.offer_user_command(user_command(1, 0.3)));
  REQUIRE(ticker.offer_stop(stop(2)));
  CHECK(tick_with(state(1, kRun + 1)).operator_stop);
  CHECK(inputs.back().user_command.height_offset == 0.3);
  CHECK(trace.user_command_seq == 1);
  CHECK(trace.stop_seq == 2);
}

TEST_CASE_METHOD(Bench, "ASenderThatCountsFromOneAgainStartsARunUnderTheSameIdWhichUndoesNoStop") {
  REQUIRE(ticker.offer_user_command(user_command(5)));
  REQUIRE(ticker.offer_stop(stop(6)));
  for (const std::int64_t seq : {1, 1, 2, 2}) {  // a repeated one starts none
    CHECK(tick_with(state(seq)).operator_stop);
    CHECK(trace.user_command_seq == 5);
  }
  CHECK(tick_with(state(1)).operator_stop);
  CHECK(trace.stop_seq == 6);
  CHECK(trace.user_command_seq == 0);
}

TEST_CASE_METHOD(Bench, "BytesThatAreNoMessageAreRefusedAndChangeNothing") {
  Bench undisturbed;
  tick_with(state(1));
  undisturbed.tick_with(state(1));
  ByteVector torn = state(2, kRun + 1);
  torn.pop_back();
  const ByteVector garbage(100, 0x55);
  for (const ByteVector& bytes : {torn, garbage, ByteVector{}}) {
    CHECK_FALSE(ticker.offer_state(bytes));
    CHECK_FALSE(ticker.offer_user_command(bytes));
    CHECK_FALSE(ticker.offer_stop(bytes));
  }
  CHECK_FALSE(ticker.offer_state(stop(1)));
  CHECK_FALSE(ticker.offer_user_command(state(1)));
  CHECK_FALSE(ticker.offer_stop(user_command(1)));
  CHECK_FALSE(ticker.has_new_state());
  tick();
  undisturbed.tick();
  CHECK(answer_of(ticker) == answer_of(undisturbed.ticker));
}

TEST_CASE("TheHashCoversEveryByteThatATickConsumedAndNothingElse") {
  const auto hash_of = [](const ByteVector& before, const ByteVector& state_bytes, const ByteVector& command,
                          const ByteVector& stop_bytes) {
    Bench bench;
    bench.tick_with(before);
    if (!state_bytes.empty()) REQUIRE(bench.ticker.offer_state(state_bytes));
    if (!command.empty()) REQUIRE(bench.ticker.offer_user_command(command));
    if (!stop_bytes.empty()) REQUIRE(bench.ticker.offer_stop(stop_bytes));
    bench.tick();
    return bench.trace.consumed_hash;
  };
  const std::int64_t all = hash_of(state(1), state(2), user_command(3), stop(4));
  CHECK(hash_of(state(1), state(2), user_command(3), stop(4)) == all);
  CHECK(hash_of(state(0), state(2), user_command(3), stop(4)) == all);  // an earlier tick's
  std::set<std::int64_t> different{all};
  CHECK(different.insert(hash_of(state(1), {}, {}, {})).second);
  CHECK(different.insert(hash_of(state(1), state(2), {}, {})).second);
  CHECK(different.insert(hash_of(state(1), state(2), user_command(3), {})).second);
  CHECK(different.insert(hash_of(state(1), state(2), {}, stop(4))).second);
  CHECK(different.insert(hash_of(state(1), {}, user_command(3), stop(4))).second);
  CHECK(different.insert(hash_of(state(1), state(2), user_command(3), stop(5))).second);
  CHECK(different.insert(hash_of(state(1), state(2), user_command(4), stop(4))).second);
  constexpr std::size_t fingerprint = 8;
  ByteVector changed = state(2);
  for (std::size_t i = fingerprint; i < changed.size(); ++i) {
    changed[i] ^= 1;
    CHECK(different.insert(hash_of(state(1), changed, user_command(3), stop(4))).second);
    changed[i] ^= 1;
  }
}

TEST_CASE("ATickIsGivenItsTimeLeftWhichItsHashCovers") {
  std::set<std::int64_t> different;
  for (const std::int32_t time_left : {kWholePeriodUs, 9'500, 500, 0}) {
    Bench bench;
    REQUIRE(bench.ticker.offer_state(state(1)));
    bench.ticker.tick(1, bench.clock, time_left);
    CHECK(bench.inputs.back().time_left == 1e-6 * time_left);
    CHECK(different.insert(decoded<controller_trace_t>(bench.ticker.trace().bytes()).consumed_hash).second);
  }
  Bench untold;
  untold.tick_with(state(1));
  CHECK(untold.inputs.back().time_left == kControlPeriod);
  CHECK_FALSE(different.insert(untold.trace.consumed_hash).second);
}

TEST_CASE("TheTimeLeftIsRoundedDownToItsGridWithinAPeriod") {
  CHECK(time_left_us(-1) == 0);
  CHECK(time_left_us(499'999) == 0);
  CHECK(time_left_us(500'000) == 500);
  CHECK(time_left_us(9'999'999) == 9'500);
  CHECK(time_left_us(10'000'000) == 10'000);
  CHECK(time_left_us(12'000'000) == 10'000);
}

TEST_CASE("TheSameSequenceGivesTheSameBytes") {
  sim::Scenario scenario = test::quiet_stand();
  scenario.pushes = {test::push(0.1, 5.0, 30.0, 0.0)};
  const std::vector<ByteVector> states = test::recorded_states(scenario, 60, kRun);
  const auto answers = [&] {
    Ticker ticker(compose(test::biped()));
    NoClock clock;
    std::vector<Answer> all;
    for (std::size_t k = 0; k < states.size(); ++k) {
      if (k == 5) REQUIRE(ticker.offer_user_command(user_command(1, -0.02)));
      if (k == 50) REQUIRE(ticker.offer_stop(stop(1)));
      if (k != 30) REQUIRE(ticker.offer_state(states[k]));
      ticker.tick(k == 31 ? 2 : 1, clock);
      all.push_back(answer_of(ticker));
    }
    return all;
  };
  const std::vector<Answer> first = answers();
  CHECK(first == answers());
  CHECK(decoded<stance_msgs::joint_command_t>(first[49].command).mode == 0);
  CHECK(decoded<stance_msgs::joint_command_t>(first[50].command).mode == 1);
}

TEST_CASE("AnyStampIsTakenAsItComes") {
  for (const std::int64_t utime :
       {std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
    Bench bench;
    auto message = decoded<stance_msgs::robot_state_t>(state(1));
    message.utime = utime;
    bench.tick_with(bytes_of(message));
    CHECK(bench.trace.utime == utime);
    bench.tick();
    CHECK(bench.trace.seq == 2);
  }
}

TEST_CASE("PeriodsBetweenStampsAreRoundedAndAtLeastOne") {
  CHECK(periods_between(0, 10'000) == 1);
  CHECK(periods_between(0, 14'900) == 1);
  CHECK(periods_between(0, 15'100) == 2);
  CHECK(periods_between(1'000'000, 1'050'000) == 5);
  CHECK(periods_between(0, 0) == 1);
  CHECK(periods_between(50'000, 10'000) == 1);
  constexpr auto least = std::numeric_limits<std::int64_t>::min(), most = std::numeric_limits<std::int64_t>::max();
  CHECK(periods_between(least, most) == 1'000'000);
  CHECK(periods_between(most, least) == 1);
}

}  // namespace stance::loop
