#include "controller/planning/velocity.hpp"

#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <stdexcept>

#include "tests/planning/planning_fixture.hpp"

namespace stance::planning {
namespace {

constexpr double kDt = 0.01, kExact = 1e-12;

}  // namespace

TEST_CASE("TheVelocityRampsToTheCommandWithinTheLimits") {
  const VelocityConfig& c = test::walk_config().velocity;
  VelocityReference reference(c);
  reference.reset(0.3);
  Vector2 last = Vector2::Zero();
  double last_rate = 0.0;
  for (int k = 0; k < 1000; ++k) {
    reference.step({10.0, -10.0}, 10.0, reference.ramped(), reference.yaw(), false, kDt);
    CHECK((reference.ramped() - last).cwiseAbs().maxCoeff() <= c.acceleration * kDt + kExact);
    CHECK(std::abs(reference.yaw_rate() - last_rate) <= c.yaw_acceleration * kDt + kExact);
    last = reference.ramped();
    last_rate = reference.yaw_rate();
  }
  CHECK(std::abs(last.x() - c.max.x()) < kExact);
  CHECK(std::abs(last.y() - c.min.y()) < kExact);
  CHECK(std::abs(last_rate - c.max_yaw_rate) < kExact);
  CHECK(reference.effective() == reference.ramped());
}

TEST_CASE("WhatTheRobotLacksOfTheVelocityIsAddedUpToALimit") {
  const VelocityConfig& c = test::walk_config().velocity;
  VelocityReference reference(c);
  reference.reset(0.0);
  for (int k = 0; k < 2000; ++k) reference.step({0.5, 0.0}, 0.0, {0.4, 0.0}, 0.0, true, kDt);
  CHECK(reference.effective().x() > 0.5);
  CHECK(std::abs(reference.effective().x() - 0.5 - c.integral_limit.x() - c.integral_share * 0.5) < kExact);
  reference.reset(0.0);
  CHECK(reference.effective() == Vector2::Zero());
}

TEST_CASE("TheHeadingsReferenceWaitsForARobotThatDoesNotTurn") {
  const VelocityConfig& c = test::walk_config().velocity;
  VelocityReference reference(c);
  reference.reset(1.0);
  for (int k = 0; k < 1000; ++k) reference.step(Vector2::Zero(), 0.5, Vector2::Zero(), 1.0, false, kDt);
  CHECK(std::abs(reference.yaw() - 1.0 - c.max_yaw_error) < kExact);
}

TEST_CASE("AVelocityConfigurationOutOfRangeIsRefused") {
  const auto refused = [](auto spoil) {
    VelocityConfig c = test::walk_config().velocity;
    spoil(c);
    try {
      c.validate();
    } catch (const std::invalid_argument&) {
      return true;
    }
    return false;
  };
  CHECK_FALSE(refused([](VelocityConfig&) {}));
  CHECK(refused([](VelocityConfig& c) { c.min.x() = 0.1; }));
  CHECK(refused([](VelocityConfig& c) { c.max.y() = -0.1; }));
  CHECK(refused([](VelocityConfig& c) { c.acceleration = 0.0; }));
  CHECK(refused([](VelocityConfig& c) { c.filter_time = 0.0; }));
  CHECK(refused([](VelocityConfig& c) { c.max_yaw_error = 0.0; }));
}

}  // namespace stance::planning
