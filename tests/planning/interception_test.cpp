#include "controller/planning/interception.hpp"

#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>

#include "controller/config/catcher_config_yaml.hpp"

namespace stance::planning {
namespace {

constexpr double kTakesNoBall = std::numbers::pi / 3.0;  // rad, between a cup's axis and the ball's velocity reversed

struct Arm {
  config::RobotDescription robot = config::load_robot(config::share_directory() / "robots", "catcher");
  behaviours::CatcherConfig config = config::catcher_config(robot);
  kinematics::Arm5Geometry geometry = kinematics::arm5_geometry(robot.model, config.tool);
  kinematics::Arm5Limits limits = kinematics::arm5_limits(robot.model);

  Interception interception() const { return {config.planner, geometry, config.motion}; }
  JointMotion at_its_place() const {
    JointMotion motion;
    motion.q = config.place;
    return motion;
  }
  RigidTransform cup(const JointVector& q) const { return kinematics::arm5_forward(geometry, q.head<5>()); }
};

/// A ball that is at `aim` after `time`, thrown from `from`.
BallState thrown(const Vector3& from, const Vector3& aim, double time) {
  return {from, (aim - from) / time + 0.5 * time * Vector3(0.0, 0.0, kGravity), 0.0};
}

}  // namespace

TEST_CASE("ABallInFlightFallsAsFreeBodiesDoAndDragSlowsIt") {
  BallState free{{0.0, 0.0, 1.0}, {3.0, 1.0, 2.0}, 0.0}, slowed{free.p_A, free.v_A, 0.02};
  for (int k = 0; k < 50; ++k) {
    free.coast(0.01);
    slowed.coast(0.01);
  }
  CHECK((free.p_A - Vector3(1.5, 0.5, 1.0 + 1.0 - 0.125 * kGravity)).norm() < 1e-12);
  CHECK((free.v_A - Vector3(3.0, 1.0, 2.0 - 0.5 * kGravity)).norm() < 1e-12);
  CHECK(slowed.v_A.norm() < free.v_A.norm());
}

TEST_CASE("ABallThroughTheArmsReachIsMetByACupThatFacesIt") {
  const Arm arm;
  Interception interception = arm.interception();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> aside(-0.15, 0.15), distance(2.5, 4.5);
  for (int trial = 0; trial < 50; ++trial) {
    const Vector3 aim(0.55 + aside(random), aside(random), 0.8 + aside(random));
    const BallState ball = thrown({distance(random), aside(random), 1.2}, aim, 0.8);
    interception.reset();
    const InterceptionPlan plan = interception.update(10.0, ball, arm.at_its_place());
    REQUIRE(plan.status == InterceptionStatus::kPlanned);
    BallState then = ball;
    then.coast(plan.time - 10.0);
    CHECK((then.p_A - plan.p_ABall).norm() < 1e-9);
    const RigidTransform cup = arm.cup(plan.q);
    CHECK((cup.p - plan.p_ABall).norm() <= arm.config.planner.reach_slack + 1e-9);
    const double facing = std::acos(-cup.R.col(2).dot(plan.v_ABall.normalized()));
    CHECK(facing < kTakesNoBall);
    for (int i = 0; i < 5; ++i) {
      CHECK(plan.q[i] >= arm.limits.lower(i) + arm.config.planner.limit_margin - 1e-9);
      CHECK(plan.q[i] <= arm.limits.upper(i) - arm.config.planner.limit_margin + 1e-9);
    }
  }
}

TEST_CASE("ACupIsTurnedAwayFromABallAcrossTheArmsPlaneByNoMoreThanItMay") {
  const Arm arm;
  Arm careless;
  careless.config.planner.facing_cost = careless.config.planner.turned_away_cost = 0.0;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> aside(-0.2, 0.2), azimuth(0.2, 0.6);
  int turned_away = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const double from = azimuth(random);
    const Vector3 aim(0.55 + aside(random), aside(random), 0.8 + aside(random));
    BallState ball = thrown({3.0 * std::cos(from), 3.0 * std::sin(from), 1.2}, aim, 0.5);
    ball.coast(0.05);
    const auto angle = [&](const Arm& of) {
      Interception interception = of.interception();
      const InterceptionPlan plan = interception.update(0.0, ball, of.at_its_place());
      REQUIRE(plan.exists());
      return std::acos(-of.cup(plan.q).R.col(2).dot(plan.v_ABall.normalized()));
    };
    CHECK(angle(arm) < kTakesNoBall);
    if (angle(careless) > kTakesNoBall) ++turned_away;
  }
  CHECK(turned_away > 0);
}

TEST_CASE("ABallThatPassesOutOfReachIsNotPlannedFor") {
  const Arm arm;
  Interception interception = arm.interception();
  const auto plan = interception.update(0.0, thrown({3.0, 2.0, 1.0}, {0.0, 2.0, 1.0}, 0.8), arm.at_its_place());
  CHECK(plan.status == InterceptionStatus::kReach);
  CHECK_FALSE(plan.exists());
}

TEST_CASE("ABallBarelyOutOfReachIsMetFromShortOfIt") {
  Arm arm;
  arm.config.planner.reach_slack = 0.0;
  // Falling past the farthest point at the shoulder's height: the cup lies along the arm's plane.
  const auto passing = [](double radius) { return BallState{{radius, 0.0, 3.0}, {0.0, 0.0, -1.0}, 0.0}; };
  const auto farthest = [&] {
    double reached = 0.5;
    for (double radius = 0.5; radius < 1.2; radius += 0.001) {
      Interception interception = arm.interception();
      if (!interception.update(0.0, passing(radius), arm.at_its_place()).exists()) break;
      reached = radius;
    }
    return reached;
  };
  const double strict = farthest();
  arm.config.planner.reach_slack = 0.03;
  const double slack = farthest();
  CHECK(slack > strict + 0.02);
  CHECK(slack < strict + 0.05);
}

TEST_CASE("ALateArmGoesAllTheSameAndSaysSo") {
  const Arm arm;
  Interception interception = arm.interception();
  JointMotion away;
  away.q.head<5>() << -2.5, 0.5, 2.0, 0.0, 0.0;
  const auto plan = interception.update(0.0, thrown({1.2, 0.0, 1.0}, {0.5, 0.0, 0.8}, 0.12), away);
  CHECK(plan.status == InterceptionStatus::kTime);
  CHECK(plan.exists());
  CHECK(plan.slack < 0.0);
}

namespace {

/// A plan that has just been committed to, the ball and the instant that it is for.
struct Committed {
  Arm arm;
  Interception interception = arm.interception();
  BallState ball = thrown({3.5, 0.0, 1.2}, {0.55, 0.0, 0.8}, 0.8);
  double now = 0.0;

  Committed() {
    interception.update(now, ball, arm.at_its_place());
    while (!interception.plan().committed) {
      now += 0.01;
      ball.coast(0.01);
      interception.update(now, ball, arm.at_its_place());
    }
  }
  /// m, from the cup to the ball's way.
  double off_the_way() const {
    const InterceptionPlan& plan = interception.plan();
    const Vector3 from_cup = plan.p_ABall - arm.cup(plan.q).p;
    return from_cup.cross(plan.v_ABall.normalized()).norm();
  }
};

constexpr double kOffTheWay = 1e-4;  // m

}  // namespace

TEST_CASE("FromItsCommitmentOnTheCupFollowsTheBallsWay") {
  Committed committed;
  const double before = committed.interception.plan().p_ABall.y();
  for (int k = 0; k < 10; ++k) {
    committed.now += 0.01;
    committed.ball.coast(0.01);
    committed.ball.p_A += Vector3(0.0, 0.004, 0.003);                                            // the estimate moves
    const InterceptionPlan& plan = committed.interception.update(committed.now, committed.ball,  //
                                                                 committed.arm.at_its_place());
    CHECK(plan.committed);
    CHECK(committed.off_the_way() < kOffTheWay);
  }
  CHECK(committed.interception.plan().p_ABall.y() > before + 0.03);
}

TEST_CASE("WhatChangesAlongTheBallsWayMovesTheMeetingsTimeAndNotTheArm") {
  Committed committed;
  const InterceptionPlan before = committed.interception.plan();
  committed.ball.coast(0.02);  // the ball is 20 ms further on than was thought
  const InterceptionPlan& plan =
      committed.interception.update(committed.now, committed.ball, committed.arm.at_its_place());
  CHECK(std::abs(plan.time - (before.time - 0.02)) < 1e-4);
  CHECK((plan.q - before.q).norm() < 1e-3);
}

TEST_CASE("TheCupFollowsTheBallsWayByLessMotionThanAtTheSamePitch") {
  Committed committed;
  const InterceptionPlan before = committed.interception.plan();
  const kinematics::Arm5Vector q = before.q.head<5>();
  committed.ball.p_A.z() += 0.03;
  const InterceptionPlan& plan =
      committed.interception.update(committed.now, committed.ball, committed.arm.at_its_place());
  const auto solutions = kinematics::arm5_ik(committed.arm.geometry, committed.arm.cup(plan.q).p, q[1] + q[2] + q[3],
                                             0.0, committed.arm.limits);
  REQUIRE(solutions.count > 0);
  const auto effort = [&](const kinematics::Arm5Vector& to) {
    return (to - q).cwiseQuotient(committed.arm.config.motion.acceleration.head<5>()).norm();
  };
  double least = effort(solutions.t[0]);
  for (int i = 1; i < solutions.count; ++i) least = std::min(least, effort(solutions.t[i]));
  CHECK(effort(plan.q.head<5>()) < 0.7 * least);
}

TEST_CASE("ACommittedPlanStaysWithinTheJointsLimitsWhereverTheBallGoes") {
  std::mt19937 random(11);
  std::normal_distribution<double> error(0.0, 0.3);
  for (int trial = 0; trial < 100; ++trial) {
    Committed committed;
    committed.ball.p_A += Vector3(error(random), error(random), error(random));
    const InterceptionPlan& plan =
        committed.interception.update(committed.now, committed.ball, committed.arm.at_its_place());
    REQUIRE(plan.q.allFinite());
    CHECK(plan.time >= committed.now);
    for (int i = 0; i < 5; ++i) {
      CHECK(plan.q[i] >= committed.arm.limits.lower(i) + committed.arm.config.planner.limit_margin - 1e-9);
      CHECK(plan.q[i] <= committed.arm.limits.upper(i) - committed.arm.config.planner.limit_margin + 1e-9);
    }
  }
}

TEST_CASE("AStretchedArmGoesNoFartherForABallThatItCannotReachAndNeverLosesGround") {
  // Falling past the farthest point at the shoulder's height, up to reach_slack out of reach.
  const Arm arm;
  for (double radius = 0.85; radius < 1.2; radius += 0.005) {
    Interception interception = arm.interception();
    BallState ball{{radius, 0.0, 3.0}, {0.0, 0.0, -1.0}, 0.0};
    JointMotion motion = arm.at_its_place();
    double now = 0.0;
    if (!interception.update(now, ball, motion).exists()) continue;
    double miss = std::numeric_limits<double>::infinity();
    for (bool was_committed = false; interception.plan().time > now + 0.01;) {
      now += 0.01;
      ball.coast(0.01);
      const InterceptionPlan before = interception.plan();
      const InterceptionPlan& plan = interception.update(now, ball, motion);
      if (!plan.committed) continue;
      const double off = (plan.p_ABall - arm.cup(plan.q).p).cross(plan.v_ABall.normalized()).norm();
      if (was_committed) CHECK(off < miss + 1e-6);
      miss = off;
      was_committed = true;
      const double moved =
          ((plan.q - before.q).head<5>().array() / arm.config.motion.speed.head<5>().array()).abs().maxCoeff();
      CHECK(moved < 3.0 * (before.time - now) + 0.01);
      motion.q = plan.q;
    }
  }
}

TEST_CASE("APlanThatIsCommittedStaysSoWhereTheMeetingIsPutOffALittleAndIsMadeAnewWhereItIsAnotherBalls") {
  Committed little, much;
  little.ball.coast(-0.03);
  much.ball.coast(-0.3);
  for (Committed* committed : {&little, &much}) {
    committed->interception.update(committed->now, committed->ball, committed->arm.at_its_place());
    committed->interception.update(committed->now, committed->ball, committed->arm.at_its_place());
  }
  CHECK(little.interception.plan().time - little.now > little.arm.config.planner.commit);
  CHECK(little.interception.plan().committed);
  CHECK_FALSE(much.interception.plan().committed);
}

TEST_CASE("ACommittedPlansTimeStaysWithinWhatIsPlannedForEvenForABallAtRest") {
  Committed committed;
  committed.ball.p_A += Vector3(2.0, 0.0, 0.0);
  committed.ball.v_A.setZero();
  const InterceptionPlan& plan =
      committed.interception.update(committed.now, committed.ball, committed.arm.at_its_place());
  CHECK(plan.q.allFinite());
  CHECK(plan.time >= committed.now);
  CHECK(plan.time <= committed.now + committed.arm.config.planner.latest + 1e-9);
}

TEST_CASE("ACommittedPlanThatTheArmIsLateForSaysSo") {
  Committed committed;
  JointMotion away = committed.arm.at_its_place();
  away.q[0] -= 2.0;
  const InterceptionPlan& plan = committed.interception.update(committed.now, committed.ball, away);
  REQUIRE(plan.committed);
  CHECK(plan.slack < 0.0);
  CHECK(plan.status == InterceptionStatus::kTime);
}

TEST_CASE("ABallCoastsToWhereItIsNearestToAPointForwardAndBack") {
  const Vector3 point(0.5, 0.1, 0.8);
  const BallState nearest = thrown({3.5, 0.0, 1.2}, {0.55, 0.0, 0.8}, 0.8);
  for (const double start : {0.1, 0.5, 1.0}) {
    BallState ball = nearest;
    ball.coast(start);
    const double t = ball.coast_to_nearest(point, -1.0, 1.0);
    CHECK(std::abs((point - ball.p_A).dot(ball.v_A)) < 1e-6);
    CHECK(std::abs(start + t - 0.8) < 0.1);
  }
  BallState ball = nearest;
  CHECK(std::abs(ball.coast_to_nearest(point, -0.1, 0.2) - 0.2) < 1e-12);
  CHECK((ball.across() * ball.across().transpose() - Eigen::Matrix2d::Identity()).norm() < 1e-12);
  CHECK((ball.across() * ball.v_A).norm() < 1e-12);
}

TEST_CASE("AnArmWithoutFiniteLimitsOrWithNoRangeLeftIsRefusedByItsJoint") {
  const auto refusal = [](double lower, double upper) -> std::string {
    Arm arm;
    arm.config.motion.lower[2] = lower;
    arm.config.motion.upper[2] = upper;
    try {
      static_cast<void>(arm.interception());
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  constexpr double infinity = std::numeric_limits<double>::infinity();
  CHECK(refusal(-1.0, 1.0).empty());
  CHECK(refusal(-infinity, 1.0).find("joint 3") != std::string::npos);
  CHECK(refusal(-1.0, infinity).find("joint 3") != std::string::npos);
  CHECK(refusal(1.0, 1.0).find("limit_margin") != std::string::npos);
}

}  // namespace stance::planning
