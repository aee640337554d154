#include <algorithm>
#include <array>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <vector>

#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

// Conserved over 0.5 s of tumbling flight at 1 ms. Energy is over the ground, from a height of 3 m: stepping velocities
// before positions costs m g^2 dt t / 2 = 0.32 J of any free fall, and momentum drifts with the square of the rates.
constexpr double kEnergyTolerance = 1e-3;
constexpr double kMomentumTolerance = 1e-4;
constexpr double kAngularMomentumTolerance = 1e-3;
// Impulse of the contacts and of gravity against the change of momentum that they make, relative to the contacts', once
// these have borne the robot's weight for 0.2 s.
constexpr double kImpulseTolerance = 1e-4;

constexpr int kHalfSecond = 500;  // physics steps

/// Holds the nominal pose. The gains stay below what the light links bear at 1 kHz.
JointVector hold(const WorldSetup& setup, const rigid_body::State& state) {
  JointVector kp, kd;
  kp << 300.0, 300.0, 300.0, 60.0, 300.0, 300.0, 300.0, 60.0;
  kd << 5.0, 5.0, 3.0, 0.4, 5.0, 5.0, 3.0, 0.4;
  return kp.cwiseProduct(setup.initial.q - state.q) - kd.cwiseProduct(state.qd);
}

WorldSetup tumbling() {
  WorldSetup setup = test::biped_world(3.0);
  setup.initial.R_WB = math::rotation_from_rpy({0.3, -0.5, 1.0});
  setup.initial.v_WB = {0.5, -0.3, 1.0};
  setup.initial.w_WB_W = {-1.0, 1.0, 0.5};
  setup.initial.qd << 0.5, -0.5, 0.5, 0.5, -0.5, 0.5, -0.5, 0.5;
  return setup;
}

}  // namespace

TEST_CASE("TumblingFlightConservesEnergyMomentumAndAngularMomentum") {
  const WorldSetup setup = tumbling();
  World world(setup);
  const Mechanics start = world.mechanics();
  for (int i = 0; i < kHalfSecond; ++i) world.step(JointVector::Zero(), {});
  const Mechanics end = world.mechanics();
  const Vector3 fallen(0.0, 0.0, -kGravity * kHalfSecond * kPhysicsStep);
  const Vector3 momentum_error = setup.model.total_mass * (end.v_WC - start.v_WC - fallen);
  INFO("energy " << start.energy << " -> " << end.energy << " J");
  INFO("momentum error " << momentum_error.transpose());
  INFO("angular momentum " << start.L_C_W.transpose() << " -> " << end.L_C_W.transpose());
  CHECK(std::abs(end.energy - start.energy) < kEnergyTolerance * start.energy);
  CHECK(momentum_error.norm() < kMomentumTolerance * setup.model.total_mass * end.v_WC.norm());
  CHECK((end.L_C_W - start.L_C_W).norm() < kAngularMomentumTolerance * start.L_C_W.norm());
}

TEST_CASE("APushOf50NFor100msGives5Ns") {
  WorldSetup setup = test::biped_world(20.0);
  World pushed(setup);
  World left_alone(setup);
  for (int i = 0; i < 100; ++i) {
    pushed.step(JointVector::Zero(), {{30.0, 40.0, 0.0}, Vector3::Zero()});
    left_alone.step(JointVector::Zero(), {});
  }
  const Vector3 gained = setup.model.total_mass * (pushed.mechanics().v_WC - left_alone.mechanics().v_WC);
  CHECK(std::abs(gained.norm() - 5.0) < 1e-3);
  CHECK((gained - Vector3(3.0, 4.0, 0.0)).norm() < 1e-3);
}

TEST_CASE("ContactImpulseBalancesTheChangeOfMomentum") {
  // A fall from 2 cm with a sideways and forward drift: landing, slipping and rolling.
  WorldSetup setup = test::biped_world(0.84);
  setup.initial.v_WB = {0.4, -0.2, 0.0};
  World world(setup);
  const Vector3 start = setup.model.total_mass * world.mechanics().v_WC;
  const Vector3 gravity(0.0, 0.0, -kGravity * setup.model.total_mass);
  Vector3 impulse = Vector3::Zero();
  double contact_impulse = 0.0;
  double largest_force = 0.0;
  for (int i = 0; i < 300; ++i) {
    world.step(hold(setup, world.state()), {});
    REQUIRE(world.body_on_ground() == -1);
    const Vector3 force = world.foot_force_W()[0] + world.foot_force_W()[1];
    impulse += (force + gravity) * kPhysicsStep;
    contact_impulse += force.norm() * kPhysicsStep;
    largest_force = std::max(largest_force, force.norm());
    const Vector3 change = setup.model.total_mass * world.mechanics().v_WC - start;
    if (contact_impulse < -0.2 * gravity.z()) continue;
    INFO("step " << i << ": impulse " << impulse.transpose() << ", change " << change.transpose());
    CHECK((change - impulse).norm() < kImpulseTolerance * contact_impulse);
  }
  CHECK(contact_impulse > 20.0);
  CHECK(largest_force > 200.0);
}

TEST_CASE("FootForcesStayInTheFrictionCone") {
  WorldSetup setup = test::biped_world(0.82);
  setup.initial.v_WB = {1.5, 0.7, 0.0};
  World world(setup);
  int slipping = 0;
  for (int i = 0; i < 200; ++i) {
    world.step(hold(setup, world.state()), {});
    for (std::size_t foot = 0; foot < setup.feet.size(); ++foot) {
      const Vector3& force = world.foot_force_W()[foot];
      const double cone = setup.friction * force.z();
      CHECK(force.head<2>().norm() <= cone * (1.0 + 1e-9) + 1e-9);
      if (force.z() > 1.0 && force.head<2>().norm() > 0.999 * cone) ++slipping;
    }
  }
  CHECK(slipping > 5);
}

TEST_CASE("RepeatedWorldsGiveTheSameBits") {
  const auto run = [] {
    World world(test::biped_world(0.82));
    for (int i = 0; i < 300; ++i) world.step(-0.5 * world.state().qd, {});
    return world.state();
  };
  const rigid_body::State a = run(), b = run();
  CHECK(a.p_WB == b.p_WB);
  CHECK(a.R_WB == b.R_WB);
  CHECK(a.q == b.q);
  CHECK(a.qd == b.qd);
}

TEST_CASE("JointsStopAtTheirLimits") {
  const WorldSetup setup = test::biped_world(20.0);
  for (const double torque : {2.0, -2.0}) {
    World world(setup);
    for (int i = 0; i < kHalfSecond; ++i) {
      world.step(JointVector::Constant(torque) - 0.3 * world.state().qd, {});
      for (int j = 0; j < setup.model.num_joints; ++j) {
        const auto& joint = setup.model.joints[static_cast<std::size_t>(j)];
        INFO(joint.name << " at " << world.state().q[j] << " in step " << i);
        CHECK(world.state().q[j] > joint.lower - 0.05);
        CHECK(world.state().q[j] < joint.upper + 0.05);
      }
    }
  }
}

TEST_CASE("ATrunkOnTheGroundIsSeen") {
  WorldSetup setup = test::biped_world(0.2);
  setup.initial.R_WB = math::rotation_from_rpy({3.0, 0.0, 0.0});
  World world(setup);
  bool seen = false;
  for (int i = 0; i < 300; ++i) {
    world.step(JointVector::Zero(), {});
    seen = seen || world.body_on_ground() == 0;
  }
  CHECK(seen);
}

TEST_CASE("ATarsusOnTheGroundIsNoFoot") {
  // The left leg's last link lies forward, level, its rod on the ground as its foot is; the right leg is folded up.
  WorldSetup setup = test::biped_world(0.0);
  setup.initial.q << 0.0, 0.3, 0.3, -0.6 - M_PI_2, 0.0, -1.2, 2.4, -1.2;
  setup.initial.p_WB.z() = setup.feet[0].radius - foot_tips(setup.model, setup.feet, setup.initial)[0].z() - 1e-4;
  World world(setup);
  const int tarsus = setup.feet[0].body;
  bool seen = false;
  for (int i = 0; i < 50; ++i) {
    world.step(hold(setup, world.state()), {});
    CHECK((world.body_on_ground() == -1 || world.body_on_ground() == tarsus));
    seen = seen || world.body_on_ground() == tarsus;
  }
  CHECK(seen);
}

namespace {

/// What collides of a robot's bodies in W: the middle lines of rods, and their radius. Balls are rods of no length.
struct Rod {
  int body = 0;
  Vector3 from = Vector3::Zero(), to = Vector3::Zero();
  double radius = 0.0;
};

std::vector<Rod> rods(const WorldSetup& setup, const rigid_body::State& state) {
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(setup.model, state, kinematics);
  std::vector<Rod> found;
  for (const auto& shape : setup.shapes) {
    if (shape.kind == rigid_body::ShapeKind::kBox) continue;
    const auto body = static_cast<std::size_t>(shape.body);
    const double half = shape.kind == rigid_body::ShapeKind::kCylinder ? 0.5 * shape.size.y() : 0.0;
    const Vector3 centre = kinematics.p_W[body] + kinematics.R_W[body] * shape.p_LS;
    const Vector3 axis = kinematics.R_W[body] * shape.R_LS.col(2);
    found.push_back({shape.body, centre - half * axis, centre + half * axis, shape.size.x()});
  }
  return found;
}

/// m, between the surfaces of two rods with rounded ends: negative where they meet.
double gap(const Rod& a, const Rod& b) {
  // The distance of the middle lines is convex along each: go to and fro between nearest points.
  const auto nearest = [](const Rod& rod, const Vector3& p) -> Vector3 {
    const Vector3 along = rod.to - rod.from;
    const double length = along.squaredNorm();
    return rod.from + (length > 0.0 ? std::clamp(along.dot(p - rod.from) / length, 0.0, 1.0) : 0.0) * along;
  };
  Vector3 p = 0.5 * (a.from + a.to), q = nearest(b, p);
  for (int i = 0; i < 60; ++i) {
    p = nearest(a, q);
    q = nearest(b, p);
  }
  return (p - q).norm() - a.radius - b.radius;
}

/// m, the least gap between the bodies of one leg and those of the other.
double gap_between_legs(const WorldSetup& setup, const rigid_body::State& state) {
  double least = 1.0;
  const auto all = rods(setup, state);
  for (const Rod& a : all) {
    for (const Rod& b : all) {
      if (a.body >= 1 && a.body <= 4 && b.body >= 5) least = std::min(least, gap(a, b));
    }
  }
  return least;
}

}  // namespace

TEST_CASE("LegsThatArePressedTogetherMeetAndKeepTheRobotsMomentum") {
  // In flight, the legs nearly straight and their hips rolled inward.
  WorldSetup setup = test::biped_world(20.0);
  setup.initial.q << 0.0, 0.0, 0.1, 0.0, 0.0, -0.1, 0.2, -0.1;
  const JointVector damping = test::biped().drives.damping;  // stable in every posture
  World world(setup);
  const Mechanics start = world.mechanics();
  double least = gap_between_legs(setup, world.state());
  REQUIRE(least > 0.1);
  for (int i = 0; i < kHalfSecond; ++i) {
    JointVector torque = 30.0 * (setup.initial.q - world.state().q) - damping.cwiseProduct(world.state().qd);
    torque[0] = -3.0 - damping[0] * world.state().qd[0];
    torque[4] = 3.0 - damping[4] * world.state().qd[4];
    world.step(torque, {});
    least = std::min(least, gap_between_legs(setup, world.state()));
  }
  const Mechanics end = world.mechanics();
  const Vector3 fallen(0.0, 0.0, -kGravity * kHalfSecond * kPhysicsStep);
  CHECK(least < 1e-4);
  CHECK(least > -5e-3);
  CHECK(gap_between_legs(setup, world.state()) < 1e-3);  // they still press
  const double moved = setup.model.total_mass * fallen.norm();
  CHECK(setup.model.total_mass * (end.v_WC - start.v_WC - fallen).norm() < kMomentumTolerance * moved);
  CHECK(end.L_C_W.norm() < 1e-3);
}

TEST_CASE("ALegsOwnLinksDoNotMeetOverTheRangesOfWalking") {
  const WorldSetup setup = test::biped_world(0.0);
  // What hard pushes at 1.6 m/s asked of each joint, and a tenth of a radian more.
  const std::array<std::array<double, 2>, 4> range = {{{-0.6, 0.6}, {-1.65, 0.95}, {0.05, 2.0}, {-1.75, 0.15}}};
  constexpr int steps = 6;
  double least = 1.0;
  rigid_body::State state;
  for (int a = 0; a <= steps; ++a) {
    for (int b = 0; b <= steps; ++b) {
      for (int c = 0; c <= steps; ++c) {
        const auto at = [&](std::size_t joint, int step) {
          return range[joint][0] + (range[joint][1] - range[joint][0]) * step / steps;
        };
        state.q << 0.0, at(1, a), at(2, b), at(3, c), 0.0, at(1, a), at(2, b), at(3, c);
        for (const Rod& one : rods(setup, state)) {
          for (const Rod& other : rods(setup, state)) {
            if (one.body >= 1 && other.body == one.body + 2 && other.body <= 4)
              least = std::min(least, gap(one, other));
          }
        }
      }
    }
  }
  CHECK(least > 0.02);
}

TEST_CASE("AtTheNominalPostureNothingMeets") {
  const WorldSetup setup = test::biped_world(20.0);
  CHECK(gap_between_legs(setup, setup.initial) > 0.1);
  // Without a contact, a step in free flight from rest turns no joint.
  World world(setup);
  for (int i = 0; i < 20; ++i) world.step(JointVector::Zero(), {});
  CHECK(world.state().qd.norm() < 1e-9);
}

TEST_CASE("TheStateMatchesTheModelsOwnKinematics") {
  // Energy is read from the model's tree and conserved by Bullet's, so equal trees are implied; here inertias off the
  // principal axes.
  WorldSetup setup = tumbling();
  for (auto& body : setup.model.bodies) {
    const Matrix3 R = math::rotation_from_rpy({0.4, 0.2, -0.7});
    body.inertia = R * body.inertia * R.transpose();
    body.com += Vector3(0.01, -0.02, 0.015);
  }
  World world(setup);
  const Mechanics start = world.mechanics();
  for (int i = 0; i < kHalfSecond; ++i) world.step(JointVector::Zero(), {});
  const Mechanics end = world.mechanics();
  CHECK(std::abs(end.energy - start.energy) < kEnergyTolerance * start.energy);
  CHECK((end.L_C_W - start.L_C_W).norm() < kAngularMomentumTolerance * start.L_C_W.norm());
}

}  // namespace stance::sim
