// The independent check: the projection against its definition, the gradient against differences of the cost.
#include "controller/force_qp/kkt.hpp"

#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "tests/force_qp/problems.hpp"

using namespace stance;
using namespace stance::force_qp;
using namespace stance::force_qp::test;

namespace {

constexpr double kDifferenceStep = 1.0;         // N: a quadratic's central difference is exact, whatever the step
constexpr double kDifferenceTolerance = 1e-10;  // relative to the gradient's largest component
constexpr double kRounding = 1e-9;              // N

bool inside(const Vector3& f, double mu, double fz_min, double fz_max) {
  return std::abs(f.x()) <= mu * f.z() + kRounding && std::abs(f.y()) <= mu * f.z() + kRounding &&
         f.z() >= fz_min - kRounding && f.z() <= fz_max + kRounding;
}

double half_cost(const Problem& problem, const std::vector<ForceVector>& forces) {
  StateVector x = problem.x0;
  double cost = 0.0;
  for (std::size_t k = 0; k < problem.stages.size(); ++k) {
    const StageData& stage = problem.stages[k];
    x = (stage.dynamics.A * x + stage.dynamics.B * forces[k] + stage.dynamics.g).eval();
    const StateVector e = x - stage.x_ref;
    const ForceVector d = forces[k] - stage.f_ref;
    const bool terminal = k + 1 == problem.stages.size() && problem.has_terminal_cost;
    cost += terminal ? e.dot(problem.terminal_cost * e) : e.dot(stage.Q.cwiseProduct(e));
    cost += d.dot(stage.R.cwiseProduct(d));
  }
  return 0.5 * cost;
}

std::vector<ForceVector> random_forces(const Problem& problem, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, 50.0);
  std::vector<ForceVector> forces(problem.stages.size(), ForceVector::Zero(3 * problem.sizes.num_contacts));
  for (ForceVector& f : forces) {
    for (double& component : f) component = normal(random);
  }
  return forces;
}

}  // namespace

TEST_CASE("ProjectionIsTheNearestPointOfThePyramid") {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 100.0);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int repeat = 0; repeat < 2000; ++repeat) {
    const double mu = 0.05 + 1.5 * uniform(random);
    const double fz_min = repeat % 3 == 0 ? 0.0 : 100.0 * uniform(random);
    const double fz_max = repeat % 7 == 0 ? fz_min : fz_min + 200.0 * uniform(random);
    const Vector3 f(normal(random), normal(random), normal(random));
    const Vector3 p = project_on_pyramid(f, mu, fz_min, fz_max);
    CHECK(inside(p, mu, fz_min, fz_max));
    // The variational inequality at points of the set: (f - p)'(s - p) <= 0.
    for (int sample = 0; sample < 20; ++sample) {
      const double fz = fz_min + (fz_max - fz_min) * uniform(random);
      const Vector3 s(mu * fz * (2.0 * uniform(random) - 1.0), mu * fz * (2.0 * uniform(random) - 1.0), fz);
      CHECK((f - p).dot(s - p) <= kRounding * (1.0 + f.squaredNorm() + s.squaredNorm()));
    }
    CHECK((project_on_pyramid(p, mu, fz_min, fz_max) - p).norm() <= kRounding);
  }
}

TEST_CASE("GradientIsTheCostsDerivative") {
  std::mt19937_64 random(2);
  for (const Problem& problem : {standing(1), standing(5), standing(3, 4), walking(12, 20)}) {
    std::vector<ForceVector> forces = random_forces(problem, random);
    std::vector<StateVector> states(problem.stages.size());
    KktCheck check(problem.sizes);
    check.evaluate(problem, forces, states);
    const std::vector<ForceVector> gradient = check.gradient();
    double largest = 0.0;
    for (const ForceVector& d : gradient) largest = std::max(largest, d.cwiseAbs().maxCoeff());
    for (std::size_t k = 0; k < forces.size(); ++k) {
      for (Eigen::Index i = 0; i < forces[k].size(); ++i) {
        std::vector<ForceVector> moved = forces;
        moved[k](i) += kDifferenceStep;
        const double above = half_cost(problem, moved);
        moved[k](i) -= 2.0 * kDifferenceStep;
        const double below = half_cost(problem, moved);
        const double slope = (above - below) / (2.0 * kDifferenceStep);
        CHECK(std::abs(gradient[k](i) - slope) <= kDifferenceTolerance * largest);
      }
    }
  }
}

TEST_CASE("ResidualsSeeWhatIsWrongAndInNewtons") {
  Problem problem = standing(4);
  auto engine = make_force_qp({}, problem.sizes, kWeight);
  Solution solution(problem.sizes);
  REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
  KktCheck check(problem.sizes);
  std::vector<StateVector> states(4);
  CHECK(check.evaluate(problem, solution.forces, states).dual <= kRounding);

  SECTION("a force that is off by 1 N where nothing is active") {
    solution.forces[2](1) += 1.0;
    CHECK(check.evaluate(problem, solution.forces, states).dual >= 1.0 - kRounding);
  }
  SECTION("a force 2 N beyond a friction face") {
    solution.forces[1](3) = problem.friction * solution.forces[1](5) + 2.0;
    CHECK(std::abs(check.evaluate(problem, solution.forces, states).primal - 2.0) <= kRounding);
  }
  SECTION("a normal force 3 N over its limit") {
    solution.forces[3](2) = problem.stages[3].fz_max[0] + 3.0;
    CHECK(std::abs(check.evaluate(problem, solution.forces, states).primal - 3.0) <= kRounding);
  }
  SECTION("a force in swing") {
    problem.stages[0].fz_min[1] = 0.0;
    problem.stages[0].fz_max[1] = 0.0;
    solution.forces[0].tail<3>() = Vector3(0.5, 0.0, 0.25);
    CHECK(check.evaluate(problem, solution.forces, states).primal >= 0.25);
  }
  SECTION("a number that is none") {
    solution.forces[0](0) = std::numeric_limits<double>::quiet_NaN();
    CHECK(std::isinf(check.evaluate(problem, solution.forces, states).dual));
  }
}

TEST_CASE("ActiveConstraintsAreCountedByContactsInStance") {
  Problem problem = standing(1);
  ForceVector f(6);
  f << 0.0, 0.0, 50.0, 0.0, 0.0, 60.0;
  CHECK(count_active(problem, 0, f, 1e-6) == 0);
  f << problem.friction * 50.0, -problem.friction * 50.0, 50.0, 0.0, 0.0, 350.0;
  CHECK(count_active(problem, 0, f, 1e-6) == 3);
  problem.stages[0].fz_min[1] = problem.stages[0].fz_max[1] = 0.0;
  CHECK(count_active(problem, 0, f, 1e-6) == 2);
}
