#include "controller/force_qp/osqp_solver.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

#include "osqp.h"

namespace stance::force_qp {
namespace {

constexpr OSQPInt kAdaptiveRhoInterval = 50;
// The caller has excluded infeasible problems; with its default of 1e-4 OSQP sees some where there are none.
constexpr double kInfeasibilityTolerance = 1e-12;

/// A sparsity pattern in compressed columns, and where each entry of the caller's list stands in it.
struct Pattern {
  Pattern(int rows, int columns, const std::vector<OsqpSolver::Entry>& entries)
      : position(entries.size()),
        row(entries.size()),
        start(static_cast<std::size_t>(columns) + 1, 0),
        value(entries.size(), 0.0) {
    std::vector<std::size_t> order(entries.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return entries[a].column != entries[b].column ? entries[a].column < entries[b].column
                                                    : entries[a].row < entries[b].row;
    });
    for (std::size_t i = 0; i < order.size(); ++i) {
      const OsqpSolver::Entry& entry = entries[order[i]];
      position[order[i]] = i;
      row[i] = entry.row;
      ++start[static_cast<std::size_t>(entry.column) + 1];
    }
    std::partial_sum(start.begin(), start.end(), start.begin());
    OSQPCscMatrix_set_data(&matrix, rows, columns, static_cast<OSQPInt>(entries.size()), value.data(), row.data(),
                           start.data());
  }
  Pattern(const Pattern&) = delete;
  Pattern& operator=(const Pattern&) = delete;

  void gather(const std::vector<double>& values) noexcept {
    for (std::size_t i = 0; i < values.size(); ++i) value[position[i]] = values[i];
  }

  std::vector<std::size_t> position;
  std::vector<OSQPInt> row;
  std::vector<OSQPInt> start;
  std::vector<double> value;
  OSQPCscMatrix matrix{};
};

QpStatus to_status(OSQPInt status) noexcept {
  switch (status) {
    case OSQP_SOLVED:
      return QpStatus::kSolved;
    case OSQP_PRIMAL_INFEASIBLE:
    case OSQP_PRIMAL_INFEASIBLE_INACCURATE:
      return QpStatus::kInfeasible;
    case OSQP_DUAL_INFEASIBLE:
    case OSQP_DUAL_INFEASIBLE_INACCURATE:
    case OSQP_NON_CVX:
      return QpStatus::kInvalidProblem;
    default:
      return QpStatus::kMaxIterations;
  }
}

}  // namespace

struct OsqpSolver::Implementation {
  Implementation(int n, int m, const std::vector<Entry>& P_entries, const std::vector<Entry>& A_entries)
      : P(n, n, P_entries), A(m, n, A_entries) {}
  ~Implementation() {
    if (solver != nullptr) osqp_cleanup(solver);
  }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  Pattern P;
  Pattern A;
  OSQPSettings settings{};
  OSQPSolver* solver = nullptr;
};

OsqpSolver::OsqpSolver(int num_variables, int num_constraints, const std::vector<Entry>& P_entries,
                       const std::vector<Entry>& A_entries, const Settings& settings)
    : P(P_entries.size(), 0.0),
      A(A_entries.size(), 1.0),
      q(static_cast<std::size_t>(num_variables), 0.0),
      l(static_cast<std::size_t>(num_constraints), -1.0),
      u(static_cast<std::size_t>(num_constraints), 1.0),
      x(static_cast<std::size_t>(num_variables), 0.0),
      y(static_cast<std::size_t>(num_constraints), 0.0),
      implementation_(std::make_unique<Implementation>(num_variables, num_constraints, P_entries, A_entries)) {
  for (std::size_t i = 0; i < P.size(); ++i) P[i] = P_entries[i].row == P_entries[i].column ? 1.0 : 0.0;
  implementation_->P.gather(P);
  implementation_->A.gather(A);

  OSQPSettings& osqp = implementation_->settings;
  osqp_set_default_settings(&osqp);
  osqp.verbose = 0;
  osqp.warm_starting = 1;
  osqp.scaling = 0;
  osqp.polishing = 0;
  osqp.rho = settings.rho;
  osqp.adaptive_rho = OSQP_ADAPTIVE_RHO_UPDATE_ITERATIONS;
  osqp.adaptive_rho_interval = kAdaptiveRhoInterval;
  osqp.eps_abs = settings.tolerance;
  osqp.eps_rel = settings.tolerance;
  osqp.eps_prim_inf = kInfeasibilityTolerance;
  osqp.eps_dual_inf = kInfeasibilityTolerance;
  osqp.check_termination = settings.check_interval;
  osqp.check_dualgap = 0;
  osqp.max_iter = settings.max_iterations;
  const OSQPInt error =
      osqp_setup(&implementation_->solver, &implementation_->P.matrix, q.data(), &implementation_->A.matrix, l.data(),
                 u.data(), num_constraints, num_variables, &osqp);
  if (error != 0) throw std::runtime_error(std::string("OSQP refuses the set-up: ") + osqp_error_message(error));
  solve(settings.tolerance, settings.max_iterations);  // OSQP's first solve is unlike the others
  reset();
}

OsqpSolver::~OsqpSolver() = default;

bool OsqpSolver::update_matrices() noexcept {
  Implementation& self = *implementation_;
  self.P.gather(P);
  self.A.gather(A);
  return osqp_update_data_mat(self.solver, self.P.value.data(), nullptr, static_cast<OSQPInt>(P.size()),
                              self.A.value.data(), nullptr, static_cast<OSQPInt>(A.size())) == 0;
}

bool OsqpSolver::update_vectors() noexcept {
  return osqp_update_data_vec(implementation_->solver, q.data(), l.data(), u.data()) == 0;
}

OsqpSolver::Outcome OsqpSolver::solve(double tolerance, int max_iterations) noexcept {
  Implementation& self = *implementation_;
  self.settings.eps_abs = tolerance;
  self.settings.eps_rel = tolerance;
  self.settings.max_iter = max_iterations;
  Outcome outcome;
  if (osqp_update_settings(self.solver, &self.settings) != 0 || osqp_warm_start(self.solver, x.data(), y.data()) != 0 ||
      osqp_solve(self.solver) != 0) {
    outcome.status = QpStatus::kInvalidProblem;
    return outcome;
  }
  outcome.iterations = self.solver->info->iter;
  outcome.status = to_status(self.solver->info->status_val);
  if (outcome.status == QpStatus::kSolved || outcome.status == QpStatus::kMaxIterations) {
    std::copy_n(self.solver->solution->x, x.size(), x.begin());
    std::copy_n(self.solver->solution->y, y.size(), y.begin());
  }
  return outcome;
}

void OsqpSolver::reset() noexcept {
  std::fill(x.begin(), x.end(), 0.0);
  std::fill(y.begin(), y.end(), 0.0);
  osqp_cold_start(implementation_->solver);
  osqp_update_rho(implementation_->solver, implementation_->settings.rho);
}

}  // namespace stance::force_qp
