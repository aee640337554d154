// A solve allocates nothing once the engine is set up, whatever its outcome. malloc itself is interposed: OSQP is C,
// and Eigen's own guard is off in release builds.
#include <catch2/catch_test_macros.hpp>
#include <cstddef>
#include <limits>
#include <random>

#include "controller/force_qp/force_qp.hpp"
#include "tests/force_qp/problems.hpp"
#include "tests/support/heap_calls.hpp"

using namespace stance;
using namespace stance::force_qp;
using namespace stance::force_qp::test;
using stance::test::heap_calls;

TEST_CASE("HeapCallsAreCounted") {
  const long before = heap_calls;
  const volatile std::size_t size = 1000;  // so that the compiler cannot do without
  const std::vector<double> block(size);
  CHECK(block.size() == size);
  CHECK(heap_calls > before);
}

TEST_CASE("ASolveAllocatesNothing") {
  for (const QpEngine which : {QpEngine::kOsqpCondensed, QpEngine::kOsqpSparse, QpEngine::kStructured}) {
    for (const int num_contacts : {1, 2, 3, 4}) {
      Settings settings;
      settings.engine = which;
      std::mt19937_64 random(1);
      std::vector<Problem> problems;
      for (int tick = 0; tick < 40; ++tick) {
        problems.push_back(num_contacts == 2 ? walking(10, tick, 0.2) : standing(10, num_contacts));
        disturb(problems.back(), 5.0, random);
        if (tick % 10 == 4) problems.back().friction = -1.0;
        if (tick % 10 == 6) problems.back().x0(0) = std::numeric_limits<double>::quiet_NaN();
        if (tick % 10 == 8) problems.back().stages[0].fz_min[0] = problems.back().stages[0].fz_max[0] = -1.0;
      }
      auto engine = make_force_qp(settings, problems.front().sizes, kWeight);
      Solution solution(problems.front().sizes);
      const long before = heap_calls;
      long solved = 0;
      for (const Problem& problem : problems) solved += engine->solve(problem, solution) == QpStatus::kSolved;
      engine->reset();
      const long after = heap_calls;
      CHECK(after == before);
      CHECK(solved == 28);
    }
  }
}

TEST_CASE("AModelAllocatesNothing") {
  const centroidal::Parameters parameters = body();
  const centroidal::Linearisation at = stand_linearisation(4, true);
  centroidal::Dynamics out;
  const centroidal::ForceVector f = centroidal::ForceVector::Ones(12);
  const long before = heap_calls;
  centroidal::dynamics(parameters, at, out);
  const double effort = centroidal::effort(f, f);
  const long after = heap_calls;
  CHECK(after == before);
  CHECK(effort > 0.0);
}
