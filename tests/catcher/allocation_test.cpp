// The catcher's whole tick, decode and encode included, takes no memory on its thread.
#include <catch2/catch_test_macros.hpp>
#include <vector>

#include "tests/catcher/rig.hpp"
#include "tests/support/heap_calls.hpp"

namespace stance::test {

TEST_CASE("CalibratingCatchingAndReturningMakeNoHeapCall") {
  struct Told {
    std::vector<std::uint8_t> state, ball, points, command;
  };
  std::vector<Told> told;
  {
    CatcherRig rig(sim::load_scenario(catcher(), "throw", 2));
    while (rig.simulator.time() < 2.2) {
      Told now;
      now.state = io::bytes_of(rig.simulator.state());
      if (const auto* ball = rig.simulator.ball_observation()) now.ball = io::bytes_of(*ball);
      if (const auto* points = rig.simulator.calibration_points()) now.points = io::bytes_of(*points);
      if (const auto* command = rig.simulator.user_command()) now.command = io::bytes_of(*command);
      told.push_back(now);
      rig.tick();
    }
  }
  loop::Ticker ticker(compose(catcher()));
  loop::WallClock clock;
  int refused = 0, catching = 0, holding = 0;
  const long before = heap_calls;
  for (const Told& now : told) {
    clock.start();
    if (!now.command.empty()) refused += !ticker.offer_user_command(now.command);
    if (!now.points.empty()) refused += !ticker.offer_calibration(now.points);
    if (!now.ball.empty()) refused += !ticker.offer_ball(now.ball);
    refused += !ticker.offer_state(now.state);
    ticker.tick(1, clock);
    clock.finish();
    const CatchPhase phase = ticker.output().catching.phase;
    catching += phase == CatchPhase::kCatching;
    holding += phase == CatchPhase::kHolding;
  }
  CHECK(heap_calls == before);
  CHECK(refused == 0);
  CHECK(catching > 20);
  CHECK(holding > 50);
}

}  // namespace stance::test
