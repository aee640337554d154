// The structured engine when its solver fails: found out by the check, answered by OSQP, or told.
#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <limits>

#include "controller/force_qp/osqp_engine.hpp"
#include "controller/force_qp/structured_engine.hpp"
#include "tests/force_qp/problems.hpp"
#include "tests/force_qp/reference_solver.hpp"

using namespace stance;
using namespace stance::force_qp;
using namespace stance::force_qp::test;

namespace {

constexpr double kForceTolerance = 1e-6;  // N

double force_error(const std::vector<ForceVector>& a, const std::vector<ForceVector>& b) {
  double worst = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) worst = std::max(worst, (a[k] - b[k]).cwiseAbs().maxCoeff());
  return worst;
}

/// Standing, pushed hard enough that constraints are active.
Problem pushed(int num_stages) {
  Problem problem = standing(num_stages);
  problem.x0(9) += 0.6;
  problem.x0(7) += 0.8;
  return problem;
}

/// Claims to have solved everything, and adds `error` [N] to one force of what the solver that it wraps has found.
class Liar final : public StructuredSolver {
 public:
  Liar(Sizes sizes, double error, int& calls)
      : honest_(make_structured_solver(sizes, kWeight, 1000)), error_(error), calls_(calls) {}
  bool take_matrices(const Problem& problem) noexcept override { return honest_->take_matrices(problem); }
  void take_vectors(const Problem& problem) noexcept override { honest_->take_vectors(problem); }
  QpStatus solve() noexcept override {
    ++calls_;
    return honest_->solve();
  }
  void refine() noexcept override {}
  void take_ahead() noexcept override { honest_->take_ahead(); }
  int iterations() const noexcept override { return honest_->iterations(); }
  bool holds() const noexcept override { return honest_->holds(); }
  void forces(std::vector<ForceVector>& out) const noexcept override {
    honest_->forces(out);
    out.back()(2) += error_;
  }
  void reset() noexcept override { honest_->reset(); }

 private:
  std::unique_ptr<StructuredSolver> honest_;
  double error_;
  int& calls_;
};

/// What comes of `problem` where the solver lies and OSQP may take `fallback_iterations`, with `time_left` [s].
Solution lied_about(const Problem& problem, int fallback_iterations, double time_left = kControlPeriod) {
  Settings settings;
  settings.fallback_iterations = fallback_iterations;
  int calls = 0;
  auto engine =
      make_structured_engine(settings, problem.sizes, kWeight, std::make_unique<Liar>(problem.sizes, 0.1, calls));
  Solution solution(problem.sizes);
  CHECK(engine->solve(problem, solution, time_left) == solution.status);
  return solution;
}

}  // namespace

TEST_CASE("ASolverThatLiesIsFoundOutAndOsqpAnswers") {
  for (const int num_stages : {10, 25}) {
    for (const double error : {1e-4, -30.0, std::numeric_limits<double>::quiet_NaN()}) {
      const Problem problem = pushed(num_stages);
      int calls = 0;
      auto engine =
          make_structured_engine({}, problem.sizes, kWeight, std::make_unique<Liar>(problem.sizes, error, calls));
      Solution solution(problem.sizes);
      REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
      CHECK(calls == 1);
      CHECK(solution.engine == (num_stages == 10 ? QpEngine::kOsqpCondensed : QpEngine::kOsqpSparse));
      CHECK(force_error(solution.forces, reference_forces(problem)) <= kForceTolerance);
    }
  }
}

TEST_CASE("ASolverThatTellsTheTruthIsBelieved") {
  const Problem problem = pushed(10);
  int calls = 0;
  auto engine = make_structured_engine({}, problem.sizes, kWeight, std::make_unique<Liar>(problem.sizes, 0.0, calls));
  Solution solution(problem.sizes);
  REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
  CHECK(solution.engine == QpEngine::kStructured);
}

TEST_CASE("WithoutAFallbackALieIsTold") {
  const Problem problem = pushed(10);
  const Solution solution = lied_about(problem, 0);
  CHECK(solution.status == QpStatus::kInaccurate);
  CHECK(solution.engine == QpEngine::kStructured);
  CHECK(solution.dual_residual > kForceTolerance);
}

TEST_CASE("ABudgetThatIsTooSmallForBothIsTold") {
  const Problem problem = pushed(10);
  const Solution solution = lied_about(problem, 1);
  CHECK(solution.status == QpStatus::kMaxIterations);
  CHECK(solution.engine == QpEngine::kOsqpCondensed);
  CHECK(solution.iterations == 1);
}

TEST_CASE("WhereItIsTooLateForOsqpItDoesNotBegin") {
  const Problem problem = pushed(10);
  for (const double time_left : {-0.01, 0.0, 0.001, 0.002}) {
    const Solution solution = lied_about(problem, 200, time_left);
    CHECK(solution.status == QpStatus::kInaccurate);
    CHECK(solution.engine == QpEngine::kStructured);
  }
  CHECK(lied_about(problem, 200, 0.003).engine == QpEngine::kOsqpCondensed);
}

TEST_CASE("WithLittleTimeLeftOsqpIsStoppedWhereItMustEnd") {
  Settings settings;
  const Problem problem = walking(50, 0, 0.2);
  int last = settings.max_iterations;
  for (const double time_left : {0.01, 0.009, 0.008, 0.007}) {
    const int affordable = affordable_iterations(settings, problem.sizes, time_left);
    CHECK(affordable < last);
    last = affordable;
    settings.engine = QpEngine::kOsqpSparse;
    auto engine = make_osqp_engine(settings, problem.sizes, kWeight);
    Problem hard = problem;
    std::mt19937_64 random(31);
    disturb(hard, 60.0, random);
    Solution solution(problem.sizes);
    static_cast<void>(engine->solve_within(hard, solution, affordable));
    CHECK(solution.iterations <= affordable);
  }
  CHECK(affordable_iterations(settings, problem.sizes, 0.005) == 0);
  CHECK(affordable_iterations(settings, problem.sizes, 1.0) == settings.max_iterations);
}

TEST_CASE("ABudgetThatIsTooSmallForTheSolverIsOsqpsChance") {
  const Problem problem = pushed(10);
  auto engine = make_structured_engine({}, problem.sizes, kWeight, make_structured_solver(problem.sizes, kWeight, 1));
  Solution solution(problem.sizes);
  REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
  CHECK(solution.engine == QpEngine::kOsqpCondensed);
  const Problem easy = standing(10);
  REQUIRE(engine->solve(easy, solution) == QpStatus::kSolved);
  CHECK(solution.engine == QpEngine::kStructured);
}

TEST_CASE("WhatInspectionRefusesReachesNoSolver") {
  Problem nan = pushed(10);
  nan.x0(3) = std::numeric_limits<double>::quiet_NaN();
  Problem pulling = pushed(10);
  pulling.stages[3].fz_min[0] = -20.0;
  pulling.stages[3].fz_max[0] = -10.0;
  int calls = 0;
  auto engine = make_structured_engine({}, nan.sizes, kWeight, std::make_unique<Liar>(nan.sizes, 0.0, calls));
  Solution solution(nan.sizes);
  CHECK(engine->solve(nan, solution) == QpStatus::kInvalidProblem);
  CHECK(engine->solve(pulling, solution) == QpStatus::kInfeasible);
  CHECK(calls == 0);
  CHECK(engine->solve(pushed(10), solution) == QpStatus::kSolved);
  CHECK(calls == 1);
}
