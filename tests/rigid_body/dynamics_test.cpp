// Kinematics and dynamics against finite differences and conservation laws, on a floating biped and on a skew tree.
#include <Eigen/Cholesky>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/support/golden.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::rigid_body;

namespace {

constexpr double kExact = 1e-10;  ///< relative to 1 + the largest entry
constexpr double kStep = 1e-5;    ///< s or rad, of central differences
constexpr double kDifference =
    2e-7;  ///< relative to 1 + the largest entry: the step's square, and rounding over the step
constexpr unsigned kSeed = 23;
constexpr int kCases = 30;

template <typename A, typename B>
bool close(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b, double tolerance) {
  return max_difference(a, b) <= tolerance * (1.0 + b.cwiseAbs().maxCoeff());
}

/// The claim, on random states of both robots.
template <typename Claim>
void on_random_states(const Claim& claim) {
  const Biped biped;
  for (const Model& model : {biped.model, skew_tree()}) {
    Random random(kSeed);
    CAPTURE(model.name);
    for (int k = 0; k < kCases; ++k) claim(model, random_state(model, random), random);
  }
}

struct Momentum {
  Vector3 linear = Vector3::Zero();
  Vector3 angular = Vector3::Zero();  ///< about W's origin
};

/// The plain sum over bodies.
Momentum momentum(const Model& model, const Kinematics& kinematics) {
  Momentum out;
  for (int b = 0; b < model.num_bodies(); ++b) {
    const Matrix3 inertia_W = kinematics.R_W[b] * model.bodies[b].inertia * kinematics.R_W[b].transpose();
    const Vector3 p = model.bodies[b].mass * kinematics.v_com_W[b];
    out.linear += p;
    out.angular += inertia_W * kinematics.w_W[b] + kinematics.com_W[b].cross(p);
  }
  return out;
}

double kinetic_energy(const Model& model, const Kinematics& kinematics) {
  double energy = 0.0;
  for (int b = 0; b < model.num_bodies(); ++b) {
    const Vector3 w_body = kinematics.R_W[b].transpose() * kinematics.w_W[b];
    energy += 0.5 * model.bodies[b].mass * kinematics.v_com_W[b].squaredNorm() +
              0.5 * w_body.dot(model.bodies[b].inertia * w_body);
  }
  return energy;
}

double potential_energy(const Model& model, const Kinematics& kinematics) {
  double energy = 0.0;
  for (int b = 0; b < model.num_bodies(); ++b) energy += model.bodies[b].mass * kGravity * kinematics.com_W[b].z();
  return energy;
}

MatrixNu mass_matrix_of(const Model& model, const State& state) {
  MatrixNu M;
  mass_matrix(model, state, M);
  return M;
}

VectorNu inverse_dynamics_of(const Model& model, const State& state, const VectorNu& nud) {
  VectorNu tau;
  inverse_dynamics(model, state, nud, tau);
  return tau;
}

}  // namespace

TEST_CASE("LinkVelocitiesAreTheDerivativesOfLinkPoses") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const VectorNu nu = velocity_of(model, state);
    const Kinematics now = kinematics_of(model, state);
    const Kinematics after = kinematics_of(model, moved(model, state, nu, kStep));
    const Kinematics before = kinematics_of(model, moved(model, state, nu, -kStep));
    for (int b = 0; b < model.num_bodies(); ++b) {
      CHECK(close((after.com_W[b] - before.com_W[b]) / (2.0 * kStep), now.v_com_W[b], kDifference));
      const Vector3 w = math::log_so3(after.R_W[b] * before.R_W[b].transpose()) / (2.0 * kStep);
      CHECK(close(w, now.w_W[b], kDifference));
    }
  });
}

TEST_CASE("GeometricJacobianIsTheDerivativeOfThePose") {
  on_random_states([](const Model& model, const State& state, Random& random) {
    const Kinematics now = kinematics_of(model, state);
    for (int body = 0; body < model.num_bodies(); ++body) {
      const Vector3 point = random.vector(0.5);  // in the link frame
      const auto p_W = [&](const Kinematics& k) -> Vector3 { return k.p_W[body] + k.R_W[body] * point; };
      Jacobian J;
      geometric_jacobian(model, state, now, body, p_W(now), J);
      REQUIRE(J.cols() == 6 + model.num_joints);
      Jacobian difference(6, J.cols());
      for (int c = 0; c < J.cols(); ++c) {
        const VectorNu unit = VectorNu::Unit(J.cols(), c);
        const Kinematics after = kinematics_of(model, moved(model, state, unit, kStep));
        const Kinematics before = kinematics_of(model, moved(model, state, unit, -kStep));
        difference.col(c) << math::log_so3(after.R_W[body] * before.R_W[body].transpose()), p_W(after) - p_W(before);
        difference.col(c) /= 2.0 * kStep;
      }
      CHECK(close(J, difference, kDifference));
    }
  });
}

TEST_CASE("GeometricJacobianTimesVelocityIsThePointsVelocity") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const Kinematics now = kinematics_of(model, state);
    for (int body = 0; body < model.num_bodies(); ++body) {
      Jacobian J;
      geometric_jacobian(model, state, now, body, now.com_W[body], J);
      Vector6 twist;
      twist << now.w_W[body], now.v_com_W[body];
      CHECK(close(J * velocity_of(model, state), twist, kExact));
    }
  });
}

TEST_CASE("MassMatrixIsTheInverseDynamicsOfUnitAccelerations") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const MatrixNu M = mass_matrix_of(model, state);
    const VectorNu bias = inverse_dynamics_of(model, state, VectorNu::Zero(M.cols()));
    MatrixNu columns(M.rows(), M.cols());
    for (int c = 0; c < M.cols(); ++c) {
      columns.col(c) = inverse_dynamics_of(model, state, VectorNu::Unit(M.cols(), c)) - bias;
    }
    CHECK(close(M, columns, kExact));
  });
}

TEST_CASE("MassMatrixIsSymmetricAndPositiveDefinite") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const MatrixNu M = mass_matrix_of(model, state);
    CHECK(max_difference(M, MatrixNu(M.transpose())) == 0.0);
    CHECK(M.llt().info() == Eigen::Success);
  });
}

TEST_CASE("MassMatrixGivesTheKineticEnergy") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const VectorNu nu = velocity_of(model, state);
    const double energy = kinetic_energy(model, kinematics_of(model, state));
    CHECK(std::abs(0.5 * nu.dot(mass_matrix_of(model, state) * nu) - energy) <= kExact * (1.0 + energy));
  });
}

TEST_CASE("GravityTorquesAreTheDerivativeOfThePotentialEnergy") {
  on_random_states([](const Model& model, const State& state, Random&) {
    VectorNu tau;
    gravity_torques(model, state, tau);
    VectorNu difference(tau.size());
    for (int c = 0; c < tau.size(); ++c) {
      const VectorNu unit = VectorNu::Unit(tau.size(), c);
      difference(c) = (potential_energy(model, kinematics_of(model, moved(model, state, unit, kStep))) -
                       potential_energy(model, kinematics_of(model, moved(model, state, unit, -kStep)))) /
                      (2.0 * kStep);
    }
    CHECK(close(tau, difference, kDifference));
  });
}

TEST_CASE("PowerOfInverseDynamicsIsTheRateOfEnergy") {
  on_random_states([](const Model& model, const State& state, Random& random) {
    const VectorNu nud = random_acceleration(model, random);
    const auto kinetic = [&](double t) {
      return kinetic_energy(model, kinematics_of(model, accelerated(model, state, nud, t)));
    };
    const auto energy = [&](double t) {
      return kinetic(t) + potential_energy(model, kinematics_of(model, accelerated(model, state, nud, t)));
    };
    const double power = inverse_dynamics_of(model, state, nud).dot(velocity_of(model, state));
    const double difference = (energy(kStep) - energy(-kStep)) / (2.0 * kStep);
    CHECK(std::abs(difference - power) <= kDifference * (1.0 + kinetic(0.0)));
  });
}

TEST_CASE("BaseWrenchOfInverseDynamicsIsTheRateOfMomentumLessGravity") {
  on_random_states([](const Model& model, const State& state, Random& random) {
    const VectorNu nud = random_acceleration(model, random);
    const Momentum after = momentum(model, kinematics_of(model, accelerated(model, state, nud, kStep)));
    const Momentum before = momentum(model, kinematics_of(model, accelerated(model, state, nud, -kStep)));
    Centroidal c;
    centroidal(model, kinematics_of(model, state), c);
    const Vector3 weight(0.0, 0.0, -kGravity * c.mass);
    const Vector3 force = (after.linear - before.linear) / (2.0 * kStep) - weight;
    const Vector3 moment_W = (after.angular - before.angular) / (2.0 * kStep) - c.p_WC.cross(weight);
    const VectorNu tau = inverse_dynamics_of(model, state, nud);
    CHECK(close(tau.segment<3>(3), force, kDifference));
    CHECK(close(tau.head<3>(), moment_W - state.p_WB.cross(force), 10.0 * kDifference));
  });
}

TEST_CASE("FreeFallNeedsNoForce") {
  on_random_states([](const Model& model, const State& state, Random&) {
    State falling = state;
    falling.w_WB_W.setZero();
    falling.qd.setZero();
    VectorNu nud = VectorNu::Zero(6 + model.num_joints);
    nud(5) = -kGravity;
    CHECK(inverse_dynamics_of(model, falling, nud).cwiseAbs().maxCoeff() < kExact);
  });
}

TEST_CASE("InverseDynamicsDoesNotDependOnPlaceHeadingOrUniformMotion") {
  on_random_states([](const Model& model, const State& state, Random& random) {
    const VectorNu nud = random_acceleration(model, random);
    const Matrix3 R = math::rotation_z(random.number(-3.0, 3.0));
    State other = state;
    other.p_WB = random.vector(10.0);
    other.R_WB = R * state.R_WB;
    other.w_WB_W = R * state.w_WB_W;
    other.v_WB = R * state.v_WB + random.vector(5.0);
    VectorNu other_nud = nud;
    other_nud.head<3>() = R * nud.head<3>();
    other_nud.segment<3>(3) = R * nud.segment<3>(3);
    VectorNu expected = inverse_dynamics_of(model, state, nud);
    expected.head<3>() = R * expected.head<3>();
    expected.segment<3>(3) = R * expected.segment<3>(3);
    CHECK(close(inverse_dynamics_of(model, other, other_nud), expected, kExact));
  });
}

TEST_CASE("CentroidalMomentumIsTheSumOverBodies") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const Kinematics k = kinematics_of(model, state);
    const Momentum sum = momentum(model, k);
    Centroidal c;
    centroidal(model, k, c);
    CHECK(std::abs(c.mass - model.total_mass) < kExact);
    CHECK(close(c.mass * c.v_WC, sum.linear, kExact));
    CHECK(close(c.L_C_W, sum.angular - c.p_WC.cross(sum.linear), kExact));
  });
}

TEST_CASE("CentroidalMomentumMatrixTimesVelocityIsTheMomentum") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const Kinematics k = kinematics_of(model, state);
    Centroidal c;
    centroidal(model, k, c);
    Matrix6Nu A_G;
    centroidal_momentum_matrix(model, k, A_G);
    Vector6 expected;
    expected << c.L_C_W, c.mass * c.v_WC;
    CHECK(close(A_G * velocity_of(model, state), expected, kExact));
  });
}

TEST_CASE("CentreOfMassVelocityIsTheDerivativeOfItsPosition") {
  on_random_states([](const Model& model, const State& state, Random&) {
    const auto at = [&](double t) {
      Centroidal c;
      centroidal(model, kinematics_of(model, moved(model, state, velocity_of(model, state), t)), c);
      return c;
    };
    CHECK(close((at(kStep).p_WC - at(-kStep).p_WC) / (2.0 * kStep), at(0.0).v_WC, kDifference));
  });
}

TEST_CASE("CompositeInertiaIsTheAngularMomentumOfTheRobotTurningAsOneBody") {
  on_random_states([](const Model& model, const State& state, Random&) {
    State locked = state;
    locked.qd.setZero();
    Centroidal c;
    centroidal(model, kinematics_of(model, locked), c);
    CHECK(close(c.inertia_W * locked.w_WB_W, c.L_C_W, kExact));
  });
}

TEST_CASE("FixedBaseArmMatchesIndependentTorquesAndMassMatrix") {
  const std::vector<std::string> order{"j1", "j2", "j3", "j4", "j5"};
  const Model model = model_from_urdf(golden_text("arm5.urdf"), order);
  const YAML::Node file = load_golden("rnea_arm5.json");
  for (const YAML::Node& c : golden_cases(file)) {
    State state;
    state.q.head<5>() = golden_vector<5>(c, "q");
    state.qd.head<5>() = golden_vector<5>(c, "dq");
    VectorNu nud = VectorNu::Zero(11);
    nud.tail<5>() = golden_vector<5>(c, "ddq");
    CHECK(close(inverse_dynamics_of(model, state, nud).tail<5>(), golden_vector<5>(c, "tau"), kExact));
    CHECK(close(mass_matrix_of(model, state).bottomRightCorner<5, 5>(), golden_matrix<5, 5>(c, "M"), kExact));
    VectorNu gravity;
    gravity_torques(model, state, gravity);
    CHECK(close(gravity.tail<5>(), golden_vector<5>(c, "grav"), kExact));
  }
}
