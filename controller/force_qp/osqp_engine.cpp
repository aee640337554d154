#include "controller/force_qp/osqp_engine.hpp"

#include <algorithm>
#include <cmath>

#include "controller/force_qp/active_set.hpp"
#include "controller/force_qp/inspect.hpp"
#include "controller/force_qp/kkt.hpp"
#include "controller/force_qp/osqp_form.hpp"

namespace stance::force_qp {
namespace {

constexpr double kCoarseTolerance = 1e-2;  // good enough to guess the active set from
constexpr int kMaxCorrections = 12;        // of the active set, after each of OSQP's tolerances
constexpr double kExact = 1e-6;            // N, residuals of a solution that is exact but for rounding
constexpr double kZero = 1e-9;             // of a force or a multiplier, relative to the typical one
constexpr double kActive = 1e-5;           // of a constraint that counts as active, relative to the typical force

bool is_exact(const Residuals& residuals) noexcept { return residuals.primal <= kExact && residuals.dual <= kExact; }

template <int NU>
class OsqpEngine final : public OsqpForceQp {
 public:
  OsqpEngine(const Settings& settings, Sizes sizes, double typical_force)
      : OsqpForceQp(settings.max_iterations),
        settings_(settings),
        sizes_(sizes),
        typical_force_(typical_force),
        form_(settings.engine == QpEngine::kOsqpSparse ? make_sparse_form(sizes, typical_force, settings)
                                                       : make_condensed_form(sizes, typical_force, settings)),
        free_(sizes),
        constrained_(sizes),
        kkt_(sizes),
        taken_over_(sizes),
        activity_(static_cast<std::size_t>(sizes.num_stages)),
        candidate_(sizes) {}

  QpStatus solve_within(const Problem& problem, Solution& solution, int max_iterations) noexcept override {
    solution.engine = settings_.engine;
    solution.iterations = 0;
    solution.primal_residual = 0.0;
    solution.dual_residual = 0.0;
    solution.active = 0;
    solution.status = inspect(problem, sizes_);
    if (solution.status == QpStatus::kSolved) {
      solution.status = take_over(problem)
                            ? solve_inspected(problem, solution, std::min(max_iterations, max_iterations_))
                            : QpStatus::kInvalidProblem;
    }
    if (solution.status == QpStatus::kSolved) {
      solution.active = count_active(problem, 0, solution.forces.front(), kActive * typical_force_);
    } else {
      reset();
    }
    return solution.status;
  }

  void reset() noexcept override {
    form_->reset();
    form_is_current_ = false;
    free_is_factored_ = false;
    has_multipliers_ = false;
  }

 private:
  /// Factors the free problem where it is another than the last. False where the cost is not convex.
  bool take_over(const Problem& problem) noexcept {
    if (!free_is_factored_ || matrices_differ(problem, taken_over_)) {
      taken_over_ = problem;
      form_is_current_ = false;
      activity_of_bounds(problem, activity_);
      free_is_factored_ = free_.factor(problem, activity_, sizes_.num_stages - 1);
    }
    return free_is_factored_;
  }

  /// Checks solution.forces and writes the residuals down; the states follow the forces.
  Residuals check(const Problem& problem, Solution& solution) noexcept {
    const Residuals residuals = kkt_.evaluate(problem, solution.forces, solution.states);
    solution.primal_residual = residuals.primal;
    solution.dual_residual = residuals.dual;
    return residuals;
  }

  QpStatus solve_inspected(const Problem& problem, Solution& solution, int max_iterations) noexcept {
    // Step 1
    free_.solve(problem, solution.forces);
    const Residuals residuals = check(problem, solution);
    if (!std::isfinite(residuals.dual)) return QpStatus::kInvalidProblem;  // numbers too large to compute with
    if (settings_.try_free_minimiser && is_exact(residuals)) {
      has_multipliers_ = false;
      return QpStatus::kSolved;
    }

    // Steps 2 and 3
    if (!form_is_current_ && !form_->update_matrices(problem)) return QpStatus::kInvalidProblem;
    form_is_current_ = true;
    if (!form_->update_vectors(problem)) return QpStatus::kInvalidProblem;
    warm_start(problem, solution.forces);
    const double coarse = std::max(kCoarseTolerance, settings_.tolerance);
    for (const double tolerance : {settings_.correct_active_set ? coarse : settings_.tolerance, settings_.tolerance}) {
      const OsqpSolver::Outcome outcome = form_->solve(tolerance, max_iterations - solution.iterations);
      solution.iterations += outcome.iterations;
      form_->forces(problem, solution.forces);
      check(problem, solution);
      if (outcome.status != QpStatus::kSolved) return outcome.status;
      if (settings_.correct_active_set && correct_active_set(problem, solution)) return QpStatus::kSolved;
      if (tolerance <= settings_.tolerance || solution.iterations >= max_iterations) break;
    }
    const bool accurate = solution.primal_residual <= settings_.max_primal_residual &&
                          solution.dual_residual <= settings_.max_dual_residual;
    return accurate ? QpStatus::kSolved : QpStatus::kInaccurate;
  }

  /// From the free minimiser, moved into the constraints, and the multipliers of the last solve.
  void warm_start(const Problem& problem, const std::vector<ForceVector>& free) noexcept {
    candidate_.forces = free;
    for (std::size_t k = 0; k < problem.stages.size(); ++k) {
      const StageData& stage = problem.stages[k];
      for (std::size_t c = 0; c < static_cast<std::size_t>(NU / 3); ++c) {
        auto force = candidate_.forces[k].template segment<3>(static_cast<Eigen::Index>(3 * c));
        force = project_on_pyramid(force, problem.friction, stage.fz_min[c], stage.fz_max[c]);
      }
    }
    kkt_.evaluate(problem, candidate_.forces, candidate_.states);
    form_->warm_start(problem, candidate_.forces, candidate_.states, kkt_.costates(), has_multipliers_);
    has_multipliers_ = true;
  }

  /// Step 3: whether the exact solution was found from the set that OSQP ended with.
  bool correct_active_set(const Problem& problem, Solution& solution) noexcept {
    form_->activity(problem, activity_);
    int last_changed = sizes_.num_stages - 1;
    for (int correction = 0; correction <= kMaxCorrections && last_changed >= 0; ++correction) {
      if (!constrained_.factor(problem, activity_, last_changed)) return false;
      constrained_.solve(problem, candidate_.forces);
      const Residuals residuals = kkt_.evaluate(problem, candidate_.forces, candidate_.states);
      if (is_exact(residuals)) {
        solution.forces = candidate_.forces;
        solution.states = candidate_.states;
        solution.primal_residual = residuals.primal;
        solution.dual_residual = residuals.dual;
        return true;
      }
      last_changed = correct(problem);
    }
    return false;
  }

  /// Moves activity_ on from the candidate's forces and gradient; the last stage that changed, or -1.
  int correct(const Problem& problem) noexcept {
    int last_changed = -1;
    for (std::size_t k = 0; k < activity_.size(); ++k) {
      const StageData& stage = problem.stages[k];
      for (std::size_t c = 0; c < static_cast<std::size_t>(NU / 3); ++c) {
        const auto row = static_cast<Eigen::Index>(3 * c);
        const double gradient_zero = kZero * typical_force_ * stage.R.template segment<3>(row).minCoeff();
        const ContactActivity next = next_activity(
            activity_[k][c], candidate_.forces[k].template segment<3>(row), kkt_.gradient()[k].template segment<3>(row),
            problem.friction, stage.fz_min[c], stage.fz_max[c], kZero * typical_force_, gradient_zero);
        if (next == activity_[k][c]) continue;
        activity_[k][c] = next;
        last_changed = static_cast<int>(k);
      }
    }
    return last_changed;
  }

  Settings settings_;
  Sizes sizes_;
  double typical_force_;  ///< N
  std::unique_ptr<OsqpForm> form_;
  bool form_is_current_ = false;  ///< its matrices are taken_over_'s
  ActiveSetProblem<NU> free_;
  bool free_is_factored_ = false;  ///< with taken_over_'s matrices and bounds
  ActiveSetProblem<NU> constrained_;
  KktCheck kkt_;
  Problem taken_over_;
  Activity activity_;
  bool has_multipliers_ = false;  ///< OSQP's are those of the last solution
  Solution candidate_;
};

}  // namespace

int affordable_iterations(const Settings& settings, Sizes sizes, double time_left) noexcept {
  constexpr double kRestOfTick = 1e-3;  // s
  constexpr double kCall = 50e-6;       // s, of one contact in one stage
  constexpr double kIteration = 0.7e-6;
  const double contacts = sizes.num_contacts * sizes.num_stages;
  const double iterations = (time_left - kRestOfTick - kCall * contacts) / (kIteration * contacts);
  return iterations < settings.check_interval ? 0
                                              : static_cast<int>(std::min<double>(iterations, settings.max_iterations));
}

std::unique_ptr<OsqpForceQp> make_osqp_engine(const Settings& settings, Sizes sizes, double typical_force) {
  switch (sizes.num_contacts) {
    case 1:
      return std::make_unique<OsqpEngine<3>>(settings, sizes, typical_force);
    case 2:
      return std::make_unique<OsqpEngine<6>>(settings, sizes, typical_force);
    case 3:
      return std::make_unique<OsqpEngine<9>>(settings, sizes, typical_force);
    default:
      return std::make_unique<OsqpEngine<12>>(settings, sizes, typical_force);
  }
}

}  // namespace stance::force_qp
