#include "controller/planning/joint_motion.hpp"

#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <random>

namespace stance::planning {
namespace {

constexpr int kJoints = 5;
constexpr double kStep = 0.01;  // s

JointMotionLimits limits() {
  JointMotionLimits out;
  out.speed.head<kJoints>() << 4.5, 4.5, 6.0, 8.0, 8.0;
  out.acceleration.head<kJoints>() << 30.0, 30.0, 45.0, 60.0, 60.0;
  return out;
}

}  // namespace

TEST_CASE("WhereTimeIsEnoughEveryJointArrivesOnTimeWithTheSpeedThatIsWanted") {
  JointMotion motion;
  JointVector target = JointVector::Zero(), speed = JointVector::Zero();
  target.head<kJoints>() << 0.5, -0.8, 1.0, -1.2, 0.3;
  speed.head<kJoints>() << 0.5, -1.0, 0.0, 2.0, -0.5;
  for (int k = 80; k > 0; --k) advance(limits(), kJoints, target, speed, k * kStep, Priority::kTime, kStep, motion);
  CHECK((motion.q - target).norm() < 1e-9);
  CHECK((motion.v - speed).norm() < 1e-9);
}

TEST_CASE("NoJointPassesItsSpeedOrItsAccelerationWhateverIsAskedAndWheneverItChanges") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-2.5, 2.5), time(-0.2, 0.8), rate(-3.0, 3.0);
  const JointMotionLimits allowed = limits();
  for (int trial = 0; trial < 200; ++trial) {
    JointMotion motion;
    for (int change = 0; change < 6; ++change) {
      JointVector target = JointVector::Zero(), speed = JointVector::Zero();
      for (int i = 0; i < kJoints; ++i) {
        target[i] = place(random);
        speed[i] = change % 2 == 0 ? 0.0 : rate(random);
      }
      double left = time(random);
      for (int k = 0; k < 20; ++k, left -= kStep) {
        const JointMotion before = motion;
        advance(allowed, kJoints, target, speed, left, change % 3 == 0 ? Priority::kSpeed : Priority::kTime, kStep,
                motion);
        for (int i = 0; i < kJoints; ++i) {
          CHECK(std::abs(motion.v[i]) <= (1.0 + 1e-9) * allowed.speed[i]);
          CHECK(std::abs(motion.v[i] - before.v[i]) / kStep <= (1.0 + 1e-9) * allowed.acceleration[i]);
        }
      }
    }
  }
}

TEST_CASE("WhereTimeIsShortAJointIsLateAndThenAtRest") {
  JointMotion motion;
  JointVector target = JointVector::Zero();
  target[0] = 2.0;
  const JointVector rest = JointVector::Zero();
  double left = 0.1;
  int steps = 0;
  for (; steps < 200 && (std::abs(motion.q[0] - 2.0) > 1e-4 || std::abs(motion.v[0]) > 1e-3); ++steps, left -= kStep) {
    advance(limits(), kJoints, target, rest, left, Priority::kTime, kStep, motion);
    CHECK(motion.q[0] < 2.0 + 1e-3);
  }
  // The fastest way takes 2 / 4.5 + 4.5 / 30 s.
  CHECK(steps * kStep > 0.59);
  CHECK(steps * kStep < 0.9);
}

TEST_CASE("AJointWithoutTheTimeToRestAtItsTargetPassesItOnTime") {
  // 0.9 rad from rest in 0.3 s: 0.45 rad is what rest to rest allows, 1.35 rad what it comes at most.
  JointMotion motion;
  JointVector target = JointVector::Zero();
  target[0] = 0.9;
  const JointVector rest = JointVector::Zero();
  for (int k = 30; k > 0; --k) advance(limits(), kJoints, target, rest, k * kStep, Priority::kTime, kStep, motion);
  CHECK(std::abs(motion.q[0] - 0.9) < 0.01);
  CHECK(motion.v[0] > 0.5);
  double farthest = motion.q[0];
  for (int k = 0; k < 40; ++k) {
    advance(limits(), kJoints, target, rest, -k * kStep, Priority::kTime, kStep, motion);
    farthest = std::max(farthest, motion.q[0]);
  }
  CHECK(std::abs(motion.q[0] - 0.9) < 1e-3);
  CHECK(farthest < 0.9 + 4.5 * 4.5 / (2.0 * 30.0) + 0.05);
}

TEST_CASE("AJointThatIsToRestWhereItPassesTooFastComesBackToItAndNotThroughIt") {
  const JointVector rest = JointVector::Zero();
  for (double from = 1.0; from <= 4.5; from += 0.5) {
    JointMotion motion;
    motion.v[0] = from;
    for (int k = 20; k > -60; --k) {
      advance(limits(), kJoints, rest, rest, k * kStep, Priority::kSpeed, kStep, motion);
      CHECK(motion.q[0] > -1e-3);
    }
    CHECK(motion.q[0] < 1e-3);
  }
}

TEST_CASE("AJointThatCanOnlyJustBeOnTimeIsSo") {
  // In 0.12 s it comes 0.216 rad from rest; not on the fastest way there is little to spare.
  for (const double e : {0.09, 0.104, 0.122, 0.18, 0.21}) {
    JointMotion motion;
    JointVector target = JointVector::Zero();
    target[0] = e;
    for (int k = 12; k > 0; --k) {
      advance(limits(), kJoints, target, JointVector::Zero(), k * kStep, Priority::kTime, kStep, motion);
    }
    CHECK(std::abs(motion.q[0] - e) < 0.003);
  }
}

TEST_CASE("AJointPassesItsTargetOnlyAsFastAsItCanStopBeforeItsLimit") {
  JointMotionLimits allowed = limits();
  allowed.upper[0] = 0.95;
  JointMotion motion;
  JointVector target = JointVector::Zero();
  target[0] = 0.9;
  const double step_at_most = kStep * std::sqrt(2.0 * 0.75 * 30.0 * 0.05);  // rad, at the speed that stops in 0.05 rad
  for (int k = 30; k > -40; --k) {
    advance(allowed, kJoints, target, JointVector::Zero(), k * kStep, Priority::kTime, kStep, motion);
    CHECK(motion.q[0] < 0.95 + step_at_most);
  }
}

TEST_CASE("AWayThatPassesAJointsLimitDoesNotKeepToTheLimits") {
  JointMotionLimits allowed = limits();
  JointVector target = JointVector::Zero(), speed = JointVector::Zero();
  speed[0] = 2.0;  // it must go back for a run-up
  CHECK(keeps_to_limits(allowed, kJoints, target, speed, 0.5, JointMotion{}));
  allowed.lower[0] = -0.02;
  CHECK_FALSE(keeps_to_limits(allowed, kJoints, target, speed, 0.5, JointMotion{}));
}

TEST_CASE("TheTimeNeededIsWhatTheQuinticTakesFromRest") {
  JointMotion motion;
  JointVector target = JointVector::Zero();
  target[1] = 1.0;
  const double needed = time_needed(limits(), kJoints, motion, target);
  CHECK(std::abs(needed - std::max(1.875 / 4.5, std::sqrt(5.7735026918962582 / 30.0))) < 1e-12);
  motion.v[1] = 2.0;
  CHECK(time_needed(limits(), kJoints, motion, target) < needed);
}

}  // namespace stance::planning
