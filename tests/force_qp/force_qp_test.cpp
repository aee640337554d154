// All engines: exact against a solver of another kind, with a true status whatever they are given, and
// deterministic.
#include "controller/force_qp/force_qp.hpp"

#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>

#include "controller/force_qp/kkt.hpp"
#include "tests/force_qp/problems.hpp"
#include "tests/force_qp/reference_solver.hpp"

using namespace stance;
using namespace stance::force_qp;
using namespace stance::force_qp::test;

namespace {

constexpr double kForceTolerance = 1e-6;      // N, in every stage, against the reference solver
constexpr double kFirstOrderTolerance = 0.1;  // N, of OSQP alone at its default tolerance of 1e-6
constexpr double kUpdateTolerance = 1e-8;     // N, between an engine with a history and a fresh one

constexpr QpEngine kEngines[] = {QpEngine::kOsqpCondensed, QpEngine::kOsqpSparse, QpEngine::kStructured};
constexpr QpEngine kOsqpEngines[] = {QpEngine::kOsqpCondensed, QpEngine::kOsqpSparse};

std::unique_ptr<ForceQp> make(QpEngine which, const Problem& problem, Settings settings = {}) {
  settings.engine = which;
  return make_force_qp(settings, problem.sizes, kWeight);
}

double force_error(const std::vector<ForceVector>& a, const std::vector<ForceVector>& b) {
  double worst = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) worst = std::max(worst, (a[k] - b[k]).cwiseAbs().maxCoeff());
  return worst;
}

bool same_bits(const Solution& a, const Solution& b) {
  return a.status == b.status && a.iterations == b.iterations && a.primal_residual == b.primal_residual &&
         a.dual_residual == b.dual_residual && a.active == b.active && a.forces == b.forces && a.states == b.states;
}

/// Standing, pushed hard enough that constraints are active.
Problem pushed(int num_stages) {
  Problem problem = standing(num_stages);
  problem.x0(9) += 0.6;
  problem.x0(7) += 0.8;
  return problem;
}

/// A family of problems, and how they are disturbed.
struct Family {
  const char* name;
  int repeats;
  double severity;
  bool constrained;  ///< whether constraints become active
  std::function<Problem(int)> make;
};

const std::vector<Family>& families() {
  static const std::vector<Family> all = {
      {"stand N=1", 60, 8.0, true, [](int) { return standing(1); }},
      {"stand N=5", 40, 8.0, true, [](int) { return standing(5); }},
      {"stand N=10", 30, 8.0, true, [](int) { return standing(10); }},
      {"stand N=10, mu 0.1", 20, 5.0, true, [](int) { return standing(10, 2, 0.1); }},
      {"stand N=1, mu 0.05", 40, 5.0, true, [](int) { return standing(1, 2, 0.05); }},
      {"stand N=5 on three", 20, 8.0, true, [](int) { return standing(5, 3); }},
      {"stand N=5 on four", 20, 8.0, true, [](int) { return standing(5, 4); }},
      {"one foot, no terminal cost", 20, 8.0, false, [](int) { return standing(5, 1); }},
      {"saturated normal forces", 30, 8.0, true,
       [](int) {
         Problem problem = standing(5);
         for (StageData& stage : problem.stages) {
           stage.fz_min = {40.0, 40.0, 0.0, 0.0};
           stage.fz_max = {75.0, 70.0, 0.0, 0.0};
         }
         return problem;
       }},
      {"the cones' apices", 30, 8.0, true,
       [](int) {
         Problem problem = standing(5);
         for (StageData& stage : problem.stages) stage.fz_min.fill(0.0);
         problem.x0(11) += 2.0;
         return problem;
       }},
      {"walk N=20", 24, 2.0, false, [](int tick) { return walking(20, 3 * tick); }},
      {"walk N=20, mu 0.2", 24, 3.0, true, [](int tick) { return walking(20, 3 * tick, 0.2); }},
  };
  return all;
}

}  // namespace

TEST_CASE("AllEnginesAgreeWithTheReferenceSolver") {
  for (const Family& family : families()) {
    DYNAMIC_SECTION(family.name) {
      std::mt19937_64 random(7);
      const Problem first = family.make(0);
      std::unique_ptr<ForceQp> engines[] = {make(kEngines[0], first), make(kEngines[1], first),
                                            make(kEngines[2], first)};
      Solution solution(first.sizes);
      int active = 0;
      for (int repeat = 0; repeat < family.repeats; ++repeat) {
        Problem problem = family.make(repeat);
        disturb(problem, family.severity, random);
        const std::vector<ForceVector> reference = reference_forces(problem);
        for (const auto& engine : engines) {
          INFO("repeat " << repeat);
          REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
          CHECK(force_error(solution.forces, reference) <= kForceTolerance);
          active += solution.iterations > 0;
        }
      }
      CHECK((active > 0) == family.constrained);
    }
  }
}

TEST_CASE("OsqpAloneComesCloseWithinItsTolerance") {
  Settings settings;
  settings.try_free_minimiser = false;
  settings.correct_active_set = false;
  for (const QpEngine which : kOsqpEngines) {
    for (const int num_stages : {1, 10}) {
      std::mt19937_64 random(8);
      auto engine = make(which, standing(num_stages), settings);
      Solution solution({num_stages, 2});
      for (int repeat = 0; repeat < 20; ++repeat) {
        Problem problem = standing(num_stages);
        disturb(problem, 5.0, random);
        REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
        CHECK(solution.iterations > 0);
        CHECK(force_error(solution.forces, reference_forces(problem)) <= kFirstOrderTolerance);
      }
    }
  }
}

TEST_CASE("TheFreeMinimiserNeedsNoIterationsAndIsTheSame") {
  Settings without;
  without.try_free_minimiser = false;
  for (const QpEngine which : kOsqpEngines) {
    std::mt19937_64 random(9);
    Problem problem = standing(10);
    disturb(problem, 0.5, random);
    Solution solution(problem.sizes);
    REQUIRE(make(which, problem)->solve(problem, solution) == QpStatus::kSolved);
    CHECK(solution.iterations == 0);
    CHECK(solution.active == 0);
    Solution other(problem.sizes);
    REQUIRE(make(which, problem, without)->solve(problem, other) == QpStatus::kSolved);
    CHECK(other.iterations > 0);
    CHECK(force_error(solution.forces, other.forces) <= kForceTolerance);
  }
}

TEST_CASE("AnUpdatedEngineEqualsAFreshOne") {
  for (const QpEngine which : kEngines) {
    std::mt19937_64 random(10);
    auto updated = make(which, walking(10, 0));
    Solution from_updated({10, 2});
    Solution from_fresh({10, 2});
    for (int tick = 0; tick < 70; ++tick) {
      Problem problem = walking(10, tick, tick % 9 == 0 ? 0.3 : 0.2);
      disturb(problem, 3.0, random);
      REQUIRE(updated->solve(problem, from_updated) == QpStatus::kSolved);
      REQUIRE(make(which, problem)->solve(problem, from_fresh) == QpStatus::kSolved);
      CHECK(force_error(from_updated.forces, from_fresh.forces) <= kUpdateTolerance);
    }
  }
}

TEST_CASE("TheSameSequenceGivesTheSameBits") {
  for (const QpEngine which : kEngines) {
    const auto run = [&] {
      std::mt19937_64 random(11);
      auto engine = make(which, walking(10, 0));
      std::vector<Solution> solutions;
      for (int tick = 0; tick < 40; ++tick) {
        Problem problem = walking(10, tick, 0.2);
        disturb(problem, 4.0, random);
        if (tick == 20) problem.friction = -1.0;
        solutions.emplace_back(problem.sizes);
        [[maybe_unused]] const QpStatus status = engine->solve(problem, solutions.back());
      }
      return solutions;
    };
    const std::vector<Solution> first = run();
    const std::vector<Solution> second = run();
    for (std::size_t i = 0; i < first.size(); ++i) CHECK(same_bits(first[i], second[i]));
  }
}

TEST_CASE("SwingForcesAreExactlyZero") {
  for (const QpEngine which : kEngines) {
    std::mt19937_64 random(12);
    auto engine = make(which, walking(20, 0));
    Solution solution({20, 2});
    for (int tick = 0; tick < 40; tick += 3) {
      Problem problem = walking(20, tick, 0.2);
      disturb(problem, 3.0, random);
      REQUIRE(engine->solve(problem, solution) == QpStatus::kSolved);
      for (std::size_t k = 0; k < 20; ++k) {
        for (std::size_t c = 0; c < 2; ++c) {
          if (problem.stages[k].fz_max[c] > 0.0) continue;
          CHECK(solution.forces[k].segment<3>(static_cast<Eigen::Index>(3 * c)).isZero(0.0));
        }
      }
    }
  }
}

TEST_CASE("AFixedNormalForceIsKept") {
  for (const QpEngine which : kEngines) {
    Problem problem = pushed(5);
    for (StageData& stage : problem.stages) stage.fz_min[1] = stage.fz_max[1] = 60.0;
    Solution solution(problem.sizes);
    REQUIRE(make(which, problem)->solve(problem, solution) == QpStatus::kSolved);
    for (const ForceVector& f : solution.forces) CHECK(std::abs(f(5) - 60.0) <= kForceTolerance);
    CHECK(solution.dual_residual <= kForceTolerance);
  }
}

TEST_CASE("StatesAreWhatTheForcesLeadTo") {
  for (const QpEngine which : kEngines) {
    const Problem problem = pushed(10);
    Solution solution(problem.sizes);
    REQUIRE(make(which, problem)->solve(problem, solution) == QpStatus::kSolved);
    StateVector x = problem.x0;
    for (std::size_t k = 0; k < 10; ++k) {
      const Dynamics& model = problem.stages[k].dynamics;
      x = (model.A * x + model.B * solution.forces[k] + model.g).eval();
      CHECK((x - solution.states[k]).cwiseAbs().maxCoeff() <= 1e-12);
    }
  }
}

TEST_CASE("ResidualsAreThoseOfTheIndependentCheck") {
  for (const QpEngine which : kEngines) {
    for (const bool corrected : {true, false}) {
      Settings settings;
      settings.correct_active_set = corrected;
      const Problem problem = pushed(10);
      Solution solution(problem.sizes);
      REQUIRE(make(which, problem, settings)->solve(problem, solution) == QpStatus::kSolved);
      CHECK(solution.iterations > 0);
      std::vector<StateVector> states(10);
      const Residuals residuals = KktCheck(problem.sizes).evaluate(problem, solution.forces, states);
      CHECK(solution.primal_residual == residuals.primal);
      CHECK(solution.dual_residual == residuals.dual);
    }
  }
}

TEST_CASE("BadProblemsAreRefusedAndTheNextGoodOneIsSolvedAsByAFreshEngine") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  struct Bad {
    const char* what;
    QpStatus status;
    std::function<void(Problem&)> spoil;
  };
  const Bad bad[] = {
      {"NaN in x0", QpStatus::kInvalidProblem, [](Problem& p) { p.x0(3) = kNan; }},
      {"infinite x0", QpStatus::kInvalidProblem, [](Problem& p) { p.x0(0) = kInfinity; }},
      {"x0 beyond all arithmetic", QpStatus::kInvalidProblem, [](Problem& p) { p.x0(0) = 1e306; }},
      {"NaN in A", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[2].dynamics.A(0, 6) = kNan; }},
      {"infinity in A", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[1].dynamics.A(6, 4) = kInfinity; }},
      {"NaN in B", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[2].dynamics.B(7, 1) = kNan; }},
      {"NaN in g", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[2].dynamics.g(11) = kNan; }},
      {"another structure", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[2].dynamics.A(9, 0) = 0.1; }},
      {"NaN in the reference", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[4].x_ref(5) = kNan; }},
      {"NaN in f_ref", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[4].f_ref(2) = kNan; }},
      {"NaN in Q", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[1].Q(2) = kNan; }},
      {"negative Q", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[1].Q(2) = -1.0; }},
      {"zero R", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[1].R(2) = 0.0; }},
      {"NaN in P", QpStatus::kInvalidProblem, [](Problem& p) { p.terminal_cost(1, 1) = kNan; }},
      {"P not symmetric", QpStatus::kInvalidProblem, [](Problem& p) { p.terminal_cost(1, 2) += 10.0; }},
      {"P not convex", QpStatus::kInvalidProblem, [](Problem& p) { p.terminal_cost *= -1.0; }},
      {"mu zero", QpStatus::kInvalidProblem, [](Problem& p) { p.friction = 0.0; }},
      {"mu NaN", QpStatus::kInvalidProblem, [](Problem& p) { p.friction = kNan; }},
      {"bounds crossed", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[0].fz_min[1] = 400.0; }},
      {"bound NaN", QpStatus::kInvalidProblem, [](Problem& p) { p.stages[0].fz_max[1] = kNan; }},
      {"another horizon", QpStatus::kInvalidProblem, [](Problem& p) { p.stages.pop_back(); }},
      {"pulling contact", QpStatus::kInfeasible,
       [](Problem& p) {
         p.stages[3].fz_min[0] = -20.0;
         p.stages[3].fz_max[0] = -10.0;
       }},
  };
  for (const QpEngine which : kEngines) {
    const Problem good = pushed(5);
    Solution fresh(good.sizes);
    REQUIRE(make(which, good)->solve(good, fresh) == QpStatus::kSolved);
    REQUIRE(fresh.iterations > 0);
    auto engine = make(which, good);
    for (const Bad& with : bad) {
      INFO(with.what);
      Problem spoilt = pushed(5);
      spoilt.friction = 0.3;
      Solution solution(good.sizes);
      CHECK(engine->solve(spoilt, solution) == QpStatus::kSolved);
      with.spoil(spoilt);
      CHECK(engine->solve(spoilt, solution) == with.status);
      CHECK(solution.status == with.status);
      CHECK(engine->solve(good, solution) == QpStatus::kSolved);
      CHECK(same_bits(solution, fresh));
    }
  }
}

TEST_CASE("ABudgetOfOneIterationIsNotEnoughAndSaysSo") {
  Settings settings;
  settings.max_iterations = 1;
  for (const QpEngine which : kEngines) {
    const Problem hard = pushed(10);
    auto engine = make(which, hard, settings);
    Solution solution(hard.sizes);
    CHECK(engine->solve(hard, solution) == QpStatus::kMaxIterations);
    CHECK(solution.iterations == 1);
    const Problem easy = standing(10);
    CHECK(engine->solve(easy, solution) == QpStatus::kSolved);
    CHECK(engine->solve(hard, solution) == QpStatus::kMaxIterations);
  }
}

TEST_CASE("IterationsNeverExceedTheirBudget") {
  Settings settings;
  settings.correct_active_set = false;
  settings.tolerance = 1e-12;
  settings.max_iterations = 35;
  for (const QpEngine which : kEngines) {
    std::mt19937_64 random(13);
    auto engine = make(which, walking(10, 0), settings);
    Solution solution({10, 2});
    for (int tick = 0; tick < 20; ++tick) {
      Problem problem = walking(10, tick, 0.2);
      disturb(problem, 4.0, random);
      [[maybe_unused]] const QpStatus status = engine->solve(problem, solution);
      CHECK(solution.iterations <= settings.max_iterations);
    }
  }
}

TEST_CASE("AnInaccurateSolutionSaysSo") {
  Settings settings;
  settings.correct_active_set = false;
  settings.tolerance = 1e-2;
  settings.max_primal_residual = 1e-9;
  settings.max_dual_residual = 1e-9;
  for (const QpEngine which : kOsqpEngines) {
    const Problem problem = pushed(10);
    Solution solution(problem.sizes);
    CHECK(make(which, problem, settings)->solve(problem, solution) == QpStatus::kInaccurate);
    CHECK(std::max(solution.primal_residual, solution.dual_residual) > 1e-9);
  }
}

TEST_CASE("ResetForgets") {
  for (const QpEngine which : kEngines) {
    const Problem problem = pushed(10);
    Solution first(problem.sizes);
    Solution again(problem.sizes);
    auto engine = make(which, problem);
    REQUIRE(engine->solve(problem, first) == QpStatus::kSolved);
    REQUIRE(engine->solve(walking(10, 5, 0.1), again) == QpStatus::kSolved);
    engine->reset();
    REQUIRE(engine->solve(problem, again) == QpStatus::kSolved);
    CHECK(same_bits(first, again));
  }
}

TEST_CASE("BadSettingsAndSizesAreRefusedAtSetUp") {
  const auto refused = [](const std::function<void(Settings&)>& spoil) {
    Settings settings;
    spoil(settings);
    try {
      make_force_qp(settings, {1, 2}, kWeight);
    } catch (const std::invalid_argument&) {
      return true;
    }
    return false;
  };
  CHECK_FALSE(refused([](Settings&) {}));
  CHECK(refused([](Settings& s) { s.tolerance = 0.0; }));
  CHECK(refused([](Settings& s) { s.tolerance = std::numeric_limits<double>::quiet_NaN(); }));
  CHECK(refused([](Settings& s) { s.max_iterations = 0; }));
  CHECK(refused([](Settings& s) { s.fallback_iterations = -1; }));
  CHECK(refused([](Settings& s) { s.check_interval = 0; }));
  CHECK(refused([](Settings& s) { s.rho = -1.0; }));
  CHECK(refused([](Settings& s) { s.max_primal_residual = 0.0; }));
  CHECK(refused([](Settings& s) { s.max_dual_residual = 0.0; }));
  CHECK_THROWS_AS(make_force_qp({}, {0, 2}, kWeight), std::invalid_argument);
  CHECK_THROWS_AS(make_force_qp({}, {1, 5}, kWeight), std::invalid_argument);
  CHECK_THROWS_AS(make_force_qp({}, {1, 2}, 0.0), std::invalid_argument);
  CHECK_THROWS_AS(Problem({1, 0}), std::invalid_argument);
}
