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

Solution solve(Engines& engines, const Problem& problem) {
  Solution solution(problem.sizes);
  CHECK(engines.of(problem.sizes).solve(problem, solution) == solution.status);
  return solution;
}

}  // namespace

TEST_CASE("RandomProblemsAreSolvedExactlyOrRefused") {
  constexpr int kProblems = 20000;
  constexpr int kMayBeRefused = kProblems / 1000;
  Engines engines(0);
  int refused = 0;
  int active = 0;
  for (int number = 0; number < kProblems; ++number) {
    const Problem problem = random_problem(static_cast<std::uint64_t>(number));
    const Solution solution = solve(engines, problem);
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
    const Solution solution = solve(engines, problem);
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
    const Solution solution = solve(alone, problem);
    REQUIRE(fault_of(problem, solution, alone.max_iterations()) == "");
    ++seen[solution.status];
    if (number % 10 == 0) static_cast<void>(solve(with_osqp, problem));
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
    Solution solution = solve(engines, problem);
    if (solution.status != QpStatus::kSolved) continue;
    solution.forces.front()(0) += 1e-3;
    CHECK(fault_of(problem, solution, engines.max_iterations()) != "");
    solution.status = QpStatus::kInfeasible;
    CHECK(fault_of(problem, solution, engines.max_iterations()) != "");
    ++found;
  }
  CHECK(found > 40);
}
