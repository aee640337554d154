#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <random>

#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

using stance_msgs::joint_command_t;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

JointVector ramp(double first, double step) {
  JointVector v;
  for (int i = 0; i < kMaxJoints; ++i) v[i] = first + step * i;
  return v;
}

}  // namespace

TEST_CASE("ActiveDrivesCloseTheLawOfAMotorBoard") {
  const auto robot = test::biped();
  const JointVector q = ramp(0.1, 0.05), qd = ramp(-0.4, 0.1);
  joint_command_t command{};
  command.mode = joint_command_t::ACTIVE;
  for (int i = 0; i < kMaxJoints; ++i) {
    command.feedforward_torque[i] = 1.0 + i;
    command.position[i] = 0.2 * i;
    command.velocity[i] = -0.1 * i;
    command.kp[i] = 10.0 + i;
    command.kd[i] = 0.5 + 0.1 * i;
  }
  const JointVector torque = drive_torque(robot.model, command, q, qd);
  for (int i = 0; i < kMaxJoints; ++i) {
    const double expected = (1.0 + i) + (10.0 + i) * (0.2 * i - q[i]) + (0.5 + 0.1 * i) * (-0.1 * i - qd[i]);
    CHECK(std::abs(torque[i] - expected) < 1e-12);
  }
}

TEST_CASE("DrivesClipAtTheUrdfsEffort") {
  const auto robot = test::biped();
  for (const double sign : {1.0, -1.0}) {
    joint_command_t command{};
    for (double& torque : command.feedforward_torque) torque = sign * 1e5;
    for (double& kd : command.kd) kd = 1e5;
    const JointVector qd = JointVector::Constant(-sign);
    for (const auto mode : {joint_command_t::ACTIVE, joint_command_t::DAMP}) {
      command.mode = mode;
      const JointVector torque = drive_torque(robot.model, command, JointVector::Zero(), qd);
      for (int i = 0; i < robot.model.num_joints; ++i) {
        CHECK(torque[i] == sign * robot.model.joints[static_cast<std::size_t>(i)].max_torque);
      }
    }
    const JointVector damped = damping_torque(robot.model, JointVector::Constant(1e5), qd);
    CHECK(damped[0] == sign * robot.model.joints[0].max_torque);
  }
}

TEST_CASE("DampedDrivesOpposeTheVelocityAlone") {
  const auto robot = test::biped();
  joint_command_t command{};
  command.mode = joint_command_t::DAMP;
  for (int i = 0; i < kMaxJoints; ++i) {
    command.feedforward_torque[i] = 7.0;
    command.kp[i] = 100.0;
    command.position[i] = 1.0;
    command.kd[i] = 1.0 + i;
  }
  const JointVector qd = ramp(-0.4, 0.1);
  const JointVector torque = drive_torque(robot.model, command, JointVector::Zero(), qd);
  for (int i = 0; i < kMaxJoints; ++i) CHECK(torque[i] == -(1.0 + i) * qd[i]);
  CHECK(damping_torque(robot.model, JointVector::Constant(3.0), qd) == JointVector(-3.0 * qd));
}

namespace {

/// lambda_max(M_q^-1 K) dt / 2 of the free-floating robot in posture `q`, with M_q what the joints feel of its mass and
/// K its damping: below 1, rates that are damped once a physics step die out. Feet that stand add to what joints feel.
double damping_share(const config::RobotDescription& robot, const JointVector& q) {
  rigid_body::State state;
  state.q = q;
  rigid_body::MatrixNu M;
  rigid_body::mass_matrix(robot.model, state, M);
  const int n = robot.model.num_joints;
  const Eigen::MatrixXd base = M.topLeftCorner(6, 6), cross = M.topRightCorner(6, n);
  const Eigen::MatrixXd M_q = M.bottomRightCorner(n, n) - cross.transpose() * base.ldlt().solve(cross);
  const Eigen::MatrixXd K = robot.drives.damping.head(n).asDiagonal();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> pencil(K, M_q, Eigen::EigenvaluesOnly);
  return 0.5 * kPhysicsStep * pencil.eigenvalues().maxCoeff();
}

}  // namespace

TEST_CASE("DampedDrivesAreStableAtThePhysicsStepInEveryPosture") {
  const auto robot = test::biped();
  const int n = robot.model.num_joints;
  constexpr int levels = 5;  // of each joint of a leg from limit to limit, both legs alike
  constexpr int grid = levels * levels * levels * levels;
  constexpr int postures = grid + 2000;  // the others random
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  double worst = 0.0;
  for (int posture = 0; posture < postures; ++posture) {
    JointVector q = JointVector::Zero();
    int digits = posture;
    for (int i = 0; i < n; ++i) {
      if (i == n / 2) digits = posture;
      const double level = static_cast<double>(digits % levels) / (levels - 1);
      digits /= levels;
      const auto& joint = robot.model.joints[static_cast<std::size_t>(i)];
      q[i] = joint.lower + (posture < grid ? level : uniform(random)) * (joint.upper - joint.lower);
    }
    worst = std::max(worst, damping_share(robot, q));
  }
  INFO("worst " << worst << ", nominal " << damping_share(robot, robot.nominal_joint_position));
  CHECK(worst < 1.0);
}

TEST_CASE("DampingIsStableInTheWorldWhereTheMassMatrixSaysSo") {
  const auto robot = test::biped();
  const double nominal = damping_share(robot, robot.nominal_joint_position);
  for (const double share : {0.9, 1.1}) {
    WorldSetup setup = test::biped_world(20.0);
    for (int i = 0; i < robot.model.num_joints; ++i) setup.initial.qd[i] = i % 3 == 0 ? 1e-4 : -1e-4;
    World world(setup);
    const JointVector damping = robot.drives.damping * (share / nominal);
    for (int i = 0; i < 50; ++i) world.step(damping_torque(robot.model, damping, world.state().qd), {});
    INFO("rates of " << setup.initial.qd.norm() << " rad/s are " << world.state().qd.norm() << " after 50 ms");
    CHECK((world.state().qd.norm() < setup.initial.qd.norm()) == (share < 1.0));
  }
}

TEST_CASE("StoppedDrivesGiveNoTorque") {
  const auto robot = test::biped();
  joint_command_t command{};
  command.mode = joint_command_t::STOP;
  command.feedforward_torque[0] = 7.0;
  command.kd[0] = 1.0;
  CHECK(drive_torque(robot.model, command, JointVector::Zero(), JointVector::Ones()).isZero(0.0));
}

namespace {

constexpr std::int64_t kRun = 42;
constexpr std::int64_t kMaxAge = 4;  // control periods

joint_command_t command(std::int64_t seq, std::int64_t state_seq) {
  joint_command_t out{};
  out.seq = seq;
  out.state_seq = state_seq;
  out.run_id = kRun;
  out.num_joints = 8;
  return out;
}

}  // namespace

TEST_CASE("CommandsOfAnotherRunOrSizeAreRefusedAndCounted") {
  CommandGate gate(kRun, 8, kMaxAge);
  joint_command_t other_run = command(1, 1);
  other_run.run_id = kRun + 1;
  CHECK(gate.judge(other_run, 1) == Acceptance::kRefusedRun);
  joint_command_t other_size = command(1, 1);
  other_size.num_joints = 7;
  CHECK(gate.judge(other_size, 1) == Acceptance::kRefusedRun);
  CHECK(gate.refused().run == 2);
  CHECK(gate.refused().total() == 2);
  CHECK(gate.judge(command(1, 1), 1) == Acceptance::kAccepted);
}

TEST_CASE("CommandsThatAreNotFiniteOrOutOfRangeAreRefusedAndCounted") {
  CommandGate gate(kRun, 8, kMaxAge);
  std::int64_t refused = 0;
  const auto check_refused = [&](auto spoil) {
    joint_command_t spoiled = command(1, 1);
    spoil(spoiled);
    CHECK(gate.judge(spoiled, 1) == Acceptance::kRefusedNotFinite);
    CHECK(gate.refused().not_finite == ++refused);
  };
  for (const double bad : {kNaN, kInfinity, -kInfinity, 1e9}) {
    check_refused([&](auto& c) { c.feedforward_torque[3] = bad; });
    check_refused([&](auto& c) { c.position[7] = bad; });
    check_refused([&](auto& c) { c.velocity[0] = bad; });
    check_refused([&](auto& c) { c.kp[1] = bad; });
    check_refused([&](auto& c) { c.kd[2] = bad; });
  }
  check_refused([](auto& c) { c.kp[0] = -1.0; });
  check_refused([](auto& c) { c.kd[0] = -1.0; });
  check_refused([](auto& c) { c.mode = 3; });
  check_refused([](auto& c) { c.mode = -1; });
  check_refused([](auto& c) { c.state_seq = 0; });
  check_refused([](auto& c) { c.state_seq = 2; });  // a state that was not sent yet
  CHECK(gate.refused().total() == refused);
  CHECK(gate.judge(command(1, 1), 1) == Acceptance::kAccepted);
}

TEST_CASE("CommandsThatGoBackAreRefusedAndCounted") {
  CommandGate gate(kRun, 8, kMaxAge);
  CHECK(gate.judge(command(10, 5), 5) == Acceptance::kAccepted);
  CHECK(gate.judge(command(11, 4), 5) == Acceptance::kRefusedOrder);
  CHECK(gate.judge(command(9, 5), 5) == Acceptance::kRefusedOrder);
  CHECK(gate.refused().order == 2);
  CHECK(gate.judge(command(11, 5), 5) == Acceptance::kAccepted);
  CHECK(gate.refused().total() == 2);
}

TEST_CASE("StaleCommandsAreRefusedAndCounted") {
  CommandGate gate(kRun, 8, kMaxAge);
  CHECK(gate.judge(command(1, 1), 1 + kMaxAge + 1) == Acceptance::kRefusedStale);
  CHECK(gate.refused().stale == 1);
  CHECK(gate.refused().total() == 1);
  CHECK(gate.judge(command(1, 2), 2 + kMaxAge) == Acceptance::kAccepted);
}

TEST_CASE("ARepeatedCommandIsNeitherTakenNorCounted") {
  CommandGate gate(kRun, 8, kMaxAge);
  CHECK(gate.judge(command(1, 1), 1) == Acceptance::kAccepted);
  CHECK(gate.judge(command(1, 1), 1) == Acceptance::kRepeated);
  CHECK(gate.judge(command(1, 1), 2) == Acceptance::kRepeated);
  CHECK(gate.refused().total() == 0);
}

TEST_CASE("ARestartedControllerIsHeard") {
  CommandGate gate(kRun, 8, kMaxAge);
  CHECK(gate.judge(command(500, 500), 500) == Acceptance::kAccepted);
  CHECK(gate.judge(command(1, 700), 700) == Acceptance::kAccepted);
  CHECK(gate.judge(command(2, 701), 701) == Acceptance::kAccepted);
  CHECK(gate.judge(command(501, 501), 701) == Acceptance::kRefusedOrder);
}

}  // namespace stance::sim
