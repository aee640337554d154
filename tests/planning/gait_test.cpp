// The gait on a pendulum that does what it is told: no robot.
#include "controller/planning/gait.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <vector>

#include "tests/planning/planning_fixture.hpp"

namespace stance::planning {
namespace {

using test::walk_config;

constexpr double kDt = 0.01;
constexpr double kFootRadius = 0.02;  // m

/// A pendulum on point feet that follow the gait.
struct Rig {
  explicit Rig(const Vector2& velocity = Vector2::Zero(), int swing = 0)
      : gait(walk_config().gait, test::omega(), test::kHipLateral) {
    input.velocity = velocity;
    input.p_WF = {Vector3(0.0, 0.1, kFootRadius), Vector3(0.0, -0.1, kFootRadius)};
    gait.start(swing, walk_config().gait.first_double_support, input);
  }

  void tick() {
    const GaitState& state = gait.state();
    Vector2 zmp;
    if (state.phase == GaitPhase::kSingleSupport) {
      zmp = input.p_WF[static_cast<std::size_t>(state.support())].head<2>();
    } else {
      const Vector2 from = input.p_WF[static_cast<std::size_t>(state.swing)].head<2>();
      const Vector2 to = input.p_WF[static_cast<std::size_t>(state.support())].head<2>();
      zmp = from + (to - from) * std::min(1.0, (state.time + 0.5 * kDt) / state.double_support);
    }
    input.com = swung(input.com, zmp, gait.omega(), kDt);
    if (state.phase == GaitPhase::kSingleSupport) {
      // The foot is where its reference is, and closes its switch on the ground.
      const auto i = static_cast<std::size_t>(state.swing);
      input.p_WF[i] = gait.swing().p;
      const double ground = kFootRadius + slope * input.p_WF[i].x();
      input.contact_switch[i] = input.p_WF[i].z() <= ground;
      input.p_WF[i].z() = std::max(input.p_WF[i].z(), ground);
    }
    gait.step(input, kDt);
  }

  double slope = 0.0;  // of the ground, along x
  GaitInput input;
  Gait gait;
};

}  // namespace

TEST_CASE("TheFeetLiftInTurnForTheTimesPlanned") {
  Rig rig;
  std::vector<int> lifted;
  GaitPhase last = GaitPhase::kDoubleSupport;
  for (int k = 0; k < 400; ++k) {
    rig.tick();
    const GaitState& state = rig.gait.state();
    if (state.phase == GaitPhase::kSingleSupport && last == GaitPhase::kDoubleSupport) lifted.push_back(state.swing);
    CHECK((state.stance(0) || state.stance(1)));
    CHECK(state.stance(state.support()));
    last = state.phase;
  }
  REQUIRE(lifted.size() > 12);
  for (std::size_t i = 0; i < lifted.size(); ++i) CHECK(lifted[i] == static_cast<int>(i % 2));
  CHECK(rig.gait.state().steps >= static_cast<int>(lifted.size()) - 1);
}

TEST_CASE("AWalkGoesAtTheSpeedThatIsWanted") {
  for (const Vector2& velocity : {Vector2(0.0, 0.0), Vector2(0.5, 0.0), Vector2(-0.4, 0.0), Vector2(0.0, 0.2)}) {
    CAPTURE(velocity.transpose());
    Rig rig(velocity);
    for (int k = 0; k < 300; ++k) rig.tick();
    const Vector2 before = rig.input.com.p;
    constexpr int ticks = 480;
    for (int k = 0; k < ticks; ++k) rig.tick();
    CHECK(((rig.input.com.p - before) / (ticks * kDt) - velocity).norm() < 0.06);
  }
}

TEST_CASE("AHardPushMakesTheGaitRecoverAndThenItIsSteadyAgain") {
  for (const Vector2& push : {Vector2(1.2, 0.0), Vector2(-1.2, 0.0), Vector2(0.0, -1.0)}) {
    CAPTURE(push.transpose());
    Rig rig;
    for (int k = 0; k < 200; ++k) rig.tick();
    CHECK_FALSE(rig.gait.state().recovering);
    rig.input.com.v += push;
    bool recovered = false;
    for (int k = 0; k < 300; ++k) {
      rig.tick();
      recovered = recovered || rig.gait.state().recovering;
    }
    CHECK(recovered);
    CHECK_FALSE(rig.gait.state().recovering);
    const Vector2 middle = 0.5 * (rig.input.p_WF[0] + rig.input.p_WF[1]).head<2>();
    CHECK((rig.input.com.divergent(rig.gait.omega()) - middle).norm() < 0.2);
  }
}

TEST_CASE("ASwitchThatClosesEarlyInTheSwingIsNoTouchdown") {
  Rig rig;
  while (rig.gait.state().phase != GaitPhase::kSingleSupport) rig.tick();
  rig.tick();
  rig.input.contact_switch = {true, true};
  rig.gait.step(rig.input, kDt);
  CHECK(rig.gait.state().phase == GaitPhase::kSingleSupport);
  CHECK(rig.gait.state().steps == 0);
}

TEST_CASE("AFootThatScuffsOnItsWayHasNotLandedUntilItIsSlow") {
  Rig rig;
  while (rig.gait.state().phase != GaitPhase::kSingleSupport) rig.tick();
  const GaitConfig& config = rig.gait.config();
  while (rig.gait.state().time < 0.8 * config.footholds.swing_time) rig.tick();
  const auto swing = static_cast<std::size_t>(rig.gait.state().swing);
  rig.input.contact_switch[swing] = true;
  rig.input.p_WF[swing].x() += 1.1 * config.touchdown_speed * kDt;
  rig.gait.step(rig.input, kDt);
  CHECK(rig.gait.state().phase == GaitPhase::kSingleSupport);
  rig.input.p_WF[swing].x() += 0.9 * config.touchdown_speed * kDt;
  rig.gait.step(rig.input, kDt);
  CHECK(rig.gait.state().phase == GaitPhase::kDoubleSupport);
  CHECK(rig.gait.state().steps == 1);
}

TEST_CASE("TheLoadLeavesTheFootThatIsAboutToLift") {
  Rig rig;
  double last = 1.0;
  CHECK(rig.gait.state().load(0) == 1.0);
  while (rig.gait.state().phase == GaitPhase::kDoubleSupport) {
    CHECK(rig.gait.state().load(0) <= last);
    CHECK(rig.gait.state().load(1) == 1.0);
    last = rig.gait.state().load(0);
    rig.tick();
  }
  CHECK(last < 0.2);
  CHECK(rig.gait.state().load(0) == 0.0);
  CHECK(rig.gait.state().load(1) == 1.0);
}

TEST_CASE("TheSlopeIsLearntFromTouchdowns") {
  for (const double slope : {0.15, -0.1}) {
    Rig rig({0.5, 0.0});
    rig.slope = slope;
    for (int k = 0; k < 1500; ++k) rig.tick();
    CHECK(std::abs(rig.gait.state().slope - slope) < 0.05 * std::abs(slope));
  }
}

}  // namespace stance::planning
