// The centroidal model: reference vectors of document 000, finite differences of the nonlinear rigid body, the Riccati
// equation.
#include "controller/centroidal/centroidal.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <random>
#include <stdexcept>

#include "tests/force_qp/problems.hpp"
#include "tests/support/golden.hpp"

using namespace stance;
using namespace stance::centroidal;
using namespace stance::test;
using force_qp::test::body;
using force_qp::test::kWeight;
using force_qp::test::stand_linearisation;
using force_qp::test::stand_weights;

namespace {

constexpr double kGoldenTolerance = 1e-10;  // relative and absolute
constexpr double kExactTolerance = 1e-14;   // where only the order of additions differs
constexpr double kDifferenceStep = 1e-5;
constexpr double kDifferenceTolerance = 1e-8;  // of a central difference of step 1e-5
constexpr double kRiccatiTolerance = 1e-9;     // of the equation, relative to P
constexpr double kStandResistance = 0.1;       // R of standing

template <typename A, typename B>
void check_golden(const Eigen::MatrixBase<A>& value, const Eigen::MatrixBase<B>& golden) {
  CHECK(max_difference(value, golden) <= kGoldenTolerance * (1.0 + golden.cwiseAbs().maxCoeff()));
}

/// One step of the nonlinear rigid body in the model's discretisation, gyroscopic term left out, at small roll and
/// pitch: everything explicit Euler, arms taken from the centre of mass as it is.
StateVector nonlinear_step(const Parameters& parameters, const StateVector& x, const ForceVector& f,
                           const ContactVectors& contacts, double dt) {
  const Matrix3 Rz = math::rotation_z(x(2));
  const Matrix3 inertia = Rz * parameters.inertia_body * Rz.transpose();
  Vector3 force = Vector3::Zero();
  Vector3 moment = Vector3::Zero();
  for (Eigen::Index i = 0; i < f.size() / 3; ++i) {
    const Vector3 contact_force = f.segment<3>(3 * i);
    force += contact_force;
    moment += (contacts[static_cast<std::size_t>(i)] - x.segment<3>(3)).cross(contact_force);
  }
  StateVector next = x;
  next.head<3>() += dt * Rz.transpose() * x.segment<3>(6);
  next.segment<3>(3) += dt * x.tail<3>();
  next.segment<3>(6) += dt * inertia.inverse() * moment;
  next.tail<3>() += dt * (force / parameters.mass + Vector3(0.0, 0.0, -kGravity));
  return next;
}

struct Case {
  Parameters parameters;
  Linearisation at;
  ContactVectors contacts{};  // m, in W
  StateVector x = StateVector::Zero();
  ForceVector f;
};

Case random_case(int num_contacts, bool coupling, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&] { return Vector3(uniform(random), uniform(random), uniform(random)); };
  Case c;
  c.parameters.mass = 10.0 + 5.0 * uniform(random);
  const Matrix3 root = Matrix3::Identity() + 0.3 * (Matrix3() << vector(), vector(), vector()).finished();
  c.parameters.inertia_body = 0.3 * root * root.transpose();
  c.at.dt = 0.01;
  c.at.yaw = M_PI * uniform(random);
  c.at.num_contacts = num_contacts;
  c.at.coupling = coupling;
  c.at.p_ref = vector();
  c.f.resize(3 * num_contacts);
  c.at.force_ref.setZero();
  for (int i = 0; i < num_contacts; ++i) {
    const auto contact = static_cast<std::size_t>(i);
    c.contacts[contact] = c.at.p_ref + vector();
    c.at.r[contact] = c.contacts[contact] - c.at.p_ref;
    c.f.segment<3>(3 * i) = 100.0 * vector();
    c.at.force_ref += c.f.segment<3>(3 * i);
  }
  for (int i = 0; i < 12; ++i) c.x(i) = uniform(random);
  c.x(2) = c.at.yaw;
  return c;
}

/// By squaring: the norm of matrix^(2^n), to the power of 2^-n. Good to 1e-4.
double spectral_radius(Eigen::MatrixXd matrix) {
  constexpr int kSquarings = 20;
  double log_radius = 0.0;
  for (int i = 0; i < kSquarings; ++i) {
    const double norm = matrix.norm();
    log_radius += std::ldexp(std::log(norm), -i);
    matrix /= norm;
    matrix = (matrix * matrix).eval();
  }
  return std::exp(log_radius);
}

Dynamics standing_dynamics(int num_contacts, bool coupling) {
  Dynamics out;
  dynamics(body(), stand_linearisation(num_contacts, coupling), out);
  return out;
}

}  // namespace

TEST_CASE("GoldenCentroidalModelHolds") {
  const YAML::Node golden = load_golden("centroidal000.json");
  for (const YAML::Node& node : golden_cases(golden)) {
    Parameters parameters;
    parameters.mass = golden_number(node, "mass");
    parameters.inertia_body = golden_matrix<3, 3>(node, "I_body");
    const StateVector x = golden_vector<12>(node, "x");
    const ForceVector f = golden_vector<6>(node, "f");
    Linearisation at;
    at.dt = golden_number(node, "dt");
    at.yaw = x(2);
    at.num_contacts = 2;
    at.r[0] = golden_vector<3>(node, "r1");
    at.r[1] = golden_vector<3>(node, "r2");
    Dynamics out;
    dynamics(parameters, at, out);
    check_golden(out.A, golden_matrix<12, 12>(node, "A"));
    check_golden(out.B, golden_matrix<12, 6>(node, "B"));
    check_golden(out.g, golden_vector<12>(node, "g"));
    check_golden(out.A * x + out.B * f + out.g, golden_vector<12>(node, "x_next"));
    const Eigen::MatrixXd R = golden_matrix(node, "R");
    if (R.isDiagonal()) {
      const double norm = golden_number(node, "norm_R");
      CHECK(std::abs(effort(f, R.diagonal()) - norm) <= kGoldenTolerance * (1.0 + norm));
    }
  }
}

TEST_CASE("EffortIsTheRootOfTheWeightedSquares") {
  const ForceVector f = (ForceVector(3) << 3.0, -4.0, 12.0).finished();
  CHECK(std::abs(effort(f, ForceVector::Ones(3)) - 13.0) <= kExactTolerance * 13.0);
  CHECK(std::abs(effort(f, (ForceVector(3) << 4.0, 1.0, 0.0).finished()) - std::sqrt(52.0)) <= kExactTolerance * 13.0);
}

TEST_CASE("CoupledModelIsTheRigidBodysFirstOrderExpansion") {
  std::mt19937_64 random(1);
  for (int num_contacts : {1, 2, 3, 4}) {
    for (int repeat = 0; repeat < 10; ++repeat) {
      Case c = random_case(num_contacts, true, random);
      c.x.segment<3>(3) = c.at.p_ref;
      Dynamics out;
      dynamics(c.parameters, c.at, out);
      const auto step = [&](const StateVector& x, const ForceVector& f) {
        return nonlinear_step(c.parameters, x, f, c.contacts, c.at.dt);
      };
      CHECK(max_difference(out.A * c.x + out.B * c.f + out.g, step(c.x, c.f)) <= kDifferenceTolerance);
      for (int i = 0; i < 12; ++i) {
        if (i == 2) continue;  // the yaw is a parameter of the model, not a variable
        const StateVector d = kDifferenceStep * StateVector::Unit(i);
        const StateVector column = (step(c.x + d, c.f) - step(c.x - d, c.f)) / (2.0 * kDifferenceStep);
        CHECK(max_difference(out.A.col(i), column) <= kDifferenceTolerance);
      }
      for (int i = 0; i < 3 * num_contacts; ++i) {
        const ForceVector d = kDifferenceStep * ForceVector::Unit(3 * num_contacts, i);
        const StateVector column = (step(c.x, c.f + d) - step(c.x, c.f - d)) / (2.0 * kDifferenceStep);
        CHECK(max_difference(out.B.col(i), column) <= kDifferenceTolerance);
      }
    }
  }
}

TEST_CASE("WithoutCouplingTheArmsAreFrozen") {
  std::mt19937_64 random(2);
  const Case c = random_case(2, false, random);
  Dynamics out;
  dynamics(c.parameters, c.at, out);
  CHECK(out.A.block<3, 3>(6, 3).isZero(0.0));
  StateVector moved = c.x;
  moved.segment<3>(3) += Vector3(0.3, -0.2, 0.1);
  const StateVector change = out.A * (moved - c.x);
  CHECK(change.segment<3>(6).isZero(0.0));
}

TEST_CASE("EveryContactHasItsOwnColumns") {
  std::mt19937_64 random(3);
  Case c = random_case(4, true, random);
  Dynamics all;
  dynamics(c.parameters, c.at, all);
  CHECK(all.B.cols() == 12);
  for (int i = 0; i < 4; ++i) {
    Linearisation one = c.at;
    one.num_contacts = 1;
    one.r[0] = c.at.r[static_cast<std::size_t>(i)];
    Dynamics single;
    dynamics(c.parameters, one, single);
    CHECK((single.B == all.B.middleCols(3 * i, 3)));
    CHECK((single.A == all.A));
  }
}

TEST_CASE("MassAndInertiaScaleTheForces") {
  std::mt19937_64 random(4);
  Case c = random_case(2, true, random);
  Dynamics light;
  dynamics(c.parameters, c.at, light);
  c.parameters.mass *= 2.0;
  c.parameters.inertia_body *= 4.0;
  Dynamics heavy;
  dynamics(c.parameters, c.at, heavy);
  CHECK(max_difference(2.0 * heavy.B.bottomRows<3>(), light.B.bottomRows<3>()) <= kExactTolerance);
  CHECK(max_difference(4.0 * heavy.B.middleRows<3>(6), light.B.middleRows<3>(6)) <= kExactTolerance);
  CHECK(heavy.g(11) == light.g(11));
}

TEST_CASE("StandingOnTwoPointFeetIsStableWithTheCoupling") {
  for (int num_contacts : {2, 3, 4}) {
    const Dynamics model = standing_dynamics(num_contacts, true);
    const StateVector Q = stand_weights();
    const ForceVector R = ForceVector::Constant(3 * num_contacts, kStandResistance);
    const Eigen::MatrixXd P = riccati_terminal_cost(model, Q, R);
    const Eigen::MatrixXd A = model.A;
    const Eigen::MatrixXd B = model.B;
    const Eigen::MatrixXd Quu = Eigen::MatrixXd(R.asDiagonal()) + B.transpose() * P * B;
    const Eigen::MatrixXd K = Quu.ldlt().solve(B.transpose() * P * A);
    const Eigen::MatrixXd fixed_point = Eigen::MatrixXd(Q.asDiagonal()) + A.transpose() * P * (A - B * K);
    CHECK((fixed_point - P).norm() <= kRiccatiTolerance * P.norm());
    CHECK((P == P.transpose()));
    CHECK(Eigen::LLT<Eigen::MatrixXd>(P).info() == Eigen::Success);
    CHECK(spectral_radius(A) > 1.0);
    CHECK(spectral_radius(A - B * K) < 0.999);
  }
}

TEST_CASE("WithoutTheCouplingTwoPointFeetHaveNoTerminalCost") {
  const ForceVector R = ForceVector::Constant(6, kStandResistance);
  CHECK_THROWS_AS(riccati_terminal_cost(standing_dynamics(2, false), stand_weights(), R), std::invalid_argument);
}

TEST_CASE("OnePointFootHasNoTerminalCost") {
  const ForceVector R = ForceVector::Constant(3, kStandResistance);
  CHECK_THROWS_AS(riccati_terminal_cost(standing_dynamics(1, true), stand_weights(), R), std::invalid_argument);
}
