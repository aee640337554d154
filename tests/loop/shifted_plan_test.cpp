#include "controller/behaviours/shifted_plan.hpp"

#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <vector>

namespace stance::behaviours {
namespace {

constexpr double kRounding = 1e-12;  // s
constexpr ContactFlags kBoth{true, true};
constexpr ContactFlags kLeft{true, false};
constexpr ContactFlags kRight{false, true};

/// Of two feet; stage k's first force is k N up, it ends with C k m ahead.
ForcePlan plan_of(const std::vector<double>& durations, const std::vector<ContactFlags>& contacts) {
  ForcePlan plan;
  plan.num_contacts = 2;
  plan.num_stages = static_cast<int>(durations.size());
  for (std::size_t k = 0; k < durations.size(); ++k) {
    plan.stage_duration[k] = durations[k];
    plan.contact[k] = contacts[k];
    plan.force[k][0] = Vector3(0.0, 0.0, static_cast<double>(k));
    plan.p_WC[k] = Vector3(static_cast<double>(k), 0.0, 0.0);
  }
  return plan;
}
ForcePlan standing(const std::vector<double>& durations) {
  return plan_of(durations, std::vector<ContactFlags>(durations.size(), kBoth));
}
/// That the stages from `stage` of plan_of's plan are what is left, `first_duration` [s] of the first.
void check_from(const ForcePlan& plan, int stage, int num_stages, double first_duration) {
  REQUIRE(plan.num_stages == num_stages - stage);
  CHECK(std::abs(plan.stage_duration[0] - first_duration) < kRounding);
  for (int k = stage; k < num_stages; ++k) {
    CHECK(plan.force[static_cast<std::size_t>(k - stage)][0].z() == k);
    CHECK(plan.p_WC[static_cast<std::size_t>(k - stage)].x() == k);
  }
}

}  // namespace

TEST_CASE("StagesThatAreOverGoAndTheOneThatHasBegunKeepsItsRest") {
  ForcePlan plan = standing({0.01, 0.01, 0.03, 0.03});
  REQUIRE(shift_plan(plan, 0.01, kBoth));
  check_from(plan, 1, 4, 0.01);
  REQUIRE(shift_plan(plan, 0.02, kBoth));
  check_from(plan, 2, 4, 0.02);
  CHECK(plan.stage_duration[1] == 0.03);
  REQUIRE(shift_plan(plan, 0.02, kBoth));
  check_from(plan, 3, 4, 0.03);
}

TEST_CASE("TwoShiftsComeToOne") {
  ForcePlan twice = standing({0.01, 0.03, 0.03, 0.03});
  ForcePlan once = twice;
  REQUIRE(shift_plan(twice, 0.01, kBoth));
  REQUIRE(shift_plan(twice, 0.04, kBoth));
  REQUIRE(shift_plan(once, 0.05, kBoth));
  check_from(once, 2, 4, 0.02);
  check_from(twice, 2, 4, 0.02);
}

TEST_CASE("AfterItsEndAPlansLastStageStays") {
  ForcePlan plan = standing({0.01, 0.03});
  for (int again = 0; again < 3; ++again) {
    REQUIRE(shift_plan(plan, 1.0, kBoth));
    check_from(plan, 1, 2, 0.03);
  }
}

TEST_CASE("AFootThatLandsEarlyBearsAsPlannedForLater") {
  ForcePlan plan = plan_of({0.01, 0.01, 0.01, 0.01}, {kLeft, kLeft, kLeft, kBoth});
  REQUIRE(shift_plan(plan, 0.01, kBoth));
  check_from(plan, 3, 4, 0.01);
  CHECK(plan.contact[0] == kBoth);
}

TEST_CASE("AFootThatIsLateLeavesTheOtherItsForceFromBefore") {
  ForcePlan plan = plan_of({0.01, 0.02, 0.01, 0.01}, {kLeft, kLeft, kBoth, kRight});
  REQUIRE(shift_plan(plan, 0.03, kLeft));
  check_from(plan, 1, 4, 0.02);
  CHECK(plan.contact[0] == kLeft);
}

TEST_CASE("ContactsThatNoStageHasLeaveThePlanAsItWas") {
  ForcePlan plan = plan_of({0.01, 0.01}, {kLeft, kBoth});
  CHECK_FALSE(shift_plan(plan, 0.01, kRight));
  check_from(plan, 0, 2, 0.01);
  ForcePlan none;
  none.num_contacts = 2;
  CHECK_FALSE(shift_plan(none, 0.01, kBoth));
  CHECK(none.num_stages == 0);
}

}  // namespace stance::behaviours
