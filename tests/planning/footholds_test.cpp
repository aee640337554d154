#include "controller/planning/footholds.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <random>

#include "tests/planning/planning_fixture.hpp"

namespace stance::planning {
namespace {

using test::steady;

constexpr double kExact = 1e-9;

const FootholdConfig& config() { return test::walk_config().gait.footholds; }

/// A push's velocity on top of a steady gait.
FootholdProblem pushed(const Vector2& velocity, double side = 1.0, double time = 0.05) {
  FootholdProblem problem = steady(side, time);
  problem.com.v += velocity;
  return problem;
}

}  // namespace

TEST_CASE("ASteadyGaitIsGoneOnWith") {
  const double period = config().swing_time + config().double_support;
  for (const double side : {1.0, -1.0}) {
    for (const Vector2& velocity : {Vector2(0.0, 0.0), Vector2(0.4, 0.0), Vector2(-0.3, 0.1), Vector2(0.0, -0.1),
                                    Vector2(0.0, 0.5), Vector2(0.3, -0.5)}) {
      for (const double time : {0.0, 0.05, 0.1}) {
        CAPTURE(side, velocity.transpose(), time);
        const FootholdPlan plan = plan_footholds(config(), steady(side, time, velocity));
        CHECK(std::abs(plan.swing_time - config().swing_time) < kExact);
        CHECK(std::abs(plan.next_swing_time - config().swing_time) < kExact);
        CHECK((plan.foothold - velocity * period - Vector2(0.0, side * steady_width(config(), velocity))).norm() <
              kExact);
        CHECK(side * plan.foothold.y() > config().path_clearance - kExact);
        CHECK(plan.deviation < kExact);
        CHECK(plan.next_deviation < kExact);
        CHECK(plan.crossing == 0);
      }
    }
  }
}

TEST_CASE("AFootholdGoesWhereAPushSendsTheRobot") {
  const FootholdPlan calm = plan_footholds(config(), pushed({0.0, 0.0}));
  CHECK(plan_footholds(config(), pushed({0.3, 0.0})).foothold.x() > calm.foothold.x() + 0.05);
  CHECK(plan_footholds(config(), pushed({-0.3, 0.0})).foothold.x() < calm.foothold.x() - 0.05);
  CHECK(plan_footholds(config(), pushed({0.0, 0.3})).foothold.y() > calm.foothold.y() + 0.05);
}

TEST_CASE("AMirroredProblemHasTheMirroredPlan") {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int k = 0; k < 200; ++k) {
    FootholdProblem left = steady(1.0, 0.08 * (1.0 + uniform(random)), {0.5 * uniform(random), 0.2 * uniform(random)});
    left.com.v += Vector2(uniform(random), uniform(random));
    FootholdProblem right = left;
    right.side = -1.0;
    for (Vector2* v : {&right.com.p, &right.com.v, &right.swing_foot, &right.velocity}) v->y() = -v->y();
    const FootholdPlan a = plan_footholds(config(), left), b = plan_footholds(config(), right);
    REQUIRE(a.swing_time == b.swing_time);
    REQUIRE(a.next_swing_time == b.next_swing_time);
    REQUIRE(a.crossing == b.crossing);
    REQUIRE((a.foothold - Vector2(b.foothold.x(), -b.foothold.y())).norm() < kExact);
  }
}

TEST_CASE("EveryPlanKeepsItsLimits") {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int crossings = 0;
  for (int k = 0; k < 2000; ++k) {
    const double side = k % 2 == 0 ? 1.0 : -1.0;
    FootholdProblem problem = pushed({2.0 * uniform(random), 2.0 * uniform(random)}, side, 0.1 + 0.1 * uniform(random));
    problem.swing_foot += 0.2 * Vector2(uniform(random), uniform(random));
    const FootholdPlan plan = plan_footholds(config(), problem);
    CAPTURE(k);
    REQUIRE(plan.foothold.allFinite());
    REQUIRE(plan.swing_time >= problem.time + config().min_time_left - kExact);
    REQUIRE(plan.swing_time <= std::max(config().max_swing_time, problem.time + config().min_time_left) + kExact);
    REQUIRE(plan.next_swing_time >= config().min_second_time - kExact);
    REQUIRE(plan.next_swing_time <= config().max_second_time + kExact);
    if (plan.crossing == 0) {
      REQUIRE(side * plan.foothold.y() >= config().min_lateral - kExact);
    } else {
      ++crossings;
      REQUIRE(plan.crossing * plan.foothold.x() >= config().crossing_forward - kExact);
    }
    REQUIRE(plan.foothold == foothold_at(config(), problem, plan.swing_time, plan.crossing));
  }
  CHECK(crossings > 0);
}

TEST_CASE("APushOverTheStanceFootIsMetByCrossingIt") {
  // The left foot swings, and the robot falls to the right.
  const FootholdPlan plan = plan_footholds(config(), pushed({0.0, -1.2}));
  CHECK(plan.crossing != 0);
  CHECK(plan.foothold.y() < config().min_lateral);
}

TEST_CASE("TheSearchNeverKeepsPostponingTheLanding") {
  // Whatever pushes come every tick, the foot lands.
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int k = 0; k < 50; ++k) {
    FootholdProblem problem = steady(1.0, 0.0);
    int ticks = 0;
    while (problem.swing_time - problem.time > test::walk_config().gait.freeze && ticks < 100) {
      problem.com.v += 0.3 * Vector2(uniform(random), uniform(random));
      problem.swing_time = plan_footholds(config(), problem).swing_time;
      problem.time += 0.01;
      ++ticks;
    }
    REQUIRE(problem.time <= config().max_swing_time + kExact);
  }
}

}  // namespace stance::planning
