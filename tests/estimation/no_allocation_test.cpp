// The estimator's step takes no memory: malloc itself is watched, since Eigen's own guard sees only Eigen.
#include <catch2/catch_test_macros.hpp>
#include <cstddef>

#include "controller/estimation/base_estimator.hpp"
#include "controller/estimation/com_offset_observer.hpp"
#include "tests/estimation/simulated_robot.hpp"

namespace {
thread_local bool watching = false;
thread_local std::size_t allocations = 0;
}  // namespace

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  allocations += watching;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  allocations += watching;
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) noexcept {
  allocations += watching;
  return __libc_realloc(pointer, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  allocations += watching;
  return __libc_memalign(alignment, size);
}
}

namespace stance::estimation::test {

TEST_CASE("WatchSeesAnAllocation") {
  allocations = 0;
  watching = true;
  int* volatile number = new int(1);
  watching = false;
  delete number;
  CHECK(allocations == 1);
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
  BaseEstimator estimator(recommended_config(), test_legs(), kFootRadius);
  CentreOfMassOffsetObserver observer({2.0, 0.04}, 13.2, kFootRadius);
  BaseEstimate estimate;
  CentreOfMassOffsetInput input;
  input.standing = true;
  allocations = 0;
  for (int k = 0; k < 300; ++k) {
    const RobotState& state = robot.next();
    watching = true;
    estimator.step(state, {}, estimate);
    input.p_WC = estimate.p_WB;
    input.p_WF = {estimate.p_WF[0], estimate.p_WF[1]};
    observer.step(input, 0.01);
    watching = false;
  }
  CHECK(allocations == 0);
}

}  // namespace stance::estimation::test
