#include "controller/safety/fault_ladder.hpp"

#include <array>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <limits>

namespace stance::safety {
namespace {

constexpr FaultLadderConfig kConfig{.hold_time = 0.03, .damp_time = 0.05};
constexpr int kHoldTicks = 3;  // of kConfig
constexpr int kDampTicks = 5;

constexpr std::array kPassing{Fault::kStateStale, Fault::kStateInvalid, Fault::kQpFailed};
constexpr std::array kLatching{Fault::kRobotFallen, Fault::kOperatorStop};
constexpr std::array kHarmless{Fault::kCommandInvalid, Fault::kTorqueSaturated, Fault::kJointLimit};

SafetyMode tick(FaultLadder& ladder) { return ladder.step(1); }
SafetyMode tick(FaultLadder& ladder, Fault fault) {
  ladder.report(fault);
  return ladder.step(1);
}
std::int64_t count(const FaultLadder& ladder, Fault fault) { return ladder.counts()[static_cast<std::size_t>(fault)]; }

}  // namespace

TEST_CASE("WithoutFaultsTheLadderRuns") {
  FaultLadder ladder(kConfig);
  for (int k = 0; k < 1000; ++k) REQUIRE(tick(ladder) == SafetyMode::kRun);
  CHECK(ladder.faults() == 0);
  for (const std::int64_t n : ladder.counts()) CHECK(n == 0);
}

TEST_CASE("APassingFaultHoldsForHoldTimeThenDampsForDampTimeThenStops") {
  for (const Fault fault : kPassing) {
    CAPTURE(static_cast<int>(fault));
    FaultLadder ladder(kConfig);
    CHECK(tick(ladder) == SafetyMode::kRun);
    for (int k = 0; k < kHoldTicks; ++k) CHECK(tick(ladder, fault) == SafetyMode::kHold);
    for (int k = 0; k < kDampTicks; ++k) CHECK(tick(ladder, fault) == SafetyMode::kDamp);
    CHECK(tick(ladder, fault) == SafetyMode::kStop);
    CHECK(ladder.mode() == SafetyMode::kStop);
  }
}

TEST_CASE("WhereThereIsNothingToHoldItDampsAtOnce") {
  for (const Fault fault : kPassing) {
    CAPTURE(static_cast<int>(fault));
    FaultLadder ladder(kConfig);
    ladder.report(fault);
    CHECK(ladder.step(1, false) == SafetyMode::kDamp);
    CHECK(ladder.step(1, true) == SafetyMode::kRun);
  }
}

TEST_CASE("MissedPeriodsCountAsTimeInTheMode") {
  FaultLadder ladder(kConfig);
  CHECK(tick(ladder, Fault::kStateStale) == SafetyMode::kHold);
  ladder.report(Fault::kStateStale);
  CHECK(ladder.step(2) == SafetyMode::kHold);
  CHECK(tick(ladder, Fault::kStateStale) == SafetyMode::kDamp);
  ladder.report(Fault::kStateStale);
  CHECK(ladder.step(kDampTicks) == SafetyMode::kStop);
}

TEST_CASE("AHoldTimeOfZeroDampsAtOnce") {
  FaultLadder ladder({.hold_time = 0.0, .damp_time = 0.05});
  CHECK(tick(ladder, Fault::kStateStale) == SafetyMode::kDamp);
}

TEST_CASE("AGoodTickLeadsFromHoldAndFromDampBackToRunAndTheTimesStartAgain") {
  for (const Fault fault : kPassing) {
    CAPTURE(static_cast<int>(fault));
    FaultLadder ladder(kConfig);
    for (int round = 0; round < 3; ++round) {
      for (int k = 0; k < kHoldTicks; ++k) CHECK(tick(ladder, fault) == SafetyMode::kHold);
      CHECK(tick(ladder) == SafetyMode::kRun);
    }
    for (int k = 0; k < kHoldTicks; ++k) CHECK(tick(ladder, fault) == SafetyMode::kHold);
    for (int k = 0; k < kDampTicks; ++k) CHECK(tick(ladder, fault) == SafetyMode::kDamp);
    CHECK_FALSE(ladder.latched());
    CHECK(tick(ladder, fault) == SafetyMode::kStop);

    FaultLadder damped(kConfig);
    for (int k = 0; k < kHoldTicks + 1; ++k) tick(damped, fault);
    CHECK(damped.mode() == SafetyMode::kDamp);
    CHECK(tick(damped) == SafetyMode::kRun);
  }
}

TEST_CASE("AFallenRobotAndAnOperatorsStopDampAtOnceAndStay") {
  for (const Fault fault : kLatching) {
    CAPTURE(static_cast<int>(fault));
    FaultLadder ladder(kConfig);
    CHECK(tick(ladder) == SafetyMode::kRun);
    CHECK(tick(ladder, fault) == SafetyMode::kDamp);
    CHECK(ladder.latched());
    for (int k = 1; k < kDampTicks; ++k) CHECK(tick(ladder) == SafetyMode::kDamp);
    for (int k = 0; k < 100; ++k) CHECK(tick(ladder) == SafetyMode::kStop);
    CHECK(count(ladder, fault) == 1);
  }
}

TEST_CASE("ALatchingFaultDampsFromHoldAndInDampKeepsTheTime") {
  FaultLadder held(kConfig);
  CHECK(tick(held, Fault::kStateStale) == SafetyMode::kHold);
  CHECK(tick(held, Fault::kRobotFallen) == SafetyMode::kDamp);
  CHECK(held.latched());

  FaultLadder damped(kConfig);
  for (int k = 0; k < kHoldTicks + 1; ++k) tick(damped, Fault::kStateStale);
  REQUIRE(damped.mode() == SafetyMode::kDamp);
  for (int k = 1; k < kDampTicks; ++k) CHECK(tick(damped, Fault::kOperatorStop) == SafetyMode::kDamp);
  CHECK(tick(damped, Fault::kOperatorStop) == SafetyMode::kStop);
}

TEST_CASE("AStoppedLadderStaysStoppedAndIsLatched") {
  FaultLadder ladder(kConfig);
  while (tick(ladder, Fault::kStateStale) != SafetyMode::kStop) continue;
  CHECK(ladder.latched());
  for (int k = 0; k < 100; ++k) CHECK(tick(ladder) == SafetyMode::kStop);
}

TEST_CASE("HarmlessFaultsCountAndLetItRun") {
  for (const Fault fault : kHarmless) {
    CAPTURE(static_cast<int>(fault));
    FaultLadder ladder(kConfig);
    for (int k = 1; k <= 20; ++k) {
      CHECK(tick(ladder, fault) == SafetyMode::kRun);
      CHECK(count(ladder, fault) == k);
    }
  }
}

TEST_CASE("EachKindCountsOnceATickAndTheBitsAreThatTicks") {
  FaultLadder ladder(kConfig);
  ladder.report(Fault::kTorqueSaturated);
  ladder.report(Fault::kTorqueSaturated);
  ladder.report(Fault::kJointLimit);
  tick(ladder);
  CHECK(ladder.faults() == ((1U << 6) | (1U << 7)));
  CHECK(count(ladder, Fault::kTorqueSaturated) == 1);
  CHECK(count(ladder, Fault::kJointLimit) == 1);
  tick(ladder);
  CHECK(ladder.faults() == 0);
  CHECK(count(ladder, Fault::kTorqueSaturated) == 1);

  for (int k = 0; k < 20; ++k) tick(ladder, Fault::kStateStale);
  CHECK(ladder.mode() == SafetyMode::kStop);
  CHECK(count(ladder, Fault::kStateStale) == 20);
}

TEST_CASE("TimesOutOfRangeAreRefusedByName") {
  using Catch::Matchers::ContainsSubstring;
  using Catch::Matchers::MessageMatches;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {-0.01, 0.21, nan, infinity}) {
    CHECK_THROWS_MATCHES(FaultLadder({.hold_time = bad, .damp_time = 1.0}), std::invalid_argument,
                         MessageMatches(ContainsSubstring("safety.hold_time is") && ContainsSubstring("0..0.2")));
  }
  for (const double bad : {-1.0, 0.0, nan, infinity}) {
    CHECK_THROWS_MATCHES(FaultLadder({.hold_time = 0.03, .damp_time = bad}), std::invalid_argument,
                         MessageMatches(ContainsSubstring("safety.damp_time is") && ContainsSubstring("> 0")));
  }
}

}  // namespace stance::safety
