#include "controller/force_qp/structured_engine.hpp"

#include <algorithm>
#include <cmath>

#include "controller/force_qp/inspect.hpp"
#include "controller/force_qp/kkt.hpp"
#include "controller/force_qp/osqp_engine.hpp"

namespace stance::force_qp {
namespace {

constexpr double kExact = 1e-6;  // N, residuals of a solution that is exact but for rounding
constexpr int kMaxRefinements = 2;
constexpr double kCountsAsActive = 1e-5;   // of a constraint that counts as active, relative to the typical force
constexpr int kMaxCondensedContacts = 40;  // of all stages, up to which OSQP is faster without the states

Settings fallback_settings(Settings settings, Sizes sizes) {
  const bool condensed = sizes.num_stages * sizes.num_contacts <= kMaxCondensedContacts;
  settings.engine = condensed ? QpEngine::kOsqpCondensed : QpEngine::kOsqpSparse;
  settings.max_iterations = std::min(settings.max_iterations, settings.fallback_iterations);
  return settings;
}

class StructuredEngine final : public ForceQp {
 public:
  StructuredEngine(const Settings& settings, Sizes sizes, double typical_force,
                   std::unique_ptr<StructuredSolver> solver)
      : sizes_(sizes),
        typical_force_(typical_force),
        solver_(std::move(solver)),
        fallback_settings_(fallback_settings(settings, sizes)),
        fallback_(settings.fallback_iterations == 0 ? nullptr
                                                    : make_osqp_engine(fallback_settings_, sizes, typical_force)),
        kkt_(sizes),
        taken_over_(sizes) {}

  QpStatus solve(const Problem& problem, Solution& solution, double time_left) noexcept override {
    solution.engine = QpEngine::kStructured;
    solution.iterations = 0;
    solution.primal_residual = 0.0;
    solution.dual_residual = 0.0;
    solution.active = 0;
    solution.status = inspect(problem, sizes_);
    if (solution.status != QpStatus::kSolved) {
      reset();
      return solution.status;
    }
    solution.status = solve_inspected(problem, solution);
    if (solution.status == QpStatus::kSolved) {
      solution.active = count_active(problem, 0, solution.forces.front(), kCountsAsActive * typical_force_);
      return solution.status;
    }
    reset();
    if (fallback_ == nullptr) return solution.status;
    const int affordable = affordable_iterations(fallback_settings_, sizes_, time_left);
    return affordable == 0 ? solution.status : fallback_->solve_within(problem, solution, affordable);
  }

  void reset() noexcept override {
    solver_->reset();
    is_factored_ = false;
    if (fallback_ != nullptr) fallback_->reset();
  }

 private:
  QpStatus solve_inspected(const Problem& problem, Solution& solution) noexcept {
    if (!is_factored_ || matrices_differ(problem, taken_over_)) {
      taken_over_ = problem;
      is_factored_ = solver_->take_matrices(problem);
      if (!is_factored_) return QpStatus::kInvalidProblem;
    } else {
      solver_->take_ahead();
    }
    solver_->take_vectors(problem);
    const QpStatus status = solver_->solve();
    solution.iterations = solver_->iterations();
    for (int refinement = 0;; ++refinement) {
      solver_->forces(solution.forces);
      const Residuals residuals = kkt_.evaluate(problem, solution.forces, solution.states);
      solution.primal_residual = residuals.primal;
      solution.dual_residual = residuals.dual;
      if (!std::isfinite(residuals.dual)) return QpStatus::kInvalidProblem;  // numbers too large to compute with
      if (status != QpStatus::kSolved) return status;
      if (residuals.primal <= kExact && residuals.dual <= kExact) return QpStatus::kSolved;
      if (refinement == kMaxRefinements) return QpStatus::kInaccurate;
      solver_->refine();
    }
  }

  Sizes sizes_;
  double typical_force_;  ///< N
  std::unique_ptr<StructuredSolver> solver_;
  Settings fallback_settings_;
  std::unique_ptr<OsqpForceQp> fallback_;  ///< may be none
  KktCheck kkt_;
  Problem taken_over_;
  bool is_factored_ = false;  ///< with taken_over_'s matrices
};

}  // namespace

std::unique_ptr<ForceQp> make_structured_engine(const Settings& settings, Sizes sizes, double typical_force,
                                                Simd simd) {
  return make_structured_engine(settings, sizes, typical_force,
                                make_structured_solver(sizes, typical_force, settings.max_iterations, simd));
}

std::unique_ptr<ForceQp> make_structured_engine(const Settings& settings, Sizes sizes, double typical_force,
                                                std::unique_ptr<StructuredSolver> solver) {
  return std::make_unique<StructuredEngine>(settings, sizes, typical_force, std::move(solver));
}

}  // namespace stance::force_qp
