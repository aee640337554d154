// The ball, the camera and the judge.
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "tests/catcher/rig.hpp"

namespace stance::test {
namespace {

sim::WorldSetup world_with(const sim::BallModel& ball) {
  const config::RobotDescription robot = catcher();
  sim::WorldSetup setup;
  setup.model = robot.model;
  setup.shapes = rigid_body::collision_shapes_from_urdf(robot.urdf_text, robot.model);
  setup.floating = false;
  setup.terrain = sim::Terrain({}, 1);
  setup.initial.q = robot.nominal_joint_position;
  setup.ball = ball;
  return setup;
}

const sim::BallModel kBall{.radius = 0.01, .mass = 0.0046, .drag = 0.0, .restitution = 0.5, .friction = 0.5};

}  // namespace

TEST_CASE("AThrownBallComesByItsAimAtItsTimeWithDragAndWithout") {
  for (const double drag : {0.0, 0.02, 0.1}) {
    sim::BallModel ball = kBall;
    ball.drag = drag;
    sim::World world(world_with(ball));
    const Vector3 from(3.5, 0.5, 1.2), aim(1.5, 0.3, 0.9);
    world.throw_ball(from, sim::launch_velocity(ball, from, aim, 0.6));
    for (int k = 0; k < 600; ++k) world.step(JointVector::Zero(), {});
    CHECK((world.ball()->p_W - aim).norm() < 1e-6);
  }
  sim::BallModel feather = kBall;
  feather.drag = 1.0;
  CHECK_THROWS_AS(sim::launch_velocity(feather, {100.0, 0.0, 1.0}, {0.0, 0.0, 1.0}, 0.2), std::invalid_argument);
}

TEST_CASE("ABallLeavesTheGroundWithItsRestitution") {
  sim::World world(world_with(kBall));
  world.throw_ball({2.0, 0.0, 1.01}, Vector3::Zero());
  double down = 0.0, up = 0.0;
  for (int k = 0; k < 700; ++k) {
    world.step(JointVector::Zero(), {});
    down = std::min(down, world.ball()->v_W.z());
    up = std::max(up, world.ball()->v_W.z());
  }
  CHECK(std::abs(down + std::sqrt(2.0 * kGravity * 1.0)) < 0.05);
  CHECK(std::abs(up + 0.5 * down) < 0.15);
}

TEST_CASE("ABallThatIsTakenAwayIsNotThere") {
  sim::World world(world_with(kBall));
  CHECK_FALSE(world.ball());
  world.throw_ball({2.0, 0.0, 1.0}, Vector3::Zero());
  CHECK(world.ball());
  world.take_ball();
  CHECK_FALSE(world.ball());
  world.step(JointVector::Zero(), {});
}

TEST_CASE("TheCameraSeesTheBallInItsOwnFrameAsLateAsItIs") {
  sim::CameraModel model;
  model.latency = 2;
  model.T_WK = {math::rotation_from_rpy({-M_PI / 2.0, 0.0, 0.0}), {1.5, -2.5, 1.2}};
  sim::Camera camera(model, 1);
  camera.begin(0, 7);
  for (int k = 0; k < 10; ++k) {
    const Vector3 p_W(0.1 * k, 0.5, 1.0);
    camera.look(k, 10'000 * k, k == 5 ? std::nullopt : std::optional(p_W));
    if (k < 2) {
      CHECK(camera.observation() == nullptr);
      continue;
    }
    REQUIRE(camera.observation() != nullptr);
    const auto& seen = *camera.observation();
    CHECK(seen.utime == 10'000 * (k - 2));
    CHECK(seen.seq == k - 1);
    CHECK(seen.valid == (k == 7 ? 0 : 1));
    if (seen.valid == 0) continue;
    const Vector3 expected(0.1 * (k - 2) - 1.5, 0.2, 3.0);  // x as W's, y down, z along W's y
    CHECK((Eigen::Map<const Vector3>(seen.p_KBall) - expected).norm() < 1e-12);
  }
}

TEST_CASE("TheCamerasErrorsAreAsLargeAndAsFrequentAsTheModelSays") {
  sim::CameraModel model;
  model.sigma = 0.02;
  model.dropout = 0.2;
  sim::Camera camera(model, 3);
  camera.begin(0, 7);
  int seen = 0;
  double sum = 0.0;
  constexpr int frames = 4000;
  for (int k = 0; k < frames; ++k) {
    camera.look(k, 10'000 * k, Vector3::Zero().eval());
    if (camera.observation()->valid == 0) continue;
    ++seen;
    sum += Eigen::Map<const Vector3>(camera.observation()->p_KBall).squaredNorm() / 3.0;
  }
  CHECK(std::abs(seen / static_cast<double>(frames) - 0.8) < 0.03);
  CHECK(std::abs(std::sqrt(sum / seen) - 0.02) < 0.001);
}

TEST_CASE("ACrossingCountsFromTheFrontNearTheAxisAndAgainstIt") {
  const sim::CupPose cup{{0.0, 0.0, 1.0}, {0.0, 0.0, 1.0}};
  const auto crossed = [&](const Vector3& from, const Vector3& v) {
    sim::CatchJudge judge(0.05, 0.09);
    judge.begin();
    for (int k = 0; k < 60; ++k) judge.step(1000 * k, cup, from + 0.001 * k * v, v);
    stance_msgs::ball_truth_t told{};
    judge.tell(told);
    return told;
  };
  const auto centre = crossed({0.0, 0.0, 1.1}, {0.0, 0.0, -3.0});
  CHECK(centre.crossed == 1);
  CHECK(centre.crossing_offset < 1e-9);
  CHECK(centre.retained == 0);
  CHECK(crossed({0.049, 0.0, 1.1}, {0.0, 0.0, -3.0}).crossed == 1);
  CHECK(crossed({0.051, 0.0, 1.1}, {0.0, 0.0, -3.0}).crossed == 0);
  CHECK(crossed({0.0, 0.0, 0.9}, {0.0, 0.0, 3.0}).crossed == 0);     // from behind
  CHECK(crossed({-0.1, 0.0, 1.05}, {2.0, 0.0, -1.0}).crossed == 0);  // at 63 degrees
  CHECK(std::abs(crossed({0.03, 0.0, 1.1}, {0.0, 0.0, -3.0}).crossing_offset - 0.03) < 1e-9);
}

TEST_CASE("ABallIsRetainedAfterHalfASecondInTheCup") {
  const sim::CupPose cup{{0.0, 0.0, 1.0}, {0.0, 0.0, 1.0}};
  sim::CatchJudge judge(0.05, 0.09);
  judge.begin();
  stance_msgs::ball_truth_t told{};
  for (int k = 1; k <= 510; ++k) {
    judge.step(1000 * k, cup, {0.0, 0.0, 0.95}, Vector3::Zero());
    judge.tell(told);
    if (k == 490) CHECK(told.retained == 0);
  }
  CHECK(told.retained == 1);
}

}  // namespace stance::test
