#include "controller/force_qp/osqp_form.hpp"

#include <algorithm>

namespace stance::force_qp {
namespace {

constexpr double kUnbounded = 1e30;  // OSQP's infinity

bool in_swing(const StageData& stage, std::size_t contact) noexcept { return stage.fz_max[contact] <= 0.0; }

}  // namespace

OsqpForm::OsqpForm(Sizes sizes, double typical_force, int extra_columns, int extra_rows)
    : sizes_(sizes),
      typical_force_(typical_force),
      stage_columns_(static_cast<std::size_t>(3 * sizes.num_contacts + extra_columns)),
      stage_rows_(kRows * static_cast<std::size_t>(sizes.num_contacts) + static_cast<std::size_t>(extra_rows)),
      extra_rows_(static_cast<std::size_t>(extra_rows)) {}

void OsqpForm::set_up(const std::vector<OsqpSolver::Entry>& P, std::vector<OsqpSolver::Entry> A,
                      const Settings& settings) {
  first_friction_entry_ = A.size();
  for (std::size_t k = 0; k < static_cast<std::size_t>(sizes_.num_stages); ++k) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(sizes_.num_contacts); ++c) {
      const int row = static_cast<int>(friction_row(k, c));
      const int column = static_cast<int>(force_column(k) + 3 * c);
      for (int face = 0; face < 4; ++face) {
        A.push_back({row + face, column + face / 2});
        A.push_back({row + face, column + 2});
      }
      A.push_back({row + 4, column + 2});
    }
  }
  const int num_variables = static_cast<int>(stage_columns_) * sizes_.num_stages;
  const int num_constraints = static_cast<int>(stage_rows_) * sizes_.num_stages;
  solver_ = std::make_unique<OsqpSolver>(num_variables, num_constraints, P, A, settings);
}

bool OsqpForm::update_matrices(const Problem& problem) noexcept {
  std::size_t entry = first_friction_entry_;
  while (entry < solver_->A.size()) {
    for (int face = 0; face < 4; ++face) {
      solver_->A[entry++] = 1.0;
      solver_->A[entry++] = face % 2 == 0 ? -problem.friction : problem.friction;
    }
    solver_->A[entry++] = 1.0;
  }
  fill_matrices(problem);
  return solver_->update_matrices();
}

bool OsqpForm::update_vectors(const Problem& problem) noexcept {
  for (std::size_t k = 0; k < problem.stages.size(); ++k) {
    const StageData& stage = problem.stages[k];
    for (std::size_t c = 0; c < static_cast<std::size_t>(sizes_.num_contacts); ++c) {
      const std::size_t row = friction_row(k, c);
      const double unbounded = in_swing(stage, c) ? 0.0 : kUnbounded;
      for (std::size_t face = 0; face < 4; ++face) {
        solver_->l[row + face] = face % 2 == 0 ? -unbounded : 0.0;
        solver_->u[row + face] = face % 2 == 0 ? 0.0 : unbounded;
      }
      solver_->l[row + 4] = std::max(stage.fz_min[c], 0.0) / typical_force_;
      solver_->u[row + 4] = stage.fz_max[c] / typical_force_;
    }
  }
  fill_vectors(problem);
  return solver_->update_vectors();
}

void OsqpForm::warm_start(const Problem& problem, const std::vector<ForceVector>& forces,
                          const std::vector<StateVector>& states, const std::vector<StateVector>& costates,
                          bool keep_multipliers) noexcept {
  if (!keep_multipliers) std::fill(solver_->y.begin(), solver_->y.end(), 0.0);
  for (std::size_t k = 0; k < forces.size(); ++k) {
    Eigen::Map<Eigen::VectorXd>(&solver_->x[force_column(k)], 3 * sizes_.num_contacts) = forces[k] / typical_force_;
  }
  warm_start_states(problem, states, costates);
}

void OsqpForm::forces(const Problem& problem, std::vector<ForceVector>& out) const noexcept {
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k] = typical_force_ * Eigen::Map<const Eigen::VectorXd>(&solver_->x[force_column(k)], 3 * sizes_.num_contacts);
    for (int c = 0; c < sizes_.num_contacts; ++c) {
      if (in_swing(problem.stages[k], static_cast<std::size_t>(c))) out[k].segment<3>(3 * c).setZero();
    }
  }
}

void OsqpForm::activity(const Problem& problem, Activity& out) const noexcept {
  activity_of_bounds(problem, out);
  for (std::size_t k = 0; k < out.size(); ++k) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(sizes_.num_contacts); ++c) {
      if (in_swing(problem.stages[k], c)) continue;
      const double* u = &solver_->x[force_column(k) + 3 * c];
      const std::size_t row = friction_row(k, c);
      const double* y = &solver_->y[row];
      const double face = problem.friction * u[2];
      // A constraint is active where its multiplier exceeds its slack.
      const auto side = [&](double component, double y_upper, double y_lower) noexcept {
        const bool upper = y_upper > face - component;
        const bool lower = -y_lower > face + component;
        if (upper && lower) return static_cast<std::int8_t>(y_upper > -y_lower ? 1 : -1);
        return static_cast<std::int8_t>(upper - lower);
      };
      out[k][c].x = side(u[0], y[0], y[1]);
      out[k][c].y = side(u[1], y[2], y[3]);
      if (out[k][c].z == 0) {
        if (y[4] > solver_->u[row + 4] - u[2]) out[k][c].z = 1;
        if (-y[4] > u[2] - solver_->l[row + 4]) out[k][c].z = -1;
      }
    }
  }
}

}  // namespace stance::force_qp
