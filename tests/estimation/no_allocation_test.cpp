// The estimator's step takes no memory: malloc itself is watched, since Eigen's own guard sees only Eigen.
#include <catch2/catch_test_macros.hpp>

#include "controller/estimation/ball_filter.hpp"
#include "tests/estimation/simulated_robot.hpp"
#include "tests/support/heap_calls.hpp"

namespace stance::estimation::test {

using stance::test::heap_calls;

TEST_CASE("HeapCallsAreCounted") {
  const long before = heap_calls;
  int* volatile number = new int(1);
  delete number;
  const long calls = heap_calls - before;
  CHECK(calls == 2);
}

TEST_CASE("StepTakesNoMemory") {
  Motion motion = standing_motion();
  // The left foot swings, the right one slips, and both stand.
  motion.foot = [](double t, int foot) {
    FootMotion result;
    if (foot == 0 && t > 1.0 && t < 1.3) result.contact = false;
    if (foot == 1 && t > 2.0 && t < 2.3) result.velocity.x() = 0.3;
    return result;
  };
  SimulatedRobot robot(motion, consumer_sensors(), 1);
  BaseEstimator estimator = shipped_estimator();
  CentreOfMassOffsetObserver observer = shipped_offset_observer();
  BaseEstimate estimate;
  CentreOfMassOffsetInput input;
  input.standing = true;
  long calls = 0;
  for (int k = 0; k < 300; ++k) {
    const RobotState& state = robot.next();
    const long before = heap_calls;
    estimator.step(state, {}, estimate);
    input.p_WC = estimate.p_WB;
    input.p_WF = {estimate.p_WF[0], estimate.p_WF[1]};
    observer.step(input, 0.01);
    calls += heap_calls - before;
  }
  CHECK(calls == 0);
}

TEST_CASE("BallFilterTakesNoMemory") {
  BallFilterConfig config;
  config.measurement_sigma = 0.01;
  config.velocity_sigma = 4.0;
  config.drag_sigma = 0.015;
  BallFilter<7> filter(config);
  const long before = heap_calls;
  for (int k = 0; k < 50; ++k) filter.step(0.01, Vector3(3.0 - 0.04 * k, 0.0, 1.0));
  const auto ahead = filter.predict(0.3);
  const long calls = heap_calls - before;
  CHECK(calls == 0);
  CHECK(ahead.x.allFinite());
}

}  // namespace stance::estimation::test
