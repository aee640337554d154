// The recursion of eqs 8.50-8.54 and what stands on it for chains, against reference vectors (40-digit arithmetic) and
// laws. dynamics_test.cpp tests floating bases.
#include "controller/rigid_body/newton_euler.hpp"

#include <catch2/catch_test_macros.hpp>

#include "controller/rigid_body/chain.hpp"
#include "controller/rigid_body/chain_dynamics.hpp"
#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::rigid_body;

namespace {

constexpr double kGolden = 1e-10;  ///< relative to 1 + the largest entry

JointVector full(const Eigen::VectorXd& v) {
  JointVector out = JointVector::Zero();
  out.head(v.size()) = v;
  return out;
}

void check_close(const Eigen::MatrixXd& value, const Eigen::MatrixXd& expected) {
  CHECK(max_difference(value, expected) <= kGolden * (1.0 + expected.cwiseAbs().maxCoeff()));
}

void check_chain(const std::string& file_name) {
  const YAML::Node file = load_golden(file_name);
  const BookChain book = read_book_chain(file);
  const ScrewTree tree = book.tree();
  const int n = tree.num_joints;
  const JointVector zero = JointVector::Zero();
  for (const YAML::Node& c : golden_cases(file)) {
    const JointVector theta = full(golden_vector(c, "theta")), thetad = full(golden_vector(c, "dtheta")),
                      thetadd = full(golden_vector(c, "ddtheta"));
    const Load load{golden_vector<3>(c, "g"), book.tip(), golden_vector<6>(c, "Ftip")};
    const Load none{Vector3::Zero(), book.tip(), Vector6::Zero()};
    const Load wrench{Vector3::Zero(), book.tip(), load.F_tip};
    const JointVector tau = inverse_dynamics(tree, theta, thetad, thetadd, load);
    check_close(tau.head(n), golden_vector(c, "tau"));
    check_close(inverse_dynamics(tree, theta, thetad, zero, none).head(n), golden_vector(c, "c"));
    check_close(inverse_dynamics(tree, theta, zero, zero, wrench).head(n), golden_vector(c, "JTF"));
    check_close(joint_gravity(tree, theta, load.gravity).head(n), golden_vector(c, "grav"));
    JointMatrix M, C;
    joint_mass_matrix(tree, theta, M);
    check_close(M, golden_matrix(c, "M"));
    coriolis_matrix(tree, theta, thetad, C);
    check_close(C * thetad.head(n), golden_vector(c, "c"));
    JointVector found;
    REQUIRE(forward_dynamics(tree, theta, thetad, full(golden_vector(c, "tau")), load, found));
    check_close(found.head(n), golden_vector(c, "ddtheta_fd"));
    JointJacobian J_b;
    body_jacobian(tree, book.tip(), theta, J_b);
    check_close(J_b.transpose() * load.F_tip, golden_vector(c, "JTF"));
  }
}

}  // namespace

TEST_CASE("NewtonEulerReproducesTheBooksThreeJointExampleWhoseFirstScrewIsNotUnit") { check_chain("rnea_mr3r.json"); }

TEST_CASE("NewtonEulerReproducesThePlanarArm") { check_chain("rnea_planar3R_unit.json"); }

TEST_CASE("NewtonEulerReproducesTheSixJointArm") { check_chain("rnea_ur5.json"); }

TEST_CASE("NewtonEulerOfASingleBodyIsItsWrenchAtTheCentreOfMass") {
  // f = m (vd + omega x v), moment = I omegad + omega x I omega (8.22, 8.23).
  const YAML::Node file = load_golden("wrench003.json");
  for (const YAML::Node& c : golden_cases(file)) {
    Vector6 V, Vd, expected;
    V << golden_vector<3>(c, "omega"), golden_vector<3>(c, "v");
    Vd << golden_vector<3>(c, "omega_dot"), golden_vector<3>(c, "v_dot");
    expected << golden_vector<3>(c, "moment"), golden_vector<3>(c, "force");
    const SpatialInertia G{golden_matrix<3, 3>(c, "I"), golden_number(c, "m")};
    check_close(single_body_wrench(G, V, Vd), expected);

    // The recursion over a tree of one body says the same.
    ScrewTree body;
    body.G[0] = G;
    const JointVector none = JointVector::Zero();
    BodySixVectors F_out;
    F_out.fill(Vector6::Zero());
    JointVector tau;
    Vector6 F;
    newton_euler(body, none, none, none, V, Vd, F_out, F, tau);
    check_close(F, expected);
  }
}

TEST_CASE("RateOfTheMassMatrixLessTwiceTheCoriolisMatrixIsSkew") {
  constexpr double kStep = 1e-6, kDifference = 1e-7;
  const Model models[] = {Biped().model, skew_tree()};
  for (const Model& model : models) {
    const ScrewTree tree = screw_tree(model);
    const int n = tree.num_joints;
    Random random(47);
    for (int k = 0; k < 30; ++k) {
      const State state = random_state(model, random);
      JointMatrix before, after, C;
      joint_mass_matrix(tree, state.q - kStep * state.qd, before);
      joint_mass_matrix(tree, state.q + kStep * state.qd, after);
      coriolis_matrix(tree, state.q, state.qd, C);
      const JointMatrix N = (after - before) / (2.0 * kStep) - 2.0 * C;
      CHECK(max_difference(N, -N.transpose()) < kDifference);
      const Load none{Vector3::Zero(), {}, Vector6::Zero()};
      check_close(C * state.qd.head(n), inverse_dynamics(tree, state.q, state.qd, JointVector::Zero(), none).head(n));
    }
  }
}

TEST_CASE("MassMatrixOfTheScrewsIsTheJointsBlockOfTheModels") {
  const Model models[] = {Biped().model, skew_tree()};
  for (const Model& model : models) {
    const ScrewTree tree = screw_tree(model);
    Random random(53);
    for (int k = 0; k < 30; ++k) {
      const State state = random_state(model, random);
      JointMatrix M;
      joint_mass_matrix(tree, state.q, M);
      MatrixNu whole;
      mass_matrix(model, state, whole);
      check_close(M, whole.bottomRightCorner(model.num_joints, model.num_joints));
    }
  }
}

TEST_CASE("ForwardDynamicsOfAJointThatMovesNoMassIsRefused") {
  ScrewTree tree = screw_tree(skew_tree());
  tree.G.fill({});
  JointVector thetadd = JointVector::Ones();
  const JointVector zero = JointVector::Zero();
  CHECK(!forward_dynamics(tree, zero, zero, JointVector::Ones(), {}, thetadd));
  CHECK(thetadd == zero);
}
