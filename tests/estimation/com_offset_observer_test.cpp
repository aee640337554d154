#include "controller/estimation/com_offset_observer.hpp"

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <cmath>

namespace stance::estimation {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

constexpr CentreOfMassOffsetConfig kConfig{2.0, 0.04};
constexpr double kMass = 13.2;        // kg
constexpr double kFootRadius = 0.02;  // m
constexpr double kDt = 0.01;          // s
constexpr double kOffset = 0.012;     // m
constexpr double kConverged = 2e-4;   // m, after ten time constants, of an offset of 12 mm

/// A robot that sways about the line through its feet, its heading `yaw`, and believes its centre of mass `offset` too
/// far back.
class LeaningRobot {
 public:
  LeaningRobot(double yaw, double offset) : R_(math::rotation_z(yaw)), offset_(offset) {
    input_.yaw = yaw;
    input_.standing = true;
    input_.p_WF = {R_ * Vector3(0.0, 0.1, kFootRadius), R_ * Vector3(0.0, -0.1, kFootRadius)};
  }

  /// L' = m g x exactly; half of L shows as the centre of mass's motion.
  const CentreOfMassOffsetInput& next() {
    constexpr double kHeight = 0.75, kSway = 0.01, kRate = 3.0;  // m, m, rad/s
    time_ += kDt;
    const double x = kSway * std::cos(kRate * time_);
    const double L = kMass * kGravity * kSway / kRate * std::sin(kRate * time_);
    const double v = 0.5 * L / (kMass * kHeight);
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
    CentreOfMassOffsetObserver observer(kConfig, kMass, kFootRadius);
    LeaningRobot robot(yaw, kOffset);
    const Vector3 b = settle(observer, robot);
    CHECK((b - kOffset * Vector3(std::cos(yaw), std::sin(yaw), 0.0)).norm() < kConverged);
  }
}

TEST_CASE("OffsetIsFoundWithTheFeetCrossed") {
  CentreOfMassOffsetObserver observer(kConfig, kMass, kFootRadius);
  LeaningRobot robot(0.4, kOffset);
  std::swap(robot.input().p_WF[0], robot.input().p_WF[1]);
  settle(observer, robot);
  CHECK_THAT(observer.offset(), WithinAbs(kOffset, kConverged));
}

TEST_CASE("OffsetStaysWithinItsLimit") {
  for (const double offset : {-0.1, 0.1}) {
    CentreOfMassOffsetObserver observer(kConfig, kMass, kFootRadius);
    LeaningRobot robot(0.0, offset);
    settle(observer, robot);
    CHECK(observer.offset() == std::copysign(kConfig.limit, offset));
  }
}

TEST_CASE("OffsetIsHeldAlongTheHeadingWhileSteppingAndGoesOnFromThere") {
  CentreOfMassOffsetObserver observer(kConfig, kMass, kFootRadius);
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
  CentreOfMassOffsetObserver observer(kConfig, kMass, kFootRadius);
  LeaningRobot robot(0.0, kOffset);
  robot.input().p_WF[1] = robot.input().p_WF[0];
  const Vector3 b = settle(observer, robot);
  CHECK(b.norm() == 0.0);
}

TEST_CASE("ResetForgetsTheOffset") {
  CentreOfMassOffsetObserver observer(kConfig, kMass, kFootRadius);
  LeaningRobot robot(0.0, kOffset);
  settle(observer, robot);
  observer.reset();
  CHECK(observer.offset() == 0.0);
}

TEST_CASE("OffsetObserversConfigNamesTheFieldThatIsWrong") {
  CHECK_THROWS_WITH(CentreOfMassOffsetObserver({-1.0, 0.04}, kMass, kFootRadius), ContainsSubstring("bandwidth = -1"));
  CHECK_THROWS_WITH(CentreOfMassOffsetObserver({2.0, 1.0}, kMass, kFootRadius), ContainsSubstring("limit = 1"));
  CHECK_THROWS_WITH(CentreOfMassOffsetObserver(kConfig, 0.0, kFootRadius), ContainsSubstring("mass = 0"));
}

}  // namespace stance::estimation
