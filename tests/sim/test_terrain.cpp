#include <algorithm>
#include <array>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <vector>

#include "sim/initial_state.hpp"
#include "sim/random.hpp"
#include "sim/terrain.hpp"
#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

using Eigen::Vector2d;

constexpr double kRadius = 0.02;  // m, of a ball
constexpr double kMass = 5.0;     // kg
constexpr double kSlop = 1e-5;    // m, by which what rests is in the ground

TerrainModel tiled(double size, double height) {
  return {.slope = {0.0, 0.0}, .tile_size = size, .tile_height = height};
}
TerrainModel sloped(double x, double y) { return {.slope = {x, y}}; }

/// A ball as a robot whose base is its one foot, at rest on the ground at `p` [m].
WorldSetup ball(const Terrain& terrain, const Vector2d& p, double friction) {
  WorldSetup setup;
  setup.model.name = "ball";
  setup.model.bodies[0] = {"ball", kMass, Vector3::Zero(), 0.4 * kMass * kRadius * kRadius * Matrix3::Identity()};
  setup.model.total_mass = kMass;
  setup.feet = {{0, Vector3::Zero(), kRadius}};
  setup.shapes = {{.body = 0, .kind = rigid_body::ShapeKind::kSphere, .size = {kRadius, 0.0, 0.0}}};
  setup.friction = friction;
  setup.terrain = terrain;
  setup.initial.p_WB << p, terrain.height(p) + (kRadius - kSlop) / terrain.normal().z();
  return setup;
}

/// Middle of the level part of tile (i, j).
Vector2d middle(double size, int i, int j) { return size * Vector2d(i + 0.375, j + 0.375); }

}  // namespace

TEST_CASE("EachTileIsLevelAtAHeightUniformInItsRange") {
  constexpr double size = 0.2, height = 0.03;
  const Terrain terrain(tiled(size, height), 7);
  std::array<int, 6> counts{};
  double product = 0.0;
  constexpr int span = 40;
  for (int i = -span; i < span; ++i) {
    for (int j = -span; j < span; ++j) {
      const double z = terrain.height(middle(size, i, j));
      for (const Vector2d& corner :
           {Vector2d(0.01, 0.01), Vector2d(0.74, 0.01), Vector2d(0.01, 0.74), Vector2d(0.74, 0.74)}) {
        CHECK(std::abs(terrain.height(size * (Vector2d(i, j) + corner)) - z) < 1e-15);
      }
      REQUIRE(std::abs(z) <= height);
      product += z * terrain.height(middle(size, i + 1, j));
      if (i >= -2 && i < 2 && j >= -2 && j < 2) continue;
      ++counts[static_cast<std::size_t>((z + height) / (2.0 * height) * 6.0)];
    }
  }
  constexpr double tiles = 4.0 * span * span;
  for (const int count : counts) CHECK(std::abs(count - tiles / 6.0) < 5.0 * std::sqrt(tiles * 5.0 / 36.0));
  // Neighbours know nothing of each other: the correlation's standard deviation is 1 / sqrt(tiles).
  CHECK(std::abs(product / tiles) < 5.0 / std::sqrt(tiles) * height * height / 3.0);
}

TEST_CASE("TilesRampToTheirNeighboursAndNowhereJump") {
  constexpr double size = 0.2;
  const Terrain terrain(tiled(size, 0.03), 7);
  const double from = terrain.height(middle(size, 5, 8)), to = terrain.height(middle(size, 6, 8));
  REQUIRE(from != to);
  const double y = middle(size, 5, 8).y();
  for (const double share : {0.0, 0.25, 0.5, 1.0}) {
    const double x = size * (5.75 + 0.25 * share);
    CHECK(std::abs(terrain.height({x, y}) - (from + share * (to - from))) < 1e-12);
  }
  // Ramps of 6 cm at most over 5 cm, along x and y at once at worst.
  constexpr double steepest = 2.0 * 0.06 / 0.05, step = 1e-3;
  for (int line = 0; line < 20; ++line) {
    for (int k = 0; k < 2000; ++k) {
      const Vector2d p(-1.0 + k * step, 0.9 + 0.0137 * line), q = p + Vector2d(step, 0.3 * step);
      REQUIRE(std::abs(terrain.height(q) - terrain.height(p)) <= steepest * (q - p).norm());
    }
  }
}

TEST_CASE("TheGroundIsLevelWithin35CentimetresOfTheStart") {
  for (const double size : {0.1, 0.2, 0.5}) {
    const Terrain terrain(tiled(size, 0.03), 3);
    for (double x = -0.349; x < 0.35; x += 0.01) {
      for (double y = -0.349; y < 0.35; y += 0.01) REQUIRE(terrain.height({x, y}) == 0.0);
    }
    double highest = 0.0;
    for (double x = -2.0; x < 2.0; x += 0.05) highest = std::max(highest, terrain.height({x, 1.5}));
    CHECK(highest > 0.01);
  }
}

TEST_CASE("TheSameSeedGivesTheSameGroundEverywhereAndAnotherDoesNot") {
  const Terrain one(tiled(0.2, 0.03), 7), same(tiled(0.2, 0.03), 7), other(tiled(0.2, 0.03), 8);
  int equal = 0;
  for (const double x : {-3000.0, -31.4, 1.0, 2.7, 500.0}) {
    for (const double y : {-0.9, 0.8, 77.0}) {
      CHECK(one.height({x, y}) == same.height({x, y}));
      if (one.height({x, y}) == other.height({x, y})) ++equal;
    }
  }
  CHECK(equal == 0);
}

TEST_CASE("TrianglesLieOnTheGroundAndLeaveNoHole") {
  TerrainModel model = tiled(0.2, 0.05);
  model.slope = {0.1, -0.2};
  const Terrain terrain(model, 5);
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Vector2d low(4.0 * random.uniform() - 2.0, 4.0 * random.uniform() - 2.0);
    const Vector2d high = low + 0.3 * Vector2d(random.uniform(), random.uniform());
    double area = 0.0;  // m^2
    Vector2d least = low, most = high;
    terrain.triangles(low, high, [&](const std::array<Vector3, 3>& corners) {
      Vector3 centre = Vector3::Zero();
      for (const Vector3& corner : corners) {
        CHECK(std::abs(corner.z() - terrain.height(corner.head<2>())) < 1e-12);
        CHECK(corner.z() <= terrain.highest(corner.head<2>(), corner.head<2>()) + 1e-12);
        centre += corner / 3.0;
        least = least.cwiseMin(corner.head<2>());
        most = most.cwiseMax(corner.head<2>());
      }
      CHECK(std::abs(centre.z() - terrain.height(centre.head<2>())) < 1e-12);
      const Vector3 u = corners[1] - corners[0], v = corners[2] - corners[0];
      area += 0.5 * (u.x() * v.y() - u.y() * v.x());
    });
    CHECK(std::abs(area - (most - least).prod()) < 1e-12);
  }
}

TEST_CASE("ABallOnAFrictionlessSlopeBearsItsNormalForceAndKeepsItsEnergy") {
  for (const Vector2d& slope : {Vector2d(0.17, 0.0), Vector2d(0.0, -0.17), Vector2d(0.1, 0.12)}) {
    const Terrain terrain(sloped(slope.x(), slope.y()), 1);
    World world(ball(terrain, {0.3, -0.2}, 0.0));
    const Vector3 normal = terrain.normal();
    const double start = world.mechanics().energy;
    constexpr int steps = 300;
    for (int i = 0; i < steps; ++i) {
      world.step(JointVector::Zero(), {});
      const Vector3 expected = kMass * kGravity * normal.z() * normal;
      REQUIRE((world.foot_force_W()[0] - expected).norm() < 1e-6 * expected.norm());
    }
    const Vector3 along = Vector3(0.0, 0.0, -kGravity) + kGravity * normal.z() * normal;
    CHECK((world.state().v_WB - along * steps * kPhysicsStep).norm() < 1e-6);
    CHECK(std::abs(world.state().p_WB.dot(normal) - kRadius + kSlop) < 1e-6);
    // Stepping velocities before positions costs m g^2 sin^2 dt t / 2 of a slide.
    const double lost = 0.5 * kMass * along.squaredNorm() * kPhysicsStep * steps * kPhysicsStep;
    CHECK(std::abs(world.mechanics().energy - start + lost) < 1e-3 * lost);
  }
}

TEST_CASE("ABallRestsOnEachTileAndBearsItsWeight") {
  constexpr double size = 0.2;
  const Terrain terrain(tiled(size, 0.05), 11);
  for (int i = -4; i < 5; ++i) {
    const Vector2d p = middle(size, 3 * i, 7 - i);
    WorldSetup setup = ball(terrain, p, 0.7);
    setup.initial.p_WB.z() += 0.01;
    World world(setup);
    for (int k = 0; k < 500; ++k) world.step(JointVector::Zero(), {});
    CHECK(std::abs(world.state().p_WB.z() - terrain.height(p) - kRadius + kSlop) < 1e-6);
    CHECK((world.foot_force_W()[0] - Vector3(0.0, 0.0, kMass * kGravity)).norm() < 1e-3);
  }
}

TEST_CASE("NothingTripsABallOnLevelTiles") {
  const Terrain terrain(tiled(0.2, 0.0), 1);
  WorldSetup sliding = ball(terrain, {0.301, 0.413}, 0.0);
  const Vector3 velocity(0.5, 0.31, 0.0);
  sliding.initial.v_WB = velocity;
  World world(sliding);
  for (int i = 0; i < 1000; ++i) {
    world.step(JointVector::Zero(), {});
    REQUIRE((world.foot_force_W()[0] - Vector3(0.0, 0.0, kMass * kGravity)).norm() < 1e-6);
  }
  CHECK((world.state().v_WB - velocity).norm() < 1e-9);
  // Dropped beside the edges of its triangles, it goes straight down.
  for (double x = 0.3; x < 0.62; x += 0.0037) {
    WorldSetup dropped = ball(terrain, {x, 0.413}, 0.7);
    dropped.initial.p_WB.z() += 0.005;
    dropped.initial.v_WB.z() = -1.5;
    World drop(dropped);
    for (int i = 0; i < 20; ++i) drop.step(JointVector::Zero(), {});
    CHECK(drop.foot_force_W()[0].z() > 0.0);
    CHECK(drop.state().v_WB.head<2>().norm() < 1e-9);
  }
}

TEST_CASE("ContactsAreOneOnALevelOneOnARidgeAndTwoInAValley") {
  constexpr double size = 0.2, height = 0.05;
  const Terrain terrain(tiled(size, height), 11);
  Random random(2);
  int ridges = 0, valleys = 0;
  std::vector<GroundContact> contacts;
  for (int trial = 0; trial < 300; ++trial) {
    const Vector2d p(1.0 + 3.0 * random.uniform(), 1.0 + 3.0 * random.uniform());
    const Vector3 centre(p.x(), p.y(), terrain.height(p) + kRadius);
    terrain.contacts(centre, 1.2 * kRadius, contacts);
    REQUIRE_FALSE(contacts.empty());
    // The nearest ground, found by looking everywhere about.
    double nearest = kRadius;
    for (double x = -kRadius; x <= kRadius; x += 1e-3) {
      for (double y = -kRadius; y <= kRadius; y += 1e-3) {
        const Vector2d at = p + Vector2d(x, y);
        nearest = std::min(nearest, (Vector3(at.x(), at.y(), terrain.height(at)) - centre).norm());
      }
    }
    double least = kRadius;
    for (const GroundContact& contact : contacts) {
      CHECK(std::abs(contact.point.z() - terrain.height(contact.point.head<2>())) < 1e-9);
      CHECK((contact.point + contact.distance * contact.normal - centre).norm() < 1e-12);
      CHECK(contact.normal.z() > 0.0);
      least = std::min(least, contact.distance);
    }
    CHECK(least <= nearest + 1e-12);
    CHECK(least > nearest - 1e-3);  // the grid passes by the nearest point
  }
  // Along x at the middle of a row of tiles the ground is level, then a ramp: at its foot two contacts, at its top one.
  for (int i = 5; i < 40; ++i) {
    const double y = middle(size, i, 5).y(), foot = size * (i + 0.75), top = size * (i + 1.0);
    const double rise = terrain.height({top, y}) - terrain.height({foot, y});
    if (std::abs(rise) < 0.01) continue;
    const double low = rise > 0.0 ? foot : top, high = rise > 0.0 ? top : foot;
    // Off the ramp by less than the sphere's part that meets it.
    const double beside = (rise > 0.0 ? -1.0 : 1.0) * 1e-3;
    terrain.contacts({low + beside, y, terrain.height({low, y}) + kRadius}, 1.01 * kRadius, contacts);
    CHECK(contacts.size() == 2);
    ++valleys;
    terrain.contacts({high, y, terrain.height({high, y}) + kRadius}, 1.01 * kRadius, contacts);
    CHECK(contacts.size() == 1);
    ++ridges;
  }
  CHECK(ridges > 10);
  CHECK(valleys > 10);
}

TEST_CASE("TilesOfNoHeightBearTheBipedAsThePlaneDoes") {
  WorldSetup setup = test::biped_world(0.82);
  setup.initial.v_WB = {0.3, 0.1, 0.0};
  setup.terrain = Terrain(tiled(0.2, 0.0), 1);
  World tiles(setup);
  setup.terrain = Terrain();
  World plane(setup);
  JointVector kp, kd;
  kp << 300.0, 300.0, 300.0, 60.0, 300.0, 300.0, 300.0, 60.0;
  kd << 5.0, 5.0, 3.0, 0.4, 5.0, 5.0, 3.0, 0.4;
  Vector3 on_tiles = Vector3::Zero(), on_plane = Vector3::Zero();
  for (int i = 0; i < 300; ++i) {
    for (World* world : {&tiles, &plane}) {
      const auto& state = world->state();
      world->step(kp.cwiseProduct(setup.initial.q - state.q) - kd.cwiseProduct(state.qd), {});
      (world == &tiles ? on_tiles : on_plane) += (world->foot_force_W()[0] + world->foot_force_W()[1]) * kPhysicsStep;
    }
  }
  CHECK(on_plane.z() > 20.0);
  INFO("impulses " << on_tiles.transpose() << " and " << on_plane.transpose());
  INFO("places " << tiles.state().p_WB.transpose() << " and " << plane.state().p_WB.transpose());
  CHECK((on_tiles - on_plane).norm() < 1e-9 * on_plane.norm());
  CHECK((tiles.state().p_WB - plane.state().p_WB).norm() < 1e-9);
}

TEST_CASE("EveryFootStartsAtItsClearanceOverASlope") {
  const config::RobotDescription robot = test::biped();
  const InitialState flat = test::biped_scenario("stand").initial;
  for (const Vector2d& slope : {Vector2d(0.0, 0.0), Vector2d(0.17, 0.0), Vector2d(0.0, 0.17), Vector2d(-0.1, -0.3)}) {
    for (const double yaw : {0.0, 0.6, -2.0}) {
      InitialState initial = flat;
      initial.roll_pitch_yaw.z() = yaw;
      const Terrain terrain(sloped(slope.x(), slope.y()), 1);
      const rigid_body::State state = initial_state(robot, initial, terrain);
      const ContactVectors tips = foot_tips(robot.model, robot.feet, state);
      Vector3 mean = Vector3::Zero();
      for (std::size_t i = 0; i < 2; ++i) {
        CHECK(std::abs(tips[i].dot(terrain.normal()) - robot.feet[i].radius - initial.foot_clearance) < 1e-9);
        mean += 0.5 * tips[i];
      }
      CHECK(mean.head<2>().norm() < 1e-12);
      CHECK((state.R_WB - math::rotation_z(yaw)).norm() < 1e-12);
      for (int i = 0; i < robot.model.num_joints; ++i) {
        const auto& joint = robot.model.joints[static_cast<std::size_t>(i)];
        CHECK(state.q[i] > joint.lower);
        CHECK(state.q[i] < joint.upper);
      }
    }
  }
  InitialState rolled = flat;
  rolled.roll_pitch_yaw.x() = 0.1;
  const ContactVectors tips = foot_tips(robot.model, robot.feet, initial_state(robot, rolled, Terrain()));
  const double lowest = std::min(tips[0].z(), tips[1].z());
  CHECK(std::abs(lowest - robot.feet[0].radius - rolled.foot_clearance) < 1e-12);
}

TEST_CASE("TheSingleBodyTakesFlatGroundOnly") {
  Scenario scenario = test::biped_scenario("single_body");
  CHECK_NOTHROW(Simulator(test::biped(), scenario, {}));
  scenario.terrain = sloped(0.1, 0.0);
  CHECK_THROWS_AS(Simulator(test::biped(), scenario, {}), std::invalid_argument);
}

}  // namespace stance::sim
