#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <cstdint>

#include "controller/centroidal/centroidal.hpp"
#include "controller/io/lcm_bytes.hpp"
#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

using io::bytes_of;
using stance_msgs::force_plan_t;
using stance_msgs::joint_command_t;
using stance_msgs::push_t;
using stance_msgs::robot_state_t;
using stance_msgs::truth_t;

Vector3 vector(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

/// A biped that is commanded to hold its pose: it stands for a while, then tips over.
struct Run {
  explicit Run(const Scenario& scenario, SimulatorOptions options = {})
      : robot(test::biped()), simulator(robot, scenario, options) {}

  void hold() { REQUIRE(simulator.accept(test::hold_command(robot, simulator)) == Acceptance::kAccepted); }

  config::RobotDescription robot;
  Simulator simulator;
};

force_plan_t plan_for(const Simulator& simulator, const Vector3& left, const Vector3& right) {
  force_plan_t plan{};
  plan.seq = simulator.state().seq + 1000;
  plan.state_seq = simulator.state().seq;
  plan.run_id = simulator.state().run_id;
  plan.num_contacts = 2;
  plan.num_stages = 1;
  for (std::size_t foot = 0; foot < 2; ++foot) {
    const Vector3& force = foot == 0 ? left : right;
    plan.contact[0][foot] = 1;
    for (int i = 0; i < 3; ++i) {
      plan.force[0][foot][i] = force[i];
      plan.p_WF[foot][i] = simulator.truth().p_WF[foot][i];
    }
  }
  return plan;
}

}  // namespace

TEST_CASE("TheFirstStateStandsInTheNominalPoseWithItsFeetInContact") {
  Run run(test::biped_scenario("stand"), {.seed = 1, .run_id = 7, .start_utime = 1'000'000, .plant = {}});
  const robot_state_t& state = run.simulator.state();
  const truth_t& truth = run.simulator.truth();
  CHECK(state.seq == 1);
  CHECK(state.run_id == 7);
  CHECK(state.utime == 1'000'000);
  CHECK(state.num_joints == 8);
  CHECK(state.num_contacts == 2);
  CHECK(truth.seq == 1);
  CHECK(truth.fallen == 0);
  CHECK(truth.drives_damped == 0);
  for (int i = 0; i < 8; ++i) {
    CHECK(state.joint_position[1][i] == run.robot.nominal_joint_position[i]);
    CHECK(truth.joint_position[i] == run.robot.nominal_joint_position[i]);
  }
  for (std::size_t foot = 0; foot < 2; ++foot) {
    CHECK(std::abs(truth.p_WF[foot][2] - (run.robot.feet[foot].radius - 0.0003)) < 1e-9);
    CHECK(state.contact_switch[1][foot] == 1);
  }
  CHECK((vector(truth.p_WF[0]) + vector(truth.p_WF[1])).head<2>().norm() < 1e-12);
  CHECK(std::abs(state.accelerometer[1][2] - kGravity) < 1e-12);
}

TEST_CASE("InstantsAreAControlPeriodApart") {
  Run run(test::biped_scenario("demo"));
  for (int k = 0; k < 5; ++k) run.simulator.advance();
  CHECK(run.simulator.state().seq == 6);
  CHECK(run.simulator.state().utime == 50'000);
  CHECK(run.simulator.truth().seq == 6);
  CHECK(run.simulator.time() == 0.05);
}

TEST_CASE("TheSameSeedGivesTheSameBitsAndAnotherDoesNot") {
  const auto run = [](std::uint64_t seed) {
    Run r(test::biped_scenario("demo"), {.seed = seed, .run_id = 1, .start_utime = 0, .plant = {}});
    std::vector<std::uint8_t> bytes;
    for (int k = 0; k < 60; ++k) {
      r.hold();
      r.simulator.advance();
      const auto state = bytes_of(r.simulator.state()), truth = bytes_of(r.simulator.truth());
      bytes.insert(bytes.end(), state.begin(), state.end());
      bytes.insert(bytes.end(), truth.begin(), truth.end());
    }
    return bytes;
  };
  const auto first = run(5);
  CHECK(first == run(5));
  CHECK(first != run(6));
}

TEST_CASE("CommandsTakeEffectAfterTheScenariosLatency") {
  for (const int latency : {0, 1, 7, 10, 14}) {
    Scenario scenario = test::biped_scenario("stand");
    scenario.command_delay_steps = latency;
    Run run(scenario);
    joint_command_t command = test::hold_command(run.robot, run.simulator);
    command.mode = joint_command_t::STOP;
    REQUIRE(run.simulator.accept(command) == Acceptance::kAccepted);
    for (int k = 0; k < 3; ++k) {
      run.simulator.advance();
      command.seq = command.state_seq = run.simulator.state().seq;
      REQUIRE(run.simulator.accept(command) == Acceptance::kAccepted);
    }
    // Now in the fourth period: this one asks for a torque.
    command.mode = joint_command_t::ACTIVE;
    command.seq = command.state_seq + 1;
    for (int i = 0; i < 8; ++i) command.kp[i] = command.kd[i] = 0.0;
    command.feedforward_torque[0] = 2.0;
    REQUIRE(run.simulator.accept(command) == Acceptance::kAccepted);
    double applied = 0.0;
    for (int k = 0; k < 2; ++k) {
      run.simulator.advance();
      applied += run.simulator.state().joint_torque[0] * kStepsPerPeriod;
    }
    INFO("latency of " << latency << " ms");
    CHECK(std::abs(applied - 2.0 * (2 * kStepsPerPeriod - latency)) < 1e-9);
  }
}

TEST_CASE("DrivesDampWithin50msWithoutACommand") {
  Run run(test::biped_scenario("stand"));
  for (int k = 0; k < 20; ++k) {
    run.hold();
    run.simulator.advance();
    CHECK(run.simulator.truth().drives_damped == 0);
  }
  int periods = 0;
  while (run.simulator.truth().drives_damped == 0) {
    run.simulator.advance();
    REQUIRE(++periods <= 5);
  }
  const JointVector damping = run.robot.drives.damping;
  // A period that is damped throughout dissipates.
  run.simulator.advance();
  const robot_state_t& state = run.simulator.state();
  double power = 0.0;
  for (int i = 0; i < 8; ++i) power += state.joint_torque[i] * state.joint_velocity[1][i];
  CHECK(damping.minCoeff() > 0.0);
  CHECK(power < 0.0);
  CHECK(run.simulator.refused().total() == 0);

  run.hold();
  run.simulator.advance();
  CHECK(run.simulator.truth().drives_damped == 0);
}

TEST_CASE("DrivesDampWhenNoCommandEverComes") {
  Run run(test::biped_scenario("stand"));
  for (int k = 0; k < 5; ++k) run.simulator.advance();
  CHECK(run.simulator.truth().drives_damped == 1);
}

TEST_CASE("TruthCountsEachKindOfRefusal") {
  Run run(test::biped_scenario("stand"));
  for (int k = 0; k < 10; ++k) {
    run.hold();
    run.simulator.advance();
  }
  run.hold();
  joint_command_t command = test::hold_command(run.robot, run.simulator);
  command.run_id += 1;
  CHECK(run.simulator.accept(command) == Acceptance::kRefusedRun);
  command = test::hold_command(run.robot, run.simulator);
  command.kp[0] = std::nan("");
  CHECK(run.simulator.accept(command) == Acceptance::kRefusedNotFinite);
  command = test::hold_command(run.robot, run.simulator);
  command.state_seq -= 1;
  CHECK(run.simulator.accept(command) == Acceptance::kRefusedOrder);
  for (int k = 0; k < 10; ++k) run.simulator.advance();
  command = test::hold_command(run.robot, run.simulator);
  command.state_seq -= 8;
  CHECK(run.simulator.accept(command) == Acceptance::kRefusedStale);
  CHECK(run.simulator.accept(command) == Acceptance::kRefusedStale);
  run.simulator.advance();
  CHECK(run.simulator.truth().refused_run == 1);
  CHECK(run.simulator.truth().refused_not_finite == 1);
  CHECK(run.simulator.truth().refused_order == 1);
  CHECK(run.simulator.truth().refused_stale == 2);
  CHECK(run.simulator.truth().drives_damped == 1);
}

TEST_CASE("ARefusedCommandChangesNothing") {
  Run spoiled(test::biped_scenario("stand"));
  Run left_alone(test::biped_scenario("stand"));
  for (Run* run : {&spoiled, &left_alone}) run->hold();
  joint_command_t command = test::hold_command(spoiled.robot, spoiled.simulator);
  command.seq += 1;
  command.feedforward_torque[0] = std::nan("");
  CHECK(spoiled.simulator.accept(command) == Acceptance::kRefusedNotFinite);
  for (Run* run : {&spoiled, &left_alone}) run->simulator.advance();
  CHECK(bytes_of(spoiled.simulator.state()) == bytes_of(left_alone.simulator.state()));
}

TEST_CASE("APushOnRequestStartsAtOnceAndGivesItsImpulse") {
  Run pushed(test::biped_scenario("stand"));
  Run left_alone(test::biped_scenario("stand"));
  Scenario flight = test::biped_scenario("stand");
  flight.initial.foot_clearance = 5.0;
  Run flying(flight), flying_alone(flight);
  push_t push{};
  push.duration = 0.1;
  push.force_W[1] = 50.0;
  REQUIRE(pushed.simulator.accept(push));
  REQUIRE(flying.simulator.accept(push));
  double impulse = 0.0;
  for (int k = 0; k < 12; ++k) {
    for (Run* run : {&pushed, &left_alone, &flying, &flying_alone}) run->simulator.advance();
    impulse += pushed.simulator.truth().push_W[1] * kControlPeriod;
    CHECK(left_alone.simulator.truth().push_W[1] == 0.0);
  }
  CHECK(std::abs(impulse - 5.0) < 1e-9);
  CHECK(pushed.simulator.truth().p_WB[1] > left_alone.simulator.truth().p_WB[1] + 0.005);
  const double mass = flying.robot.model.total_mass;
  CHECK(std::abs(mass * (flying.simulator.truth().v_WC[1] - flying_alone.simulator.truth().v_WC[1]) - 5.0) < 1e-3);

  push.force_W[0] = std::nan("");
  CHECK_FALSE(pushed.simulator.accept(push));
  push.force_W[0] = 0.0;
  push.duration = -1.0;
  CHECK_FALSE(pushed.simulator.accept(push));
  push.duration = 1.0;
  push.run_id = 99;
  CHECK_FALSE(pushed.simulator.accept(push));
}

TEST_CASE("AScheduledPushGivesItsImpulseWhateverItsTimes") {
  Scenario scenario = test::biped_scenario("stand");
  scenario.pushes = {{0.01234, 0.0567, {10.0, 0.0, 0.0}, {0.0, 0.0, 0.1}}};
  Run run(scenario);
  double impulse = 0.0;
  for (int k = 0; k < 10; ++k) {
    run.simulator.advance();
    impulse += run.simulator.truth().push_W[0] * kControlPeriod;
  }
  CHECK(std::abs(impulse - 0.567) < 1e-9);
}

TEST_CASE("TruthSaysHowFarTheContactForcesAreFromThePlan") {
  Run run(test::biped_scenario("stand"));
  run.simulator.advance();
  CHECK(run.simulator.truth().plan_seq == 0);
  CHECK(vector(run.simulator.truth().force_error[0]).norm() == 0.0);
  const Vector3 left(1.0, 2.0, 60.0), right(-1.0, 0.5, 70.0);
  const force_plan_t plan = plan_for(run.simulator, left, right);
  REQUIRE(run.simulator.accept(plan));
  run.hold();
  run.simulator.advance();
  const truth_t& truth = run.simulator.truth();
  CHECK(truth.plan_seq == plan.seq);
  CHECK((vector(truth.force_error[0]) - (vector(truth.f_F_W[0]) - left)).norm() < 1e-12);
  CHECK((vector(truth.force_error[1]) - (vector(truth.f_F_W[1]) - right)).norm() < 1e-12);

  CHECK_FALSE(run.simulator.accept(plan));  // again
  force_plan_t spoiled = plan_for(run.simulator, left, right);
  spoiled.force[0][0][2] = std::nan("");
  CHECK_FALSE(run.simulator.accept(spoiled));
  spoiled = plan_for(run.simulator, left, right);
  spoiled.run_id += 1;
  CHECK_FALSE(run.simulator.accept(spoiled));
  for (int k = 0; k < 6; ++k) run.simulator.advance();
  CHECK(run.simulator.truth().plan_seq == 0);  // too old to be compared
}

TEST_CASE("UserCommandsAreGivenWhenTheyAreDueAndAgainEvery100msUntilSilence") {
  Scenario scenario = test::biped_scenario("stand");
  scenario.commands = {{2, Behaviour::kStand, {0.0, 0.0}, 0.0, 0.0},
                       {15, Behaviour::kWalk, {0.4, -0.1}, 0.2, -0.05},
                       {38, Behaviour::kStand, {0.0, 0.0}, 0.0, 0.0, /*silent=*/true},
                       {70, Behaviour::kStand, {0.0, 0.0}, 0.0, 0.0}};
  const std::vector<int> expected = {2, 12, 15, 25, 35, 70, 80};
  Run run(scenario);
  std::vector<int> given;
  for (int k = 0; k < 85; ++k) {
    if (const auto* command = run.simulator.user_command()) {
      given.push_back(k);
      const bool walks = k >= 15 && k < 38;
      CHECK(command->seq == static_cast<std::int64_t>(given.size()));
      CHECK(command->utime == 10'000 * k);
      CHECK(command->behaviour == (walks ? stance_msgs::user_command_t::WALK : stance_msgs::user_command_t::STAND));
      CHECK(command->velocity[0] == (walks ? 0.4 : 0.0));
      CHECK(command->velocity[1] == (walks ? -0.1 : 0.0));
      CHECK(command->yaw_rate == (walks ? 0.2 : 0.0));
      CHECK(command->height_offset == (walks ? -0.05 : 0.0));
    }
    run.simulator.advance();
  }
  CHECK(given == expected);
}

TEST_CASE("ALimpRobotFallsAndTruthSaysSoForGood") {
  Run run(test::biped_scenario("stand"));
  for (int k = 0; k < 300 && !run.simulator.fallen(); ++k) run.simulator.advance();
  REQUIRE(run.simulator.fallen());
  const kinematics::Fall fall = run.simulator.fall();
  for (int k = 0; k < 10; ++k) run.simulator.advance();
  CHECK(run.simulator.truth().fallen == 1);
  CHECK(run.simulator.fall() == fall);
}

TEST_CASE("AFallIsToldByItsKind") {
  using kinematics::Fall;
  config::RobotDescription robot = test::biped();
  Scenario scenario = test::biped_scenario("stand");
  CHECK(Simulator(robot, scenario, {}).fall() == Fall::kNone);
  scenario.initial.roll_pitch_yaw = {std::acos(robot.fallen.min_upright) + 0.01, 0.0, 0.0};
  CHECK(Simulator(robot, scenario, {}).fall() == Fall::kTilt);
  scenario.initial.roll_pitch_yaw.setZero();
  const double height = Simulator(robot, scenario, {}).truth().p_WB[2];
  robot.fallen.min_height = height + 0.01;
  CHECK(Simulator(robot, scenario, {}).fall() == Fall::kHeight);
}

TEST_CASE("MassFactorsChangeThePlantAndNotTheDescription") {
  Scenario scenario = test::biped_scenario("stand");
  const auto robot = test::biped();
  Run nominal(scenario);
  scenario.trunk_mass_factor = 1.2;
  scenario.limb_mass_factor = 0.9;
  Run changed(scenario);
  const double trunk = robot.model.bodies[0].mass;
  const double expected = 1.2 * trunk + 0.9 * (robot.model.total_mass - trunk);
  // What the feet bear is what the plant weighs: read it from the forces and the acceleration of C.
  changed.hold();
  nominal.hold();
  const double before = changed.simulator.truth().v_WC[2];
  changed.simulator.advance();
  nominal.simulator.advance();
  const truth_t& truth = changed.simulator.truth();
  const double force = truth.f_F_W[0][2] + truth.f_F_W[1][2];
  const double acceleration = (truth.v_WC[2] - before) / kControlPeriod;
  CHECK(std::abs(force / (acceleration + kGravity) - expected) < 1e-2);
  CHECK(changed.simulator.truth().energy != nominal.simulator.truth().energy);
}

namespace {

// Error of one tick of the centroidal model over dt^2: (roll pitch yaw, p_WC, omega, v_WC), each in its unit per s^2.
// Angles: half the angular acceleration, 45 rad/s^2 at most. Position: half the acceleration. Angular velocity: half
// the moment's rate over the inertia, as C moves past the feet at 0.1-0.2 m/s under 130 N. Velocity: the forces are
// constant, only rounding.
constexpr double kTickTolerance[] = {30.0, 2.0, 100.0, 1e-6};

struct TickCase {
  double yaw = 0.0;                    // rad
  Vector3 velocity = Vector3::Zero();  // m/s
  double roll_rate = 0.0;              // rad/s, about the body's own x axis
  Vector3 left = Vector3::Zero();      // N
  Vector3 right = Vector3::Zero();     // N

  Vector3 omega_W() const { return math::rotation_z(yaw) * Vector3(roll_rate, 0.0, 0.0); }
};

const TickCase kTickCases[] = {
    {0.0, Vector3::Zero(), 0.0, {0.0, 0.0, 64.7}, {0.0, 0.0, 64.7}},
    {0.4, {0.1, -0.05, 0.02}, 0.0, {2.0, 1.0, 70.0}, {-1.0, 0.5, 60.0}},
    {-1.2, {0.0, 0.2, 0.0}, 0.0, {-3.0, 2.0, 50.0}, {-3.0, 2.0, 75.0}},
    {0.9, {0.1, 0.0, 0.0}, 0.8, {2.0, 1.0, 70.0}, {-1.0, 0.5, 60.0}},
};

centroidal::StateVector centroidal_state(const Mechanics& mechanics, const rigid_body::State& state) {
  centroidal::StateVector x;
  x << math::rpy_from_rotation(state.R_WB), mechanics.p_WC, state.w_WB_W, mechanics.v_WC;
  return x;
}

/// A x + B f + g over `dt`.
centroidal::StateVector predict(const TickCase& tick, double dt, const centroidal::StateVector& x,
                                const ContactVectors& p_WF) {
  const auto robot = test::biped();
  rigid_body::State pose;
  pose.q = robot.nominal_joint_position;
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(robot.model, pose, kinematics);
  rigid_body::Centroidal whole;
  rigid_body::centroidal(robot.model, kinematics, whole);
  centroidal::Linearisation at;
  at.dt = dt;
  at.yaw = tick.yaw;
  at.num_contacts = 2;
  for (std::size_t foot = 0; foot < 2; ++foot)
    at.r[foot] = p_WF[foot] - Vector3(0.0, 0.0, robot.feet[foot].radius) - x.segment<3>(3);
  centroidal::Dynamics model;
  const Matrix3 inertia = kinematics::standing_inertia(robot.model, robot.feet, robot.nominal_joint_position);
  centroidal::dynamics({whole.mass, inertia}, at, model);
  centroidal::ForceVector f(6);
  f << tick.left, tick.right;
  return model.A * x + model.B * f + model.g;
}

}  // namespace

TEST_CASE("OneTickOfTheSingleBodyIsTheCentroidalModels") {
  for (const TickCase& tick : kTickCases) {
    Scenario scenario = test::biped_scenario("single_body");
    scenario.pushes.clear();
    scenario.command_delay_steps = 0;
    scenario.initial.roll_pitch_yaw.z() = tick.yaw;
    scenario.initial.velocity_W = tick.velocity;
    scenario.initial.angular_velocity_W = tick.omega_W();
    Run run(scenario);
    const auto state = [&] {
      const truth_t& truth = run.simulator.truth();
      const Quaternion rotation(truth.quat_WB[0], truth.quat_WB[1], truth.quat_WB[2], truth.quat_WB[3]);
      centroidal::StateVector x;
      x << math::rpy_from_rotation(rotation.toRotationMatrix()), vector(truth.p_WC), vector(truth.w_WB_W),
          vector(truth.v_WC);
      return x;
    };
    const truth_t& truth = run.simulator.truth();
    const centroidal::StateVector predicted =
        predict(tick, kControlPeriod, state(), {vector(truth.p_WF[0]), vector(truth.p_WF[1])});
    // Where the controller believes its feet to be moves nothing.
    force_plan_t plan = plan_for(run.simulator, tick.left, tick.right);
    plan.p_WF[0][1] += 0.05;
    REQUIRE(run.simulator.accept(plan));
    run.simulator.advance();
    INFO("predicted " << predicted.transpose());
    INFO("simulated " << state().transpose());
    for (int block = 0; block < 4; ++block) {
      CHECK((state() - predicted).segment<3>(3 * block).cwiseAbs().maxCoeff() <
            kTickTolerance[block] * kControlPeriod * kControlPeriod);
    }
  }
}

TEST_CASE("TheSingleBodyLeavesTheCentroidalModelWithTheSquareOfTime") {
  for (const TickCase& tick : kTickCases) {
    const auto error_after = [&](int steps) {
      WorldSetup setup = test::biped_world(0.82);
      setup.initial.R_WB = math::rotation_z(tick.yaw);
      setup.initial.v_WB = tick.velocity;
      setup.initial.w_WB_W = tick.omega_W();
      SingleBody plant(setup);
      const ContactVectors tips = plant.foot_tips_W();
      const centroidal::StateVector predicted =
          predict(tick, steps * kPhysicsStep, centroidal_state(plant.mechanics(), plant.state()), tips);
      const ContactVectors forces = {tick.left, tick.right, Vector3::Zero(), Vector3::Zero()};
      for (int i = 0; i < steps; ++i) plant.step(forces, {});
      return (centroidal_state(plant.mechanics(), plant.state()) - predicted).cwiseAbs().maxCoeff();
    };
    const double four = error_after(4), eight = error_after(8), sixteen = error_after(16);
    INFO(four << ", " << eight << ", " << sixteen << " after 4, 8 and 16 ms");
    // Doubled time: n steps sum to n (n +- 1) / 2, so the quotient comes to 4 from both sides. A first-order error
    // would give 2.
    CHECK(eight > 3.0 * four);
    CHECK(eight < 5.0 * four);
    CHECK(sixteen > 3.5 * eight);
    CHECK(sixteen < 4.5 * eight);
  }
}

TEST_CASE("APushOnTheSingleBodysTrunkTurnsIt") {
  SingleBody plant(test::biped_world(0.82));
  const Vector3 force(3.0, 30.0, 0.0), moment(0.1, 0.2, 0.3);
  const Vector3 lever = plant.state().p_WB - plant.mechanics().p_WC;
  REQUIRE(lever.norm() > 0.05);
  plant.step(zero_contact_vectors(), {force, moment});
  const Vector3 expected = (moment + lever.cross(force)) * kPhysicsStep;
  CHECK((plant.mechanics().L_C_W - expected).norm() < 1e-3 * expected.norm());
}

TEST_CASE("TheSingleBodysJointsKeepTheFeetWhereTheyAre") {
  Scenario scenario = test::biped_scenario("single_body");
  scenario.pushes.clear();
  Run run(scenario);
  truth_t last = run.simulator.truth();
  for (int k = 0; k < 30; ++k) {
    const double sway = 3.0 * std::sin(0.4 * k);
    REQUIRE(run.simulator.accept(plan_for(run.simulator, {sway, 1.0, 66.0}, {-sway, 0.5, 64.0})));
    run.hold();
    run.simulator.advance();
    const truth_t& truth = run.simulator.truth();
    rigid_body::State state;
    state.p_WB = vector(truth.p_WB);
    state.R_WB = Quaternion(truth.quat_WB[0], truth.quat_WB[1], truth.quat_WB[2], truth.quat_WB[3]).toRotationMatrix();
    for (int i = 0; i < 8; ++i) state.q[i] = truth.joint_position[i];
    const ContactVectors tips = foot_tips(run.robot.model, run.robot.feet, state);
    for (std::size_t foot = 0; foot < 2; ++foot) {
      CHECK((tips[foot] - vector(truth.p_WF[foot])).norm() < 1e-9);
      CHECK((vector(truth.p_WF[foot]) - vector(last.p_WF[foot])).norm() == 0.0);
      CHECK(run.simulator.state().contact_switch[1][foot] == 1);
    }
    // Velocities are the positions' rates.
    for (int i = 0; i < 8; ++i) {
      const double rate = (truth.joint_position[i] - last.joint_position[i]) / kControlPeriod;
      CHECK(std::abs(0.5 * (truth.joint_velocity[i] + last.joint_velocity[i]) - rate) < 0.05);
    }
    // The robot of these joints has its centre of mass where the single body is.
    CHECK((mechanics(run.robot.model, state).p_WC - vector(truth.p_WC)).norm() < 1e-9);
    last = truth;
  }
}

TEST_CASE("AFootOfTheSingleBodyThatThePlanLiftsFollowsTheCommandAndLands") {
  const WorldSetup setup = test::biped_world(0.82);
  SingleBody plant(setup);
  const kinematics::LegVector nominal = plant.state().q.head<4>();
  const Vector3 start = plant.foot_tips_W()[0], other = plant.foot_tips_W()[1];
  kinematics::LegVector bent = nominal;
  bent[2] += 0.3;
  const auto step = [&] {  // held up at its centre of mass
    const Vector3 weight(0.0, 0.0, setup.model.total_mass * kGravity);
    plant.step(zero_contact_vectors(), {weight, (plant.mechanics().p_WC - plant.state().p_WB).cross(weight)});
  };
  for (int i = 0; i < 60; ++i) {
    plant.swing(0, bent);
    step();
  }
  rigid_body::State bent_state = plant.state();
  bent_state.q.head<4>() = bent;
  CHECK((plant.foot_tips_W()[0] - foot_tips(setup.model, setup.feet, bent_state)[0]).norm() < 1e-3);
  CHECK(plant.foot_tips_W()[0].z() > start.z() + 0.02);
  CHECK_FALSE(plant.on_ground(0));
  CHECK(plant.on_ground(1));
  CHECK((plant.foot_tips_W()[1] - other).norm() == 0.0);

  kinematics::LegVector stretched = nominal;
  stretched[2] -= 0.1;  // below the ground
  for (int i = 0; i < 60; ++i) {
    plant.swing(0, stretched);
    step();
  }
  CHECK(plant.on_ground(0));
  CHECK(std::abs(plant.foot_tips_W()[0].z() - start.z()) < 1e-9);
  plant.stand(0);
  const Vector3 landed = plant.foot_tips_W()[0];
  step();
  CHECK((plant.foot_tips_W()[0] - landed).norm() == 0.0);
}

TEST_CASE("TheOptionsPlantStandsInPlaceOfTheScenarios") {
  Run run(test::biped_scenario("stand"), {.seed = 1, .run_id = 1, .start_utime = 0, .plant = Plant::kSingleBody});
  run.simulator.advance();
  // Nothing bears the single body before a plan comes.
  CHECK(std::abs(run.simulator.truth().v_WC[2] + kGravity * kControlPeriod) < 1e-9);
}

}  // namespace stance::sim
