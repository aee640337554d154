// Kinematics of chains against the book's products of exponentials, finite differences and the model's kinematics.
#include "controller/rigid_body/chain.hpp"

#include <Eigen/SVD>
#include <catch2/catch_test_macros.hpp>

#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::rigid_body;

namespace {

constexpr double kExact = 1e-12;
constexpr double kStep = 1e-5;          ///< rad, of central differences
constexpr double kDifference = 1e-9;    ///< the step's square
constexpr double kLeastSquares = 1e-9;  ///< of QR on Jacobians that are not near singular
constexpr unsigned kSeed = 41;
constexpr int kCases = 50;

JointVector random_angles(int n, Random& random) {
  JointVector theta = JointVector::Zero();
  for (int i = 0; i < n; ++i) theta(i) = random.number(-2.5, 2.5);
  return theta;
}

Vector6 random_twist(Random& random) {
  Vector6 V;
  V << random.vector(2.0), random.vector(2.0);
  return V;
}

/// Bodies' frames of the biped's tree hang on both legs: columns off the chain matter.
Tip biped_tip(const Biped& biped) {
  return tip_on_link(biped.model, biped.feet[1].body, {math::exp_so3({0.3, -0.2, 0.5}), biped.feet[1].tip});
}

}  // namespace

TEST_CASE("TipPoseIsTheProductOfExponentialsOfTheSpaceScrews") {
  // T = exp([S_1] theta_1) .. exp([S_n] theta_n) M (4.14).
  for (const char* name : {"rnea_ur5.json", "rnea_mr3r.json", "rnea_planar3R_unit.json"}) {
    const BookChain book = read_book_chain(load_golden(name));
    const ScrewTree tree = book.tree();
    Random random(kSeed);
    for (int k = 0; k < kCases; ++k) {
      const JointVector theta = random_angles(tree.num_joints, random);
      RigidTransform expected;
      for (int i = 0; i < tree.num_joints; ++i) expected = expected * math::exp_se3(theta(i) * book.S[i]);
      expected = expected * book.home();
      CHECK(max_difference(homogeneous(tip_pose(tree, book.tip(), theta)), homogeneous(expected)) < kExact);
    }
  }
}

TEST_CASE("JointsMotionIsTheExponentialOfItsScrewWhetherItTurnsSlidesOrBoth") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const RigidTransform M = math::exp_se3(random_twist(random));
    Vector6 helix = random_twist(random), turn = helix, slide = helix;
    turn.tail<3>() = random.vector(1.0).cross(helix.head<3>());
    slide.head<3>().setZero();
    for (const Vector6& A : {helix, turn, slide}) {
      for (const double theta : {0.0, 1e-9, -0.7, 2.0, 40.0}) {
        const RigidTransform expected = math::exp_se3(-theta * A) * M;
        CHECK(max_difference(homogeneous(ScrewMotion(M, A)(theta)), homogeneous(expected)) < 100.0 * kExact);
      }
    }
  }
}

TEST_CASE("SpaceJacobiansColumnsAreTheScrewsMovedByTheJointsBeforeThem") {
  // J_s,i = Ad(exp([S_1] theta_1) .. exp([S_(i-1)] theta_(i-1))) S_i (5.11).
  const BookChain book = read_book_chain(load_golden("rnea_ur5.json"));
  const ScrewTree tree = book.tree();
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const JointVector theta = random_angles(tree.num_joints, random);
    JointJacobian J_s;
    const RigidTransform T = space_jacobian(tree, book.tip(), theta, J_s);
    CHECK(max_difference(homogeneous(T), homogeneous(tip_pose(tree, book.tip(), theta))) == 0.0);
    RigidTransform before;
    for (int i = 0; i < tree.num_joints; ++i) {
      CHECK(max_difference(J_s.col(i), math::adjoint_times(before, book.S[i])) < kExact);
      before = before * math::exp_se3(theta(i) * book.S[i]);
    }
  }
}

TEST_CASE("BodyJacobianIsTheDerivativeOfTheTipPose") {
  const Biped biped;
  const ScrewTree tree = screw_tree(biped.model);
  const Tip tip = biped_tip(biped);
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const JointVector theta = random_angles(tree.num_joints, random);
    JointJacobian J_b;
    body_jacobian(tree, tip, theta, J_b);
    REQUIRE(J_b.cols() == tree.num_joints);
    for (int i = 0; i < tree.num_joints; ++i) {
      const JointVector h = kStep * JointVector::Unit(i);
      const RigidTransform before = tip_pose(tree, tip, theta - h), after = tip_pose(tree, tip, theta + h);
      CHECK(max_difference(math::log_se3(before.inverse() * after) / (2.0 * kStep), J_b.col(i)) < kDifference);
    }
  }
}

TEST_CASE("ChainAgreesWithTheModelsKinematics") {
  const Biped biped;
  const ScrewTree tree = screw_tree(biped.model);
  const Tip tip = biped_tip(biped);
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    State state;
    state.q = random_angles(tree.num_joints, random);
    const Kinematics kinematics = kinematics_of(biped.model, state);
    const Vector3 foot_W = kinematics.p_W[tip.body] + kinematics.R_W[tip.body] * biped.feet[1].tip;
    JointJacobian J_b;
    // The tree's base frame is at the trunk's centre of mass.
    const RigidTransform T =
        RigidTransform{Matrix3::Identity(), kinematics.com_W[0]} * body_jacobian(tree, tip, state.q, J_b);
    CHECK(max_difference(T.p, foot_W) < kExact);
    Jacobian J;
    geometric_jacobian(biped.model, state, kinematics, tip.body, foot_W, J);
    CHECK(max_difference(T.R * J_b.topRows<3>(), J.topRightCorner(3, tree.num_joints)) < kExact);
    CHECK(max_difference(T.R * J_b.bottomRows<3>(), J.bottomRightCorner(3, tree.num_joints)) < kExact);
  }
}

TEST_CASE("InverseVelocityInvertsASquareJacobian") {
  const BookChain book = read_book_chain(load_golden("rnea_ur5.json"));
  const ScrewTree tree = book.tree();
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    JointVector theta = random_angles(tree.num_joints, random);
    theta(2) = random.number(0.5, 2.5);  // away from the stretched elbow and wrist
    theta(4) = random.number(0.5, 2.5);
    const JointVector thetad = random_angles(tree.num_joints, random);
    JointJacobian J;
    space_jacobian(tree, book.tip(), theta, J);
    if (Eigen::JacobiSVD<Eigen::MatrixXd>(J).singularValues().minCoeff() < 1e-2) continue;
    CHECK(max_difference(inverse_velocity(J, J * thetad.head<6>()), thetad.head<6>()) < kLeastSquares);
  }
}

TEST_CASE("InverseVelocityIsTheLeastSquaresSolutionAndTheSmallestOfThem") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    for (const int n : {3, 8}) {  // too few joints, and too many
      JointJacobian J(6, n);
      for (int i = 0; i < n; ++i) J.col(i) = random_twist(random);
      if (k % 2 == 1) J.col(n - 1) = J.col(0) + J.col(1);  // and fewer yet
      const Vector6 V = random_twist(random);
      Eigen::JacobiSVD<Eigen::MatrixXd> svd(J, Eigen::ComputeThinU | Eigen::ComputeThinV);
      svd.setThreshold(kRankTolerance);
      const Eigen::VectorXd expected = svd.solve(V);
      CHECK(max_difference(inverse_velocity(J, V), expected) < kLeastSquares * (1.0 + expected.norm()));
    }
  }
}

TEST_CASE("DampedInverseVelocityMinimisesItsSumAndStaysBoundedWhereTheChainIsSingular") {
  constexpr double kDamping = 0.05;
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    JointJacobian J(6, 5);
    for (int i = 0; i < 5; ++i) J.col(i) = random_twist(random);
    J.col(4) = J.col(3) + 1e-9 * J.col(4);
    const Vector6 V = random_twist(random);
    const Eigen::VectorXd thetad = inverse_velocity(J, V, kDamping);
    const Eigen::VectorXd gradient = J.transpose() * (J * thetad - V) + kDamping * kDamping * thetad;
    CHECK(gradient.cwiseAbs().maxCoeff() < kLeastSquares);
    CHECK(thetad.norm() <= V.norm() / (2.0 * kDamping));
  }
}

TEST_CASE("ChainOfListsThatDoNotFitIsRefused") {
  const BookChain book = read_book_chain(load_golden("rnea_ur5.json"));
  const std::vector<RigidTransform> nine(9);
  const std::vector<SpatialInertia> nine_inertias(9);
  const std::vector<Vector6> nine_screws(9, Vector6::UnitZ());
  CHECK_THROWS_AS(screw_chain(book.M, book.G, book.S), std::invalid_argument);  // the tip's pose is one too many
  CHECK_THROWS_AS(screw_chain({}, {}, {}), std::invalid_argument);
  CHECK_THROWS_AS(screw_chain(nine, nine_inertias, nine_screws), std::invalid_argument);
}
