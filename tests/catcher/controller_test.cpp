#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <limits>
#include <stance_msgs/stop_t.hpp>

#include "tests/catcher/rig.hpp"

namespace stance::test {
namespace {

constexpr double kEnd = 3.5;  // s: the ball has been taken away

sim::Scenario nominal(std::uint64_t seed) { return sim::load_scenario(catcher(), "throw", seed); }

}  // namespace

TEST_CASE("ABallSeenWithoutNoiseIsCaughtOnTheCupsAxisAndStays") {
  CatcherRig rig;
  rig.tick_until(kEnd);
  REQUIRE(rig.simulator.throws().size() == 1);
  const auto& thrown = rig.simulator.throws()[0];
  CHECK(thrown.verdict == stance_msgs::ball_truth_t::CAUGHT);
  CHECK(thrown.crossing_offset < 0.002);
  CHECK(thrown.plan_cup_error < 0.02);
  CHECK(thrown.plan_ball_error < 1e-3);
  CHECK(rig.trace().fault_count == std::array<std::int64_t, kNumFaults>{});
}

TEST_CASE("AfterACatchTheArmGoesBackToItsPlaceAndCatchesTheNextBall") {
  sim::Scenario scenario = quiet();
  scenario.throws.push_back(scenario.throws[0]);
  scenario.throws[1].time = 4.5;
  scenario.throws[1].aim_W.y() = 0.15;
  CatcherRig rig(scenario);
  rig.tick_until(4.4);
  CHECK(rig.plan().phase == CatchPhase::kWaiting);
  CHECK((rig.true_q() - catcher().nominal_joint_position).norm() < 0.01);
  rig.tick_until(4.5 + 0.8 + 1.3);
  REQUIRE(rig.simulator.throws().size() == 2);
  for (const auto& thrown : rig.simulator.throws()) CHECK(thrown.crossed == 1);
}

TEST_CASE("ThePlanNeverAsksOfTheJointsMoreThanTheirLimits") {
  const config::RobotDescription robot = catcher();
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CatcherRig rig(nominal(seed));
    JointVector before = rig.true_q();
    while (rig.simulator.time() < 2.2) {
      rig.tick();
      const CatchPlan& plan = rig.plan();
      for (int i = 0; i < robot.model.num_joints; ++i) {
        const auto& joint = robot.model.joints[static_cast<std::size_t>(i)];
        CHECK(plan.q_ref[i] > joint.lower);
        CHECK(plan.q_ref[i] < joint.upper);
        CHECK(std::abs(plan.v_ref[i]) < 0.5001 * joint.max_velocity);  // the drives' is twice the planner's
      }
      CHECK((plan.q_ref - before).cwiseAbs().maxCoeff() < 0.1);
      before = plan.q_ref;
    }
    CHECK(rig.trace().fault_count[static_cast<std::size_t>(Fault::kTorqueSaturated)] == 0);
  }
}

TEST_CASE("TheEstimateIsOfTheObservationsInstantAndHonest") {
  CatcherRig rig(nominal(3));
  double sum = 0.0;
  int count = 0;
  while (rig.simulator.time() < 1.0) {
    rig.tick();
    if (!rig.ball().updated || std::isnan(rig.ball().nis)) continue;
    sum += rig.ball().nis;
    ++count;
    CHECK(rig.ball().utime == rig.simulator.state().utime - 20'000);  // a frame late, and a period on by now
  }
  CHECK(count > 50);
  CHECK(sum / count > 0.6);
  CHECK(sum / count < 1.5);
}

TEST_CASE("StraysAndMissedFramesAreSurvived") {
  sim::Scenario scenario = quiet();
  scenario.camera.sigma = 0.01;
  scenario.camera.dropout = 0.1;
  scenario.camera.outlier_share = 0.05;
  scenario.camera.outlier_size = 0.5;
  CatcherRig rig(scenario);
  rig.tick_until(kEnd);
  CHECK(rig.simulator.throws().at(0).crossed == 1);
  CHECK(rig.plan().rejected > 0);
}

TEST_CASE("PointsThatDoNotCalibrateAreRefusedWithTheirReasonAndNothingIsCaught") {
  struct Refusal {
    std::function<void(sim::CameraModel&)> spoil;
    CalibrationState reason;
  };
  const Refusal refusals[] = {
      {[](auto& camera) { camera.points = 2; }, CalibrationState::kTooFew},
      {[](auto& camera) { camera.points_to_K = camera.points_from_K; }, CalibrationState::kDegenerate},
      {[](auto& camera) { camera.point_sigma = 0.05; }, CalibrationState::kTooRough},
      {[](auto& camera) { camera.points = 0; }, CalibrationState::kNone},
  };
  for (const auto& [spoil, reason] : refusals) {
    sim::Scenario scenario = quiet();
    spoil(scenario.camera);
    CatcherRig rig(scenario);
    rig.tick_until(1.9);
    CHECK(rig.plan().calibration == reason);
    CHECK(rig.plan().phase == CatchPhase::kUncalibrated);
    CHECK((rig.true_q() - catcher().nominal_joint_position).norm() < 0.01);
  }
}

TEST_CASE("ABallOutOfReachIsToldAsSuchAndTheArmStays") {
  sim::Scenario scenario = quiet();
  scenario.throws[0].aim_W = {0.5, 2.0, 1.0};
  CatcherRig rig(scenario);
  rig.tick_until(1.7);
  CHECK(rig.plan().status == CatchStatus::kReach);
  CHECK((rig.true_q() - catcher().nominal_joint_position).norm() < 0.01);
  rig.tick_until(kEnd);
  CHECK(rig.simulator.throws().at(0).verdict == stance_msgs::ball_truth_t::REACH);
}

TEST_CASE("WithoutAnOperatorsWordNothingIsCaught") {
  sim::Scenario scenario = quiet();
  scenario.commands.clear();
  CatcherRig rig(scenario);
  rig.tick_until(1.9);
  CHECK(rig.plan().phase == CatchPhase::kWaiting);
  CHECK((rig.true_q() - catcher().nominal_joint_position).norm() < 0.01);
}

TEST_CASE("AnOperatorsStopDampsTheArmInFlightAndStopsIt") {
  CatcherRig rig;
  rig.tick_until(1.6);
  stance_msgs::stop_t stop{};
  stop.seq = 1;
  static_cast<void>(rig.ticker.offer_stop(io::bytes_of(stop)));
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  CHECK(rig.ticker.output().command.kp.isZero());
  rig.tick_until(1.6 + 3.1);
  CHECK(rig.trace().safety == SafetyMode::kStop);
}

TEST_CASE("StatesThatAreMissingOrNoNumbersAreHeldOverAndThenDamped") {
  CatcherRig rig;
  rig.tick_until(1.4);
  const JointVector held = rig.ticker.output().command.position;
  rig.told_state = false;
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kHold);
  CHECK(rig.ticker.output().command.position == held);
  rig.told_state = true;
  rig.spoil_state = [](auto& state) { state.joint_position[1][2] = std::numeric_limits<double>::quiet_NaN(); };
  for (int k = 0; k < 5; ++k) rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kDamp);
  rig.spoil_state = nullptr;
  rig.tick();
  CHECK(rig.trace().safety == SafetyMode::kRun);
}

TEST_CASE("ObservationsThatAreNoNumbersOfTheFutureOrOfAnotherRunChangeNothing") {
  const auto plan_after = [](std::function<void(stance_msgs::ball_observation_t&)> spoil) {
    CatcherRig rig;
    rig.spoil_ball = std::move(spoil);
    rig.tick_until(1.5);
    return rig.plan();
  };
  CHECK(plan_after(nullptr).phase == CatchPhase::kCatching);
  CHECK(plan_after([](auto& b) { b.p_KBall[1] = std::numeric_limits<double>::infinity(); }).phase ==
        CatchPhase::kWaiting);
  CHECK(plan_after([](auto& b) { b.utime += 1'000'000; }).phase == CatchPhase::kWaiting);
  CHECK(plan_after([](auto& b) { b.run_id += 1; }).phase == CatchPhase::kWaiting);
}

TEST_CASE("TheSameRunGivesTheSameBytes") {
  const auto bytes = [] {
    CatcherRig rig(nominal(4));
    std::vector<std::uint8_t> all;
    while (rig.simulator.time() < 2.0) {
      rig.tick();
      for (const auto& [channel, message] : rig.ticker.published()) {
        all.insert(all.end(), message.bytes().begin(), message.bytes().end());
      }
    }
    return all;
  };
  CHECK(bytes() == bytes());
}

TEST_CASE("AConfigurationThatIsOutOfRangeOrMisspeltIsRefusedByItsKey") {
  const auto refusal = [](const std::string& from, const std::string& to) -> std::string {
    config::RobotDescription robot = catcher();
    const auto at = robot.yaml_text.find(from);
    REQUIRE(at != std::string::npos);
    robot.yaml_text.replace(at, from.size(), to);
    try {
      static_cast<void>(compose(config::robot_from_texts(robot.yaml_text, robot.urdf_text)));
    } catch (const config::ConfigError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refusal("  filter:", "  filter:").empty());
  CHECK(refusal("gate: 6.0", "gate: 0.5").find("filter.gate") != std::string::npos);
  CHECK(refusal("commit: 0.12", "commit: -1.0").find("planner.commit") != std::string::npos);
  CHECK(refusal("give: 0.4", "gives: 0.4").find("give") != std::string::npos);
  CHECK(refusal("kp: 900.0", "kp: 0").find("computed_torque.kp") != std::string::npos);
  CHECK(refusal("radius: 0.05", "radius: 0").find("cup.radius") != std::string::npos);
  CHECK(refusal("link: l5", "link: l9").find("l9") != std::string::npos);
  CHECK(refusal("max_rms: 0.01", "max_rms: 0").find("calibration.max_rms") != std::string::npos);
}

}  // namespace stance::test
