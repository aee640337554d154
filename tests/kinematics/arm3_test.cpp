// The 3-joint arm of document 004: reference vectors, the map kept by velocities, and the document's own printout.
#include "controller/kinematics/arm3.hpp"

#include <Eigen/SVD>
#include <catch2/catch_test_macros.hpp>
#include <cstdio>

#include "controller/kinematics/arm3_literal.hpp"
#include "controller/rigid_body/chain.hpp"
#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::kinematics;

namespace {

constexpr double kGolden = 1e-10;
constexpr double kOrthonormal = 1e-12;
constexpr double kDt = 0.01;  ///< s, the document's

Arm3Geometry geometry(const YAML::Node& c) {
  const Vector3 l = golden_vector<3>(c, "l");
  return {l(0), l(1), l(2)};
}

/// The arm's map kept by velocities alone, beside its joint angles by Euler's method.
struct Walk {
  Arm3Geometry arm;
  Arm3Integrator integrator{arm};
  Arm3Motion motion;  ///< of the last step

  void step(const Vector3& thetad) { integrator.step(thetad, kDt, motion); }
  double position_error() const {
    return (motion.map.topRightCorner<3, 1>() - arm3_forward(arm, integrator.theta()).p).norm();
  }
  double orthonormality_defect() const {
    const Matrix3 R = motion.map.topLeftCorner<3, 3>();
    return max_difference(R.transpose() * R, Matrix3(Matrix3::Identity()));
  }
};

/// As the document's terminal prints a number.
std::string printed(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

template <typename Derived>
std::string printed_row(const Eigen::MatrixBase<Derived>& row) {
  std::string out;
  for (Eigen::Index i = 0; i < row.size(); ++i) {
    if (i > 0) out += ' ';
    out += printed(row(i));
  }
  return out;
}

}  // namespace

TEST_CASE("ArmOfThreeMatchesItsReferenceVectors") {
  for (const YAML::Node& c : golden_cases(load_golden("arm3_004.json"))) {
    const Arm3Geometry arm = geometry(c);
    const Vector3 theta = golden_vector<3>(c, "theta");
    const Arm3Jacobian J = arm3_jacobian(arm, theta);
    CHECK(max_difference(homogeneous(arm3_forward(arm, theta)), golden_matrix<4, 4>(c, "T")) < kGolden);
    CHECK(max_difference(J, golden_matrix<6, 3>(c, "J")) < kGolden);
    CHECK(max_difference(J * golden_vector<3>(c, "dq"), golden_vector<6>(c, "xi")) < kGolden);
    CHECK(max_difference(arm3_inverse_velocity(J, golden_vector<6>(c, "xi")), golden_vector<3>(c, "dq_ls")) < kGolden);
    CHECK(max_difference(arm3_inverse_velocity(J, golden_vector<6>(c, "xi_noisy")),
                         golden_vector<3>(c, "dq_ls_noisy")) < kGolden);
    CHECK(std::abs((J.transpose() * J).determinant() - golden_number(c, "det_JTJ")) < kGolden);
  }
}

TEST_CASE("ArmOfThreeIsTheRigidBodyCoresChain") {
  const Arm3Geometry arm;
  // Screws at theta = 0: the first about z, the others about x through (0, 0, l1) and (0, 0, l1 + l2).
  const std::vector<RigidTransform> M(3);
  std::vector<Vector6> S(3);
  S[0] << Vector3::UnitZ(), Vector3::Zero();
  S[1] << Vector3::UnitX(), Vector3(0.0, 0.0, arm.l1).cross(Vector3::UnitX());
  S[2] << Vector3::UnitX(), Vector3(0.0, 0.0, arm.l1 + arm.l2).cross(Vector3::UnitX());
  const rigid_body::ScrewTree tree = rigid_body::screw_chain(M, std::vector<rigid_body::SpatialInertia>(3), S);
  const rigid_body::Tip tip{3, arm3_forward(arm, Vector3::Zero())};
  Random random(61);
  for (int k = 0; k < 100; ++k) {
    JointVector theta = JointVector::Zero();
    theta.head<3>() = random.vector(3.0);
    const RigidTransform T = arm3_forward(arm, theta.head<3>());
    rigid_body::JointJacobian J_b;
    CHECK(max_difference(homogeneous(rigid_body::body_jacobian(tree, tip, theta, J_b)), homogeneous(T)) < kGolden);
    const Arm3Jacobian J = arm3_jacobian(arm, theta.head<3>());
    CHECK(max_difference(T.R * J_b.bottomRows<3>(), J.topRows<3>()) < kGolden);
    CHECK(max_difference(T.R * J_b.topRows<3>(), J.bottomRows<3>()) < kGolden);
  }
}

TEST_CASE("UpdatedMapMatchesItsReferenceVectors") {
  for (const YAML::Node& c : golden_cases(load_golden("map_update004.json"))) {
    Vector6 xi;
    xi << golden_vector<3>(c, "v"), golden_vector<3>(c, "omega");
    const RigidTransform map = updated_map(rigid_transform(golden_matrix<4, 4>(c, "A0")), xi, golden_number(c, "dt"));
    CHECK(max_difference(homogeneous(map), golden_matrix<4, 4>(c, "exact")) < kGolden);
  }
}

TEST_CASE("MapKeptByVelocitiesStaysWithTheArm") {
  struct Case {
    const char* trajectory;
    Vector3 (*rates)(double);
    int steps;
    double position;  ///< bound on the map's error
  };
  const Case cases[] = {{"trajectory_reconstructed", literal::arm3_rates, 600, 2e-3},
                        {"trajectory_as_printed", arm3_given_rates, 600, 3e-3},
                        {"trajectory_as_printed", arm3_given_rates, 1600, 6e-3}};
  const YAML::Node file = load_golden("map_update004.json");
  for (const Case& with : cases) {
    CAPTURE(with.trajectory, with.steps);
    Walk walk;
    const YAML::Node samples = file[with.trajectory];
    std::size_t sample = 0;
    for (int k = 0; k < with.steps; ++k) {
      walk.step(with.rates(k * kDt));
      CHECK(walk.orthonormality_defect() < kOrthonormal);
      if (sample == samples.size() || samples[sample]["n"].as<int>() != k + 1) continue;
      const YAML::Node& golden = samples[sample++];
      CHECK(max_difference(walk.integrator.theta(), golden_vector<3>(golden, "theta")) < kGolden);
      CHECK(max_difference(walk.motion.v, golden_vector<3>(golden, "v")) < kGolden);
      CHECK(max_difference(walk.motion.omega, golden_vector<3>(golden, "omega")) < kGolden);
      CHECK(max_difference(walk.motion.map, golden_matrix<4, 4>(golden, "map_exact")) < kGolden);
    }
    CHECK(sample > 0);
    CHECK(walk.position_error() <= with.position);
  }
}

TEST_CASE("LeastSquaresFindsTheGivenRatesAgain") {
  // The document's figures: calculated over given rates.
  Walk walk;
  for (int k = 0; k < 1600; ++k) {
    const Vector3 given = arm3_given_rates(k * kDt);
    walk.step(given);
    CHECK(max_difference(walk.motion.calculated_rate, given) < kGolden);
    CHECK(walk.motion.given_rate == given);
  }
}

TEST_CASE("TheMapBeginsWhereTheArmDoes") {
  Arm3Integrator integrator{Arm3Geometry{}};
  const Vector3 theta(0.3, -0.8, 1.1);
  integrator.start(theta);
  Arm3Motion motion;
  integrator.step(Vector3::Zero(), kDt, motion);
  CHECK(max_difference(motion.map, homogeneous(arm3_forward({}, theta))) < kOrthonormal);
  CHECK(integrator.theta() == theta);
}

TEST_CASE("SmoothRatesLeaveAndReturnWithoutAJumpUpToTheirSecondDerivative") {
  const Vector3 peak(0.5, -0.2, 0.4);
  constexpr double duration = 12.0, h = 1e-3;
  CHECK(arm3_smooth_rates(peak, duration, -h).isZero());
  CHECK(arm3_smooth_rates(peak, duration, duration + h).isZero());
  CHECK(max_difference(arm3_smooth_rates(peak, duration, duration / 4.0), peak) < kOrthonormal);
  Vector3 way = Vector3::Zero();
  for (int k = -10; k < static_cast<int>(duration / h) + 10; ++k) {
    const auto rate = [&](int at) { return arm3_smooth_rates(peak, duration, at * h); };
    const Vector3 third = (rate(k + 3) - 3.0 * rate(k + 2) + 3.0 * rate(k + 1) - rate(k)) / (h * h * h);
    CHECK(third.norm() < 2.0);  // of a jump in the second derivative it would be 1 / h times that
    way += rate(k) * h;
  }
  CHECK(way.norm() < 1e-9);
}

TEST_CASE("LiteralModeReproducesTheDocumentsTerminal") {
  const Arm3Geometry arm;
  Vector3 theta = Vector3::Zero();
  Eigen::Matrix4d map = homogeneous(arm3_forward(arm, theta));
  Vector6 xi;
  // It moves the angles first, and prints the velocities and the map one step before the Jacobian.
  for (int k = 0; k < 599; ++k) {
    const Vector3 thetad = literal::arm3_rates(k * kDt);
    theta += thetad * kDt;
    xi = literal::arm3_velocity(arm, theta, thetad);
    map = literal::updated_map(map, xi, kDt);
  }
  theta += literal::arm3_rates(599 * kDt) * kDt;
  const Arm3Jacobian J = literal::arm3_jacobian(arm, theta);

  // To the digits that the document prints.
  CHECK(printed_row(xi.head<3>()) == "0.00472567 0.158093 -0.145229");
  CHECK(printed_row(xi.tail<3>()) == "0.00815092 0.309893 0.3");
  CHECK(printed_row(xi.tail<3>() * kDt) == "8.15092e-05 0.00309893 0.003");
  CHECK(printed_row(xi.head<3>() * kDt) == "4.72567e-05 0.00158093 -0.00145229");
  const char* const map_rows[] = {"0.928318 -0.0794238 0.17029 1.89399", "-0.0244199 0.00208632 0.998128 0.471623",
                                  "-0.160193 -1.07144 0.41007 -0.998296", "0 0 0 1"};
  for (int r = 0; r < 4; ++r) CHECK(printed_row(map.row(r)) == map_rows[r]);
  const char* const jacobian_rows[] = {"0.012281 0.48329 -0.0158199", "0.527068 -0.0112609 0.000368612",
                                       "0 0.471009 -0.49975",         "0 0.0232942 0.998491",
                                       "0 0.0549224 0.999729",        "1 0 0"};
  for (int r = 0; r < 6; ++r) CHECK(printed_row(J.row(r)) == jacobian_rows[r]);

  const YAML::Node golden = load_golden("map_update004.json")["terminal_output_reproduction"];
  CHECK(max_difference(map, golden_matrix<4, 4>(golden, "map")) < kGolden);
  CHECK(max_difference(J, golden_matrix<6, 3>(golden, "J")) < kGolden);
  // What the document takes for a rotation is none.
  const Vector3 singular = Eigen::JacobiSVD<Matrix3>(Matrix3(map.topLeftCorner<3, 3>())).singularValues();
  CHECK(singular(0) > 1.2);
  CHECK(singular(2) < 0.85);
}
