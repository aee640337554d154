// The biped on slopes and on tiles, in the loop with the simulator.
#include <algorithm>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "tests/loop/biped_rig.hpp"

namespace stance::behaviours {
namespace {

using test::BipedRig;
using test::quiet_stand;

constexpr int kSecond = 100;  // ticks

}  // namespace

TEST_CASE("OnASlopeItStandsAndTheGroundBearsItsWeight") {
  for (const Eigen::Vector2d& slope :
       {Eigen::Vector2d(0.1, 0.0), Eigen::Vector2d(0.0, 0.17), Eigen::Vector2d(-0.1, 0.1)}) {
    CAPTURE(slope.transpose());
    sim::Scenario scenario = quiet_stand();
    scenario.terrain.slope = slope;
    BipedRig rig(scenario);
    rig.tick_times(6 * kSecond);
    Vector3 mean = Vector3::Zero();
    for (int k = 0; k < kSecond; ++k) {
      rig.tick();
      for (std::size_t foot = 0; foot < 2; ++foot) {
        const auto& force = rig.simulator.truth().f_F_W[foot];
        mean += Vector3(force[0], force[1], force[2]) / kSecond;
      }
    }
    CHECK_FALSE(rig.simulator.fallen());
    CHECK(rig.trace().behaviour == Behaviour::kStand);
    const double weight = rig.robot.model.total_mass * kGravity;
    CHECK((mean - Vector3(0.0, 0.0, weight)).norm() < 0.01 * weight);
  }
}

TEST_CASE("OnTilesItWalks") {
  sim::Scenario scenario = quiet_stand();
  scenario.terrain.tile_size = 0.2;
  scenario.terrain.tile_height = 0.02;
  BipedRig rig(scenario);
  stance_msgs::user_command_t command{};
  command.seq = 1;
  command.behaviour = stance_msgs::user_command_t::WALK;
  command.velocity[0] = 0.4;
  rig.give(command);
  double lowest = 0.0, highest = 0.0;  // m, of the feet's ground points while they bear
  for (int k = 0; k < 8 * kSecond; ++k) {
    rig.tick();
    const auto& truth = rig.simulator.truth();
    for (std::size_t foot = 0; foot < 2; ++foot) {
      if (truth.f_F_W[foot][2] < 20.0) continue;
      const double height = truth.p_WF[foot][2] - rig.robot.feet[foot].radius;
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
  }
  CHECK_FALSE(rig.simulator.fallen());
  CHECK(rig.simulator.truth().p_WC[0] > 2.0);
  CHECK(highest - lowest > 0.02);
}

}  // namespace stance::behaviours
