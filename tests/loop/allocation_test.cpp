// A whole tick, decode and encode included, takes no memory on its thread.
#include <array>
#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <stance_msgs/stop_t.hpp>
#include <vector>

#include "tests/loop/arm3_rig.hpp"
#include "tests/support/heap_calls.hpp"

namespace stance::test {

TEST_CASE("HeapCallsAreCounted") {
  const long before = heap_calls;
  const volatile std::size_t size = 1000;  // so that the compiler cannot do without
  const std::vector<double> block(size);
  CHECK(block.size() == size);
  CHECK(heap_calls > before);
}

TEST_CASE("AThousandTicksWithPushesAndFaultsMakeNoHeapCall") {
  constexpr int warm_up = 100, ticks = 1000;
  sim::Scenario scenario = quiet_stand();
  for (const double time : {1.5, 4.5, 7.5}) scenario.pushes.push_back(push(time, 5.0, 30.0, 0.0));
  const std::vector<ByteVector> states = recorded_states(scenario, warm_up + ticks, 7);
  auto invalid = decoded<stance_msgs::robot_state_t>(states[300]);
  invalid.gyro[0][0] = std::numeric_limits<double>::quiet_NaN();
  const ByteVector invalid_state = bytes_of(invalid);
  stance_msgs::user_command_t wish{};
  wish.seq = 1;
  wish.height_offset = -0.01;
  const ByteVector command = bytes_of(wish);
  const ByteVector stop = bytes_of(stance_msgs::stop_t{});

  for (const char* engine : {"structured", "osqp-condensed", "osqp-sparse"}) {
    const config::RobotDescription robot = biped_with("controller.force_qp.engine", engine);
    loop::Ticker ticker(compose(robot));
    loop::WallClock clock;
    std::array<int, 4> ticks_in_mode{};
    long before = 0;
    int refused = 0, iterations = 0;
    for (std::size_t k = 0; k < states.size(); ++k) {
      if (k == warm_up) before = heap_calls;
      clock.start();
      if (k == 200) refused += !ticker.offer_user_command(command);
      if (k == 1050) refused += !ticker.offer_stop(stop);
      if (k == 300) {
        refused += !ticker.offer_state(invalid_state);
      } else if (k != 400) {
        refused += !ticker.offer_state(states[k]);
      }
      ticker.tick(1, clock);
      clock.finish();
      const Trace& trace = ticker.output().trace;
      iterations += trace.qp_iterations;
      ++ticks_in_mode[static_cast<std::size_t>(trace.safety)];
    }
    const long after = heap_calls;
    CHECK(after == before);
    CHECK(refused == 0);
    CHECK(iterations > 0);
    CHECK(ticks_in_mode[1] == 2);   // hold, at 300 and 400
    CHECK(ticks_in_mode[2] == 50);  // damp, from 1050 on
  }
}

TEST_CASE("ThreeThousandTicksOfAnArmMakeNoHeapCall") {
  constexpr int warm_up = 100, ticks = 3000;
  sim::Scenario scenario = sim::load_scenario(arm3(), "demo", 1);
  Arm3Rig rig(scenario);
  std::vector<ByteVector> states, commands;
  for (int k = 0; k < ticks; ++k) {
    const auto* command = rig.simulator.user_command();
    commands.push_back(command != nullptr ? bytes_of(*command) : ByteVector{});
    if (command != nullptr) static_cast<void>(rig.ticker.offer_user_command(commands.back()));
    states.push_back(bytes_of(rig.state()));
    rig.tick();
  }
  loop::Ticker ticker(compose(arm3()));
  loop::WallClock clock;
  long before = 0;
  int refused = 0, playing = 0, damped = 0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    if (k == warm_up) before = heap_calls;
    clock.start();
    if (!commands[k].empty()) refused += !ticker.offer_user_command(commands[k]);
    if (k < 2000 || k > 2010) refused += !ticker.offer_state(states[k]);  // a gap: hold and damp
    ticker.tick(1, clock);
    clock.finish();
    playing += ticker.output().arm3_motion.step > 0;
    damped += ticker.output().trace.safety == SafetyMode::kDamp;
  }
  const long after = heap_calls;
  CHECK(after == before);
  CHECK(refused == 0);
  CHECK(playing > 1700);
  CHECK(damped > 0);
}

}  // namespace stance::test
