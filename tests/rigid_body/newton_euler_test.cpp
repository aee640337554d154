// The recursion of eqs 8.50-8.54 against reference vectors (40-digit arithmetic). dynamics_test.cpp tests what stands
// on it.
#include "controller/rigid_body/newton_euler.hpp"

#include <catch2/catch_test_macros.hpp>

#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;
using rigid_body::BodySixVectors;
using rigid_body::ScrewTree;
using rigid_body::SpatialInertia;

namespace {

constexpr double kGolden = 1e-10;  ///< relative to 1 + the largest entry

/// An open chain in the book's convention: M_(i-1,i), G_i and space screws S_i.
struct Chain {
  ScrewTree tree;
  RigidTransform M_tip;  ///< M_(n+1,n)

  explicit Chain(const YAML::Node& file) : Chain(read_book_chain(file)) {}
  explicit Chain(const BookChain& book) : tree(book.tree()), M_tip(book.M.back().inverse()) {}

  Eigen::VectorXd torques(const Eigen::VectorXd& theta, const Eigen::VectorXd& thetad, const Eigen::VectorXd& thetadd,
                          const Vector3& g, const Vector6& F_tip) const {
    const auto full = [](const Eigen::VectorXd& v) {
      JointVector out = JointVector::Zero();
      out.head(v.size()) = v;
      return out;
    };
    Vector6 Vd_0, F_0;
    Vd_0 << Vector3::Zero(), -g;
    BodySixVectors F_out;
    F_out.fill(Vector6::Zero());
    // The book's last link carries a frame n + 1 at its tip.
    F_out[tree.num_joints] = math::adjoint_transpose_times(M_tip, F_tip);
    JointVector tau;
    rigid_body::newton_euler(tree, full(theta), full(thetad), full(thetadd), Vector6::Zero(), Vd_0, F_out, F_0, tau);
    return tau.head(tree.num_joints);
  }
};

void check_close(const Eigen::MatrixXd& value, const Eigen::MatrixXd& expected) {
  CHECK(max_difference(value, expected) <= kGolden * (1.0 + expected.cwiseAbs().maxCoeff()));
}

void check_chain(const std::string& file_name) {
  const YAML::Node file = load_golden(file_name);
  const Chain chain(file);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(chain.tree.num_joints);
  for (const YAML::Node& c : golden_cases(file)) {
    const Eigen::VectorXd theta = golden_vector(c, "theta"), thetad = golden_vector(c, "dtheta"),
                          thetadd = golden_vector(c, "ddtheta");
    const Vector3 g = golden_vector<3>(c, "g");
    const Vector6 F_tip = golden_vector<6>(c, "Ftip");
    const Vector6 no_wrench = Vector6::Zero();
    check_close(chain.torques(theta, thetad, thetadd, g, F_tip), golden_vector(c, "tau"));
    check_close(chain.torques(theta, thetad, zero, Vector3::Zero(), no_wrench), golden_vector(c, "c"));
    check_close(chain.torques(theta, zero, zero, g, no_wrench), golden_vector(c, "grav"));
    check_close(chain.torques(theta, zero, zero, Vector3::Zero(), F_tip), golden_vector(c, "JTF"));
    Eigen::MatrixXd M(zero.size(), zero.size());
    for (int j = 0; j < M.cols(); ++j) {
      M.col(j) = chain.torques(theta, zero, Eigen::VectorXd::Unit(M.cols(), j), Vector3::Zero(), no_wrench);
    }
    check_close(M, golden_matrix(c, "M"));
    // The recursion is affine in the accelerations, so this inverts it.
    const Eigen::VectorXd bias = chain.torques(theta, thetad, zero, g, F_tip);
    check_close(M.ldlt().solve(golden_vector(c, "tau") - bias), golden_vector(c, "ddtheta_fd"));
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
    check_close(rigid_body::single_body_wrench(G, V, Vd), expected);

    // The recursion over a tree of one body says the same.
    ScrewTree body;
    body.G[0] = G;
    const JointVector none = JointVector::Zero();
    BodySixVectors F_out;
    F_out.fill(Vector6::Zero());
    JointVector tau;
    Vector6 F;
    rigid_body::newton_euler(body, none, none, none, V, Vd, F_out, F, tau);
    check_close(F, expected);
  }
}
