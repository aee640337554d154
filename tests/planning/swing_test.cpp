#include "controller/planning/swing.hpp"

#include <algorithm>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>

#include "tests/planning/planning_fixture.hpp"

namespace stance::planning {
namespace {

constexpr double kDt = 0.01, kTime = 0.2;
const SwingConfig& config() { return test::walk_config().gait.swing; }

}  // namespace

TEST_CASE("AFootRisesOverItsWayAndEndsAtItsFoothold") {
  constexpr double tolerance = 1e-3;  // m
  const Vector3 start(0.1, 0.2, 0.02);
  const Vector2 foothold(0.5, 0.3);
  const double ground = 0.05;
  Swing swing(config());
  swing.lift_off(start);
  double highest = 0.0, last_phase = 0.0;
  SwingReference last = swing.reference();
  for (double t = 0.0; t < kTime - 1e-9; t += kDt) {
    swing.step(foothold, ground, kTime - t, kDt);
    const SwingReference& now = swing.reference();
    CHECK(swing.phase() > last_phase);
    // The path goes on as its velocities say.
    CHECK((now.p - last.p - 0.5 * kDt * (now.v + last.v)).norm() < 3.0 * tolerance);
    highest = std::max(highest, now.p.z());
    last_phase = swing.phase();
    last = now;
  }
  CHECK(std::abs(swing.phase() - 1.0) < 1e-9);
  CHECK(std::abs(highest - ground - config().height) < 0.1 * config().height);
  CHECK((last.p.head<2>() - foothold).norm() < tolerance);
  CHECK(std::abs(last.p.z() - ground + config().depth) < tolerance);
}

TEST_CASE("AFootholdThatMovesIsReachedToo") {
  Swing swing(config());
  swing.lift_off({0.0, 0.1, 0.02});
  Vector2 foothold(0.1, 0.1);
  for (double t = 0.0; t < kTime - 1e-9; t += kDt) {
    if (t > 0.09) foothold = {0.25, 0.2};
    swing.step(foothold, 0.02, kTime - t, kDt);
  }
  CHECK((swing.reference().p.head<2>() - foothold).norm() < 5e-3);
}

TEST_CASE("AFootThatFindsNoGroundGoesOnDownToALimit") {
  Swing swing(config());
  const Vector2 foothold(0.0, 0.1);
  swing.lift_off({0.0, 0.1, 0.02});
  for (double t = 0.0; t < kTime - 1e-9; t += kDt) swing.step(foothold, 0.02, kTime - t, kDt);
  const double before = swing.reference().p.z();
  swing.step(foothold, 0.02, 0.0, kDt);
  CHECK(std::abs(swing.reference().p.z() - before + config().late_speed * kDt) < 1e-9);
  for (int k = 0; k < 100; ++k) swing.step(foothold, 0.02, 0.0, kDt);
  CHECK(std::abs(swing.reference().p.z() - 0.02 + config().late_depth) < 1e-9);
  CHECK(swing.reference().p.allFinite());
}

}  // namespace stance::planning
