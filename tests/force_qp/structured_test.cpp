// The structured engine where it differs from the others: any model of the structure, any schedule, every path.
#include <Eigen/QR>
#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <random>

#include "controller/force_qp/kkt.hpp"
#include "controller/force_qp/structured_engine.hpp"
#include "tests/force_qp/problems.hpp"
#include "tests/force_qp/reference_solver.hpp"

using namespace stance;
using namespace stance::force_qp;
using namespace stance::force_qp::test;

namespace {

constexpr double kForceTolerance = 1e-6;   // N, in every stage
constexpr double kUpdateTolerance = 1e-8;  // N, between an engine with a history and a fresh one

double force_error(const std::vector<ForceVector>& a, const std::vector<ForceVector>& b) {
  double worst = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) worst = std::max(worst, (a[k] - b[k]).cwiseAbs().maxCoeff());
  return worst;
}

std::unique_ptr<ForceQp> make(Sizes sizes, Simd simd = available_simd().back()) {
  Settings settings;
  settings.engine = QpEngine::kStructured;
  return make_structured_engine(settings, sizes, kWeight, simd);
}

}  // namespace

TEST_CASE("AnyProblemOfTheStructureIsSolvedAsByTheReferenceSolver") {
  for (const int num_contacts : {1, 2, 3, 4}) {
    for (const int num_stages : {1, 4, 9}) {
      std::mt19937_64 random(21);
      auto engine = make({num_stages, num_contacts});
      Solution solution({num_stages, num_contacts});
      int active = 0;
      for (int repeat = 0; repeat < 25; ++repeat) {
        const Problem problem = any_problem({num_stages, num_contacts}, random);
        INFO(num_contacts << " contacts, " << num_stages << " stages, repeat " << repeat);
        REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
        CHECK(force_error(solution.forces, reference_forces(problem)) <= kForceTolerance);
        active += solution.iterations > 0;
      }
      CHECK(active > 0);
    }
  }
}

TEST_CASE("InFlightTheForcesAreZero") {
  Problem problem = standing(5);
  for (StageData& stage : problem.stages) {
    stage.fz_min.fill(0.0);
    stage.fz_max.fill(0.0);
  }
  Solution solution(problem.sizes);
  REQUIRE(make(problem.sizes)->solve(problem, solution) == QpStatus::kSolved);
  for (const ForceVector& f : solution.forces) CHECK(f.isZero(0.0));
}

TEST_CASE("EveryPathGivesTheSameBits") {
  REQUIRE(!available_simd().empty());
  for (const int num_contacts : {1, 2, 3, 4}) {
    std::mt19937_64 random(22);
    std::vector<std::unique_ptr<ForceQp>> engines;
    for (const Simd simd : available_simd()) engines.push_back(make({12, num_contacts}, simd));
    Solution first({12, num_contacts});
    Solution other({12, num_contacts});
    Problem problem = any_problem({12, num_contacts}, random);
    for (int repeat = 0; repeat < 40; ++repeat) {
      if (repeat % 4 == 0) problem = any_problem({12, num_contacts}, random);
      disturb(problem, 5.0, random);
      const QpStatus status = engines.front()->solve(problem, first);
      CHECK(status == QpStatus::kSolved);
      for (std::size_t i = 1; i < engines.size(); ++i) {
        INFO(name(available_simd()[i]) << ", repeat " << repeat);
        CHECK(engines[i]->solve(problem, other) == status);
        CHECK(other.iterations == first.iterations);
        CHECK(other.forces == first.forces);
      }
    }
  }
}

TEST_CASE("ColumnsThatAreKeptGiveWhatNewOnesGive") {
  for (const int num_contacts : {2, 4}) {
    std::mt19937_64 random(23);
    const Problem base = standing(10, num_contacts, 0.2);
    auto with_history = make(base.sizes);
    Solution kept(base.sizes);
    Solution fresh(base.sizes);
    for (int tick = 0; tick < 60; ++tick) {
      Problem problem = base;
      disturb(problem, 6.0, random);
      REQUIRE(with_history->solve(problem, kept) == QpStatus::kSolved);
      REQUIRE(make(base.sizes)->solve(problem, fresh) == QpStatus::kSolved);
      CHECK(force_error(kept.forces, fresh.forces) <= kUpdateTolerance);
    }
  }
}

TEST_CASE("ColumnsTakenAheadLeaveRoomForThoseThatASolveAsksFor") {
  std::mt19937_64 random(30);
  const Problem base = standing(90, 4, 0.2);  // more constraints than there is room for columns
  auto solver = make_structured_solver(base.sizes, kWeight, 1000);
  auto fresh = make_structured_solver(base.sizes, kWeight, 1000);
  Solution kept(base.sizes);
  Solution other(base.sizes);
  REQUIRE(solver->take_matrices(base));
  REQUIRE(fresh->take_matrices(base));
  for (int tick = 0; tick < 200; ++tick) solver->take_ahead();
  for (int tick = 0; tick < 5; ++tick) {
    Problem problem = base;
    disturb(problem, 4.0, random);
    solver->take_vectors(problem);
    REQUIRE(solver->solve() == QpStatus::kSolved);
    REQUIRE(solver->iterations() > 0);
    solver->forces(kept.forces);
    fresh->reset();
    fresh->take_vectors(problem);
    REQUIRE(fresh->solve() == QpStatus::kSolved);
    fresh->forces(other.forces);
    CHECK(force_error(kept.forces, other.forces) <= kUpdateTolerance);
    solver->take_ahead();
  }
}

TEST_CASE("ARepeatedProblemNeedsNoSecondSearch") {
  std::mt19937_64 random(24);
  Problem problem = standing(10, 2, 0.2);
  disturb(problem, 6.0, random);
  // All stages active alike, so that the set moved by a stage is the set.
  auto engine = make(problem.sizes);
  Solution first(problem.sizes);
  REQUIRE(engine->solve(problem, first) == QpStatus::kSolved);
  REQUIRE(first.iterations > 1);
  Solution second(problem.sizes);
  REQUIRE(engine->solve(problem, second) == QpStatus::kSolved);
  CHECK(second.iterations < first.iterations);
  CHECK(force_error(first.forces, second.forces) <= kUpdateTolerance);
}

TEST_CASE("ManyActiveConstraintsOverALongHorizonAreSolvedExactly") {
  for (const double friction : {0.1, 0.2, 0.4}) {
    std::mt19937_64 random(25);
    auto engine = make({50, 2});
    Solution solution({50, 2});
    int most = 0;
    for (int tick = 0; tick < 30; ++tick) {
      Problem problem = walking(50, tick, friction);
      disturb(problem, 12.0, random);
      REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
      int active = 0;
      for (int k = 0; k < 50; ++k)
        active += count_active(problem, k, solution.forces[static_cast<std::size_t>(k)], 1e-6);
      most = std::max(most, active);
    }
    CHECK(most > 40);
  }
}

TEST_CASE("ASetThatIsHeldLeadsWhereTheFreeMinimiserLeads") {
  for (const int num_contacts : {2, 4}) {
    std::mt19937_64 random(28);
    const Problem base = standing(40, num_contacts, 0.2);
    std::vector<std::unique_ptr<StructuredSolver>> paths;
    for (const Simd simd : available_simd()) paths.push_back(make_structured_solver(base.sizes, kWeight, 1000, simd));
    for (const auto& path : paths) REQUIRE(path->take_matrices(base));
    auto fresh = make_structured_solver(base.sizes, kWeight, 1000);
    REQUIRE(fresh->take_matrices(base));
    KktCheck kkt(base.sizes);
    Solution first(base.sizes);
    Solution other(base.sizes);
    int held = 0;
    int both_ways = 0;
    for (int tick = 0; tick < 80; ++tick) {
      Problem problem = base;
      disturb(problem, 12.0, random);
      INFO(num_contacts << " contacts, tick " << tick);
      for (std::size_t i = 0; i < paths.size(); ++i) {
        paths[i]->take_vectors(problem);
        REQUIRE(paths[i]->solve() == QpStatus::kSolved);
        paths[i]->forces(i == 0 ? first.forces : other.forces);
        CHECK(paths[i]->holds() == paths[0]->holds());
        CHECK(paths[i]->iterations() == paths[0]->iterations());
        if (i > 0) CHECK(other.forces == first.forces);
      }
      fresh->reset();
      fresh->take_vectors(problem);
      REQUIRE(fresh->solve() == QpStatus::kSolved);
      fresh->forces(other.forces);
      CHECK(force_error(first.forces, other.forces) <= kUpdateTolerance);
      both_ways += paths[0]->holds() && !fresh->holds();
      const Residuals residuals = kkt.evaluate(problem, first.forces, first.states);
      CHECK(residuals.primal <= kUpdateTolerance);
      CHECK(residuals.dual <= kForceTolerance);

      if (paths[0]->holds()) {
        ++held;
        paths[0]->refine();
        paths[0]->forces(other.forces);
        CHECK(force_error(first.forces, other.forces) <= kUpdateTolerance);
      }
    }
    CHECK(held > 40);
    CHECK(both_ways > 3);
  }
}

TEST_CASE("WithinItsBudgetASolutionIsExactAndBeyondThereIsNone") {
  constexpr int kBudget = 25;
  constexpr Sizes kSizes = {20, 4};
  std::mt19937_64 random(29);
  Solution first(kSizes);
  Solution other(kSizes);
  int held = 0;
  int refused = 0;
  for (int model = 0; model < 20; ++model) {
    const Problem base = any_problem(kSizes, random);
    auto with_history = make_structured_solver(kSizes, kWeight, 1000);
    auto bounded = make_structured_solver(kSizes, kWeight, kBudget);
    REQUIRE(with_history->take_matrices(base));
    REQUIRE(bounded->take_matrices(base));
    for (int tick = 0; tick < 10; ++tick) {
      Problem problem = base;
      disturb(problem, 20.0, random);
      INFO("model " << model << ", tick " << tick);
      auto fresh = make_structured_solver(kSizes, kWeight, 1000);
      REQUIRE(fresh->take_matrices(problem));
      fresh->take_vectors(problem);
      REQUIRE(fresh->solve() == QpStatus::kSolved);
      fresh->forces(other.forces);

      with_history->take_vectors(problem);
      REQUIRE(with_history->solve() == QpStatus::kSolved);
      with_history->forces(first.forces);
      CHECK(force_error(first.forces, other.forces) <= kUpdateTolerance);
      held += with_history->holds();

      bounded->take_vectors(problem);
      const QpStatus status = bounded->solve();
      CHECK(bounded->iterations() <= kBudget);
      if (status == QpStatus::kSolved) {
        bounded->forces(first.forces);
        CHECK(force_error(first.forces, other.forces) <= kUpdateTolerance);
      } else {
        CHECK(status == QpStatus::kMaxIterations);
        ++refused;
      }
    }
  }
  CHECK(held > 20);
  CHECK(refused > 5);
}

TEST_CASE("FarFromTheOriginNothingIsLost") {
  std::mt19937_64 random(26);
  for (int repeat = 0; repeat < 20; ++repeat) {
    Problem near = walking(20, 5 * repeat, 0.3);
    disturb(near, 4.0, random);
    Problem far = near;
    const Vector3 shift(2000.0, -3000.0, 500.0);  // m
    far.x0.segment<3>(3) += shift;
    for (StageData& stage : far.stages) {
      stage.x_ref.segment<3>(3) += shift;
      stage.dynamics.g.segment<3>(6) -= stage.dynamics.A.block<3, 3>(6, 3) * shift;
    }
    Solution here(near.sizes);
    Solution there(near.sizes);
    REQUIRE(make(near.sizes)->solve(near, here) == QpStatus::kSolved);
    REQUIRE(make(far.sizes)->solve(far, there) == QpStatus::kSolved);
    CHECK(force_error(here.forces, there.forces) <= 1e-5);  // what rounding x itself to 1e-13 m costs
  }
}

TEST_CASE("RefinementMovesAnExactSolutionNoFurtherThanRounding") {
  std::mt19937_64 random(27);
  for (int repeat = 0; repeat < 20; ++repeat) {
    Problem problem = walking(20, 5 * repeat, 0.2);
    disturb(problem, 4.0, random);
    auto solver = make_structured_solver(problem.sizes, kWeight, 1000);
    Solution before(problem.sizes);
    Solution after(problem.sizes);
    REQUIRE(solver->take_matrices(problem));
    solver->take_vectors(problem);
    REQUIRE(solver->solve() == QpStatus::kSolved);
    solver->forces(before.forces);
    solver->refine();
    solver->forces(after.forces);
    CHECK(force_error(before.forces, after.forces) <= kUpdateTolerance);
  }
}
