#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <cmath>

#include "tests/estimation/simulated_robot.hpp"

namespace stance::estimation {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

constexpr double kDt = 0.01;         // s
constexpr double kOffset = 0.012;    // m
constexpr double kConverged = 2e-4;  // m, after 5 s, of an offset of 12 mm

const test::ShippedBiped& biped() { return test::shipped_biped(); }

/// A robot that sways about the line through its feet, its heading `yaw`, and believes its centre of mass `offset` too
/// far back.
class LeaningRobot {
 public:
  LeaningRobot(double yaw, double offset) : R_(math::rotation_z(yaw)), offset_(offset) {
    input_.yaw = yaw;
    input_.standing = true;
    input_.p_WF = {R_ * Vector3(0.0, 0.1, biped().foot_radius), R_ * Vector3(0.0, -0.1, biped().foot_radius)};
  }

  /// L' = m g x exactly; half of L shows as the centre of mass's motion.
  const CentreOfMassOffsetInput& next() {
    constexpr double kHeight = 0.75, kSway = 0.01, kRate = 3.0;  // m, m, rad/s
    time_ += kDt;
    const double x = kSway * std::cos(kRate * time_);
    const double L = biped().mass * kGravity * kSway / kRate * std::sin(kRate * time_);
    const double v = 0.5 * L / (biped().mass * kHeight);
    input_.p_WC = R_ * Vector3(x - offset_, 0.02, kHeight);
    input_.v_WC = R_ * Vector3(v, 0.0, 0.0);
    input_.L_C_W = R_ * Vector3(0.3, 0.5 * L, -0.2);
    return input_;
  }
  CentreOfMassOffsetInput& input() { return input_; }

 private:
  Matrix3 R_;
  double offset_;
  double time_ = 0.0;
  CentreOfMassOffsetInput input_;
};

Vector3 settle(CentreOfMassOffsetObserver& observer, LeaningRobot& robot) {
  Vector3 b = Vector3::Zero();
  for (int k = 0; k < 500; ++k) b = observer.step(robot.next(), kDt);
  return b;
}

}  // namespace

TEST_CASE("OffsetIsFoundWhateverTheHeading") {
  for (const double yaw : {0.0, 1.0, 2.5, -1.8}) {
    CentreOfMassOffsetObserver observer = test::shipped_offset_observer();
    LeaningRobot robot(yaw, kOffset);
    const Vector3 b = settle(observer, robot);
    CHECK((b - kOffset * Vector3(std::cos(yaw), std::sin(yaw), 0.0)).norm() < kConverged);
  }
}

TEST_CASE("OffsetIsFoundWithTheFeetCrossed") {
  CentreOfMassOffsetObserver observer = test::shipped_offset_observer();
  LeaningRobot robot(0.4, kOffset);
  std::swap(robot.input().p_WF[0], robot.input().p_WF[1]);
  settle(observer, robot);
  CHECK_THAT(observer.offset(), WithinAbs(kOffset, kConverged));
}

TEST_CASE("OffsetStaysWithinItsLimit") {
  for (const double offset : {-0.1, 0.1}) {
    CentreOfMassOffsetObserver observer = test::shipped_offset_observer();
    LeaningRobot robot(0.0, offset);
    settle(observer, robot);
    CHECK(observer.offset() == std::copysign(biped().com_offset_observer.limit, offset));
  }
}

TEST_CASE("OffsetIsHeldAlongTheHeadingWhileSteppingAndGoesOnFromThere") {
  CentreOfMassOffsetObserver observer = test::shipped_offset_observer();
  LeaningRobot robot(0.0, kOffset);
  settle(observer, robot);
  const double held = observer.offset();
  robot.input().standing = false;
  robot.input().yaw = 1.2;
  for (int k = 0; k < 100; ++k) {
    CentreOfMassOffsetInput input = robot.next();
    input.L_C_W *= 100.0;
    const Vector3 b = observer.step(input, kDt);
    CHECK((b - held * Vector3(std::cos(1.2), std::sin(1.2), 0.0)).norm() == 0.0);
  }
  robot.input().standing = true;
  robot.input().yaw = 0.0;
  observer.step(robot.next(), kDt);
  CHECK_THAT(observer.offset(), WithinAbs(held, kConverged));
  settle(observer, robot);
  CHECK_THAT(observer.offset(), WithinAbs(kOffset, kConverged));
}

TEST_CASE("FeetInOnePlaceGiveNoLine") {
  CentreOfMassOffsetObserver observer = test::shipped_offset_observer();
  LeaningRobot robot(0.0, kOffset);
  robot.input().p_WF[1] = robot.input().p_WF[0];
  const Vector3 b = settle(observer, robot);
  CHECK(b.norm() == 0.0);
}

TEST_CASE("ResetForgetsTheOffset") {
  CentreOfMassOffsetObserver observer = test::shipped_offset_observer();
  LeaningRobot robot(0.0, kOffset);
  settle(observer, robot);
  observer.reset();
  CHECK(observer.offset() == 0.0);
}

TEST_CASE("OffsetObserversConfigNamesTheFieldThatIsWrong") {
  CHECK_THROWS_WITH(CentreOfMassOffsetObserver({-1.0, 0.04}, 1.0, 0.0), ContainsSubstring("bandwidth = -1"));
  CHECK_THROWS_WITH(CentreOfMassOffsetObserver({2.0, 1.0}, 1.0, 0.0), ContainsSubstring("limit = 1"));
  CHECK_THROWS_WITH(CentreOfMassOffsetObserver({2.0, 0.04}, 0.0, 0.0), ContainsSubstring("mass = 0"));
}

}  // namespace stance::estimation
