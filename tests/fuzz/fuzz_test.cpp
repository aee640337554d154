// A slice of `make fuzz`: random force QPs and random bytes are solved exactly, or refused with a status that is true.
#include <algorithm>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <map>

#include "tests/force_qp/reference_solver.hpp"
#include "tests/fuzz/cases.hpp"

using namespace stance;
using namespace stance::force_qp;
using namespace stance::force_qp::test;

namespace {

constexpr double kForceTolerance = 1e-5;  // N, where R is 1e-3 of what it is elsewhere, what a residual of 1e-6 leaves
constexpr double kTypicalForce = 129.0;   // N

/// One engine for each size, as it comes: with the history of the problems before.
class Engines {
 public:
  explicit Engines(int fallback_iterations) {
    settings_.engine = QpEngine::kStructured;
    settings_.fallback_iterations = fallback_iterations;
  }
  Solution solve(const Problem& problem) {
    auto& engine = engines_[{problem.sizes.num_stages, problem.sizes.num_contacts}];
    if (engine == nullptr) engine = make_force_qp(settings_, problem.sizes, kTypicalForce);
    Solution solution(problem.sizes);
    CHECK(engine->solve(problem, solution) == solution.status);
    return solution;
  }
  int max_iterations() const { return settings_.max_iterations; }

 private:
  Settings settings_;
  std::map<std::pair<int, int>, std::unique_ptr<ForceQp>> engines_;
};

}  // namespace

TEST_CASE("RandomProblemsAreSolvedExactlyOrRefused") {
  constexpr int kProblems = 20000;
  constexpr int kMayBeRefused = kProblems / 1000;
  Engines engines(0);
  int refused = 0;
  int active = 0;
  for (int number = 0; number < kProblems; ++number) {
    const Problem problem = random_problem(static_cast<std::uint64_t>(number));
    const Solution solution = engines.solve(problem);
    INFO("problem " << number);
    REQUIRE(fault_of(problem, solution, engines.max_iterations()) == "");
    refused += solution.status != QpStatus::kSolved;
    active += solution.iterations > 0;
  }
  CHECK(active > kProblems / 4);
  CHECK(refused <= kMayBeRefused);
}

TEST_CASE("RandomProblemsAreSolvedAsByTheReferenceSolver") {
  Engines engines(0);
  int compared = 0;
  for (std::uint64_t number = 0; number < 300; ++number) {
    const Problem problem = random_problem(number);
    if (problem.sizes.num_stages * problem.sizes.num_contacts > 12) continue;  // it is slow
    const Solution solution = engines.solve(problem);
    if (solution.status != QpStatus::kSolved) continue;
    const std::vector<ForceVector> expected = reference_forces(problem);
    double error = 0.0;
    for (std::size_t k = 0; k < expected.size(); ++k) {
      error = std::max(error, (solution.forces[k] - expected[k]).cwiseAbs().maxCoeff());
    }
    INFO("problem " << number);
    CHECK(error <= kForceTolerance);
    ++compared;
  }
  CHECK(compared > 100);
}

TEST_CASE("WhateverBytesSayNothingIsCalledSolvedThatIsNot") {
  Engines alone(0);
  Engines with_osqp(50);
  std::map<QpStatus, int> seen;
  for (std::uint64_t number = 0; number < 10000; ++number) {
    const Problem problem = problem_from_bytes(random_bytes(number));
    INFO("bytes " << number);
    const Solution solution = alone.solve(problem);
    REQUIRE(fault_of(problem, solution, alone.max_iterations()) == "");
    ++seen[solution.status];
    if (number % 10 == 0) static_cast<void>(with_osqp.solve(problem));
  }
  for (const QpStatus status : {QpStatus::kSolved, QpStatus::kInvalidProblem, QpStatus::kInfeasible}) {
    CHECK(seen[status] > 0);
  }
}

TEST_CASE("TheFuzzersOwnCheckFindsAForceThatIsWrong") {
  Engines engines(0);
  int found = 0;
  for (std::uint64_t number = 0; number < 50; ++number) {
    const Problem problem = random_problem(number);
    Solution solution = engines.solve(problem);
    if (solution.status != QpStatus::kSolved) continue;
    solution.forces.front()(0) += 1e-3;
    CHECK(fault_of(problem, solution, engines.max_iterations()) != "");
    solution.status = QpStatus::kInfeasible;
    CHECK(fault_of(problem, solution, engines.max_iterations()) != "");
    ++found;
  }
  CHECK(found > 40);
}
