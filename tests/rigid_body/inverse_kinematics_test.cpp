// Iterative inverse kinematics: what it reaches, what it makes of chains with too few and too many joints, and what it
// says.
#include "controller/rigid_body/inverse_kinematics.hpp"

#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <numbers>

#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::rigid_body;

namespace {

using Status = InverseKinematicsStatus;
constexpr double kReach = 1e-10;   ///< rad and m
constexpr double kOptimal = 1e-6;  ///< of first-order conditions
constexpr double kStep = 1e-4;     ///< rad: where a minimum is compared with its neighbours
constexpr unsigned kSeed = 43;
constexpr int kCases = 100;

struct Robot {
  ScrewTree tree;
  Tip tip;
};

Robot book_robot(const char* name) {
  const BookChain book = read_book_chain(load_golden(name));
  return {book.tree(), book.tip()};
}

/// The catching arm: five joints.
struct Arm5 : Robot {
  Model model = model_from_urdf(golden_text("arm5.urdf"), {"j1", "j2", "j3", "j4", "j5"});
  Arm5() {
    tree = screw_tree(model);
    tip = tip_on_link(model, 5, {Matrix3::Identity(), {0.0, 0.0, 0.251}});
  }
};

/// Eight joints, each about an axis of its own.
Robot snake() {
  const Vector3 link(0.1, 0.05, 0.25);
  std::vector<RigidTransform> M(8, {Matrix3::Identity(), link});
  std::vector<SpatialInertia> G(8);
  std::vector<Vector6> S(8);
  Random random(kSeed);
  for (int i = 0; i < 8; ++i) {
    const Vector3 axis = random.vector(1.0).normalized();
    S[i] << axis, (link * (i + 1)).cross(axis);
  }
  return {screw_chain(M, G, S), {8, {Matrix3::Identity(), link}}};
}

/// Three joints about z, the arm along x.
Robot planar_arm() {
  const Vector3 link(0.4, 0.0, 0.0);
  std::vector<RigidTransform> M(3, {Matrix3::Identity(), link});
  M[0] = {};
  std::vector<Vector6> S(3);
  for (int i = 0; i < 3; ++i) S[i] << Vector3::UnitZ(), (link * i).cross(Vector3::UnitZ());
  return {screw_chain(M, std::vector<SpatialInertia>(3), S), {3, {Matrix3::Identity(), link}}};
}

JointVector random_angles(int n, double size, Random& random) {
  JointVector theta = JointVector::Zero();
  for (int i = 0; i < n; ++i) theta(i) = random.number(-size, size);
  return theta;
}

double cost(const Robot& robot, const PoseTask& task, const JointVector& theta) {
  const RigidTransform T = tip_pose(robot.tree, robot.tip, theta);
  Vector6 e;
  e << math::log_so3(T.R.transpose() * task.target.R), T.R.transpose() * (task.target.p - T.p);
  return 0.5 * task.weight.cwiseProduct(e).squaredNorm();
}

}  // namespace

TEST_CASE("SixJointsReachEveryPoseNearTheSeed") {
  const Robot ur5 = book_robot("rnea_ur5.json");
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const JointVector truth = random_angles(6, 2.5, random);
    const JointVector seed = truth + random_angles(6, 0.2, random);
    PoseTask task;
    task.target = tip_pose(ur5.tree, ur5.tip, truth);
    const InverseKinematics found = inverse_kinematics(ur5.tree, ur5.tip, task, {}, {&seed, 1});
    CHECK(found.status == Status::kReached);
    CHECK(found.error.norm() < kReach);
    CHECK(max_difference(homogeneous(tip_pose(ur5.tree, ur5.tip, found.theta)), homogeneous(task.target)) < kReach);
  }
}

TEST_CASE("MoreSeedsReachPosesThatOneDoesNot") {
  const Robot ur5 = book_robot("rnea_ur5.json");
  Random random(kSeed);
  std::array<JointVector, 12> seeds;
  for (JointVector& seed : seeds) seed = random_angles(6, 3.0, random);
  int reached_by_one = 0, reached_by_all = 0;
  for (int k = 0; k < kCases; ++k) {
    PoseTask task;
    task.target = tip_pose(ur5.tree, ur5.tip, random_angles(6, 3.0, random));
    reached_by_one +=
        inverse_kinematics(ur5.tree, ur5.tip, task, {}, std::span(seeds).first(1)).status == Status::kReached;
    reached_by_all += inverse_kinematics(ur5.tree, ur5.tip, task, {}, seeds).status == Status::kReached;
  }
  CHECK(reached_by_one < reached_by_all);
  CHECK(reached_by_all == kCases);
}

TEST_CASE("TooFewJointsGiveTheLeastSquaresPose") {
  const Arm5 arm;
  Random random(kSeed);
  int nearest = 0;
  for (int k = 0; k < kCases; ++k) {
    const JointVector truth = random_angles(5, 1.5, random);
    PoseTask task;
    task.weight << 1.0, 1.0, 1.0, 10.0, 10.0, 10.0;
    task.target =
        tip_pose(arm.tree, arm.tip, truth) * math::exp_se3((Vector6() << random.vector(0.3), 0, 0, 0).finished());
    const InverseKinematics found = inverse_kinematics(arm.tree, arm.tip, task, {}, {&truth, 1});
    CHECK((found.status == Status::kNearest || found.status == Status::kReached));
    nearest += found.status == Status::kNearest;
    const double least = cost(arm, task, found.theta);
    for (int i = 0; i < 5; ++i) {
      const JointVector h = kStep * JointVector::Unit(i);
      const double after = cost(arm, task, found.theta + h), before = cost(arm, task, found.theta - h);
      CHECK(std::abs(after - before) / (2.0 * kStep) < kOptimal);
      CHECK(std::min(after, before) >= least);
    }
  }
  CHECK(nearest > kCases / 2);
}

TEST_CASE("PoseOfFiveDegreesOfFreedomIsReachedWithTheSixthUnweighted") {
  const Arm5 arm;
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const JointVector truth = random_angles(5, 1.5, random);
    PoseTask task;
    task.weight << 0.0, 0.0, 0.0, 1.0, 1.0, 1.0;  // the position alone
    task.target = {math::exp_so3(random.vector(2.0)), tip_pose(arm.tree, arm.tip, truth).p};
    const JointVector seed = truth + random_angles(5, 0.3, random);
    const InverseKinematics found = inverse_kinematics(arm.tree, arm.tip, task, {}, {&seed, 1});
    CHECK(found.status == Status::kReached);
    CHECK(max_difference(tip_pose(arm.tree, arm.tip, found.theta).p, task.target.p) < kReach);
  }
}

TEST_CASE("HeavierWeightIsKeptBetter") {
  const Arm5 arm;
  const JointVector truth = (JointVector() << 0.3, 0.9, -1.2, 1.4, 0.2, 0, 0, 0).finished();
  PoseTask task;
  task.target = tip_pose(arm.tree, arm.tip, truth);
  task.target.R = task.target.R * math::exp_so3({0.3, 0.2, -0.1});
  const auto errors = [&](double position_weight) {
    task.weight << 1.0, 1.0, 1.0, position_weight, position_weight, position_weight;
    const Vector6 e = inverse_kinematics(arm.tree, arm.tip, task, {}, {&truth, 1}).error;
    return std::pair(e.head<3>().norm(), e.tail<3>().norm());
  };
  const auto [angle_loose, position_loose] = errors(1.0);
  const auto [angle_firm, position_firm] = errors(100.0);
  CHECK(position_firm < 0.01 * position_loose);
  CHECK(angle_firm > angle_loose);
}

TEST_CASE("TooManyJointsTakeThePostureThatIsNearestThePrior") {
  const Robot robot = snake();
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const JointVector truth = random_angles(8, 0.8, random);
    PoseTask task;
    task.target = tip_pose(robot.tree, robot.tip, truth);
    task.posture = truth + random_angles(8, 0.3, random);
    for (int i = 0; i < 8; ++i) task.posture_weight(i) = random.number(0.5, 2.0);
    const InverseKinematics found = inverse_kinematics(robot.tree, robot.tip, task, {}, {&truth, 1});
    REQUIRE(found.status == Status::kReached);
    CHECK(found.error.norm() < kReach);
    // First-order condition: the prior's pull lies in the span of the Jacobian's rows.
    JointJacobian J;
    body_jacobian(robot.tree, robot.tip, found.theta, J);
    const Eigen::VectorXd pull = task.posture_weight.cwiseProduct(task.posture - found.theta);
    const Eigen::VectorXd multipliers = J.transpose().colPivHouseholderQr().solve(pull);
    CHECK((J.transpose() * multipliers - pull).norm() < kOptimal);
    const auto distance = [&](const JointVector& theta) {
      return (task.posture - theta).cwiseAbs2().dot(task.posture_weight);
    };
    CHECK(distance(found.theta) <= distance(truth));
  }
}

TEST_CASE("PosturePriorChoosesAmongTheSeedsSolutions") {
  // A pose in the plane is reached with the elbow on either side.
  const Robot robot = planar_arm();
  const std::array<JointVector, 2> seeds{(JointVector() << 0.2, 1.0, 0.5, 0, 0, 0, 0, 0).finished(),
                                         (JointVector() << 1.2, -1.0, 1.5, 0, 0, 0, 0, 0).finished()};
  PoseTask task;
  task.target = tip_pose(robot.tree, robot.tip, seeds[0]);
  task.posture_weight.head<3>().setOnes();
  for (const int wanted : {0, 1}) {
    task.posture = seeds[wanted];
    const InverseKinematics found = inverse_kinematics(robot.tree, robot.tip, task, {}, seeds);
    CHECK(found.status == Status::kReached);
    CHECK(found.seed == wanted);
    CHECK(found.theta(1) * seeds[wanted](1) > 0.0);
  }
}

TEST_CASE("JointsStayWithinTheirLimitsAndTheResultSaysWhereOneHoldsThemBack") {
  const Arm5 arm;
  const JointLimits limits = joint_limits(arm.model);
  Random random(kSeed);
  int held = 0;
  for (int k = 0; k < kCases; ++k) {
    PoseTask task;
    task.weight << 0.1, 0.1, 0.1, 1.0, 1.0, 1.0;
    task.target = tip_pose(arm.tree, arm.tip, random_angles(5, 3.0, random));
    const JointVector seed = random_angles(5, 1.0, random);
    const InverseKinematics found = inverse_kinematics(arm.tree, arm.tip, task, limits, {&seed, 1});
    for (int i = 0; i < 5; ++i) {
      CHECK(found.theta(i) >= limits.lower(i));
      CHECK(found.theta(i) <= limits.upper(i));
    }
    if (found.status != Status::kNearestAtLimit) continue;
    ++held;
    bool any = false;
    for (int i = 0; i < 5; ++i) any = any || found.theta(i) == limits.lower(i) || found.theta(i) == limits.upper(i);
    CHECK(any);
  }
  CHECK(held > 0);
}

TEST_CASE("PostureKeepsToTheLimits") {
  const Robot robot = snake();
  JointLimits limits;
  limits.lower.setConstant(-0.9);
  limits.upper.setConstant(0.9);
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const JointVector truth = random_angles(8, 0.8, random);
    PoseTask task;
    task.target = tip_pose(robot.tree, robot.tip, truth);
    task.posture.setConstant(2.0);  // out of the limits
    task.posture_weight.setOnes();
    const InverseKinematics found = inverse_kinematics(robot.tree, robot.tip, task, limits, {&truth, 1});
    CHECK(found.status == Status::kReached);
    CHECK(found.theta.cwiseAbs().maxCoeff() <= 0.9);
    CHECK((task.posture - found.theta).norm() <= (task.posture - truth).norm());
  }
}

TEST_CASE("PoseOutOfReachIsApproachedAndCalledNearest") {
  const Robot robot = planar_arm();
  const JointVector seed = (JointVector() << 0.3, 0.4, -0.2, 0, 0, 0, 0, 0).finished();
  PoseTask task;
  task.weight << 0, 0, 0, 1, 1, 1;
  const RigidTransform home = tip_pose(robot.tree, robot.tip, JointVector::Zero());
  task.target = {Matrix3::Identity(), 2.0 * home.p};
  const InverseKinematics found = inverse_kinematics(robot.tree, robot.tip, task, {}, {&seed, 1});
  CHECK(found.status == Status::kNearest);
  // Stretched towards the target.
  CHECK(std::abs(found.error.tail<3>().norm() - home.p.norm()) < kOptimal);
}

TEST_CASE("FewIterationsAreCalledNotConverged") {
  const Robot ur5 = book_robot("rnea_ur5.json");
  PoseTask task;
  task.target = tip_pose(ur5.tree, ur5.tip, (JointVector() << 1, -1, 1, 1, 1, 1, 0, 0).finished());
  const JointVector seed = JointVector::Constant(0.1);
  CHECK(inverse_kinematics(ur5.tree, ur5.tip, task, {}, {&seed, 1}, {1e-11, 2}).status == Status::kNotConverged);
}

TEST_CASE("TaskThatMakesNoSenseIsInvalid") {
  const Robot ur5 = book_robot("rnea_ur5.json");
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const JointVector seed = JointVector::Zero();
  const PoseTask good;
  PoseTask no_number = good, negative = good;
  no_number.target.p.x() = kNan;
  negative.weight(2) = -1.0;
  JointLimits crossed;
  crossed.lower(3) = 1.0;
  crossed.upper(3) = 0.5;
  const JointVector bad_seed = JointVector::Constant(kNan);
  const auto status = [&](const PoseTask& task, const JointLimits& limits, std::span<const JointVector> seeds) {
    return inverse_kinematics(ur5.tree, ur5.tip, task, limits, seeds).status;
  };
  CHECK(status(good, {}, {&seed, 1}) != Status::kInvalid);
  CHECK(status(no_number, {}, {&seed, 1}) == Status::kInvalid);
  CHECK(status(negative, {}, {&seed, 1}) == Status::kInvalid);
  CHECK(status(good, crossed, {&seed, 1}) == Status::kInvalid);
  CHECK(status(good, {}, {&bad_seed, 1}) == Status::kInvalid);
  CHECK(status(good, {}, {}) == Status::kInvalid);
}
