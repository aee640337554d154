#include "controller/planning/horizon.hpp"

#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>

#include "tests/planning/planning_fixture.hpp"

namespace stance::planning {
namespace {

constexpr double kExact = 1e-9;

struct Rig {
  Rig() : gait(test::walk_config().gait, test::omega(), test::kHipLateral), horizon(test::walk_config().horizon) {
    input.p_WF = {Vector3(0.0, 0.1, 0.02), Vector3(0.0, -0.1, 0.02)};
    gait.start(0, test::walk_config().gait.first_double_support, input);
  }
  GaitInput input;
  Gait gait;
  Horizon horizon;
};

}  // namespace

TEST_CASE_METHOD(Rig, "TheStagesFollowEachOtherAndTheirContactsAlternate") {
  for (int tick = 0; tick < 60; ++tick) {
    CAPTURE(tick);
    horizon.roll_out(gait, input.com, Vector2(0.3, 0.0), 0.2);
    const auto& stages = horizon.stages();
    REQUIRE(static_cast<int>(stages.size()) == test::walk_config().horizon.num_stages());
    bool single[2] = {false, false};
    for (std::size_t k = 0; k < stages.size(); ++k) {
      REQUIRE((stages[k].contact[0] || stages[k].contact[1]));
      for (std::size_t foot = 0; foot < 2; ++foot) single[foot] = single[foot] || !stages[k].contact[foot];
      if (k > 0) {
        REQUIRE((stages[k].start.p - stages[k - 1].end.p).norm() < kExact);
        REQUIRE((stages[k].start.v - stages[k - 1].end.v).norm() < kExact);
      }
      // The ZMP lies between the feet that stand.
      const Vector2 along = stages[k].foot[1] - stages[k].foot[0], to = stages[k].zmp - stages[k].foot[0];
      REQUIRE(std::abs(along.x() * to.y() - along.y() * to.x()) < kExact);
      const double share = to.dot(along) / along.squaredNorm();
      REQUIRE(share >= -kExact);
      REQUIRE(share <= 1.0 + kExact);
      if (!stages[k].contact[0]) REQUIRE(std::abs(share - 1.0) < kExact);
      if (!stages[k].contact[1]) REQUIRE(std::abs(share) < kExact);
    }
    CHECK((single[0] && single[1]));  // 0.46 s hold a step of each foot
    gait.step(input, 0.01);
    input.com = swung(input.com, stages.front().zmp, gait.omega(), 0.01);
  }
}

TEST_CASE_METHOD(Rig, "ASteadyWalkIsForeseenAsSteady") {
  horizon.roll_out(gait, {Vector2::Zero(), Vector2::Zero()}, Vector2::Zero(), 0.0);
  for (const HorizonStage& stage : horizon.stages()) {
    CHECK(std::abs(stage.end.p.x()) < kExact);
    CHECK(std::abs(stage.end.p.y()) < 0.1);
  }
}

}  // namespace stance::planning
