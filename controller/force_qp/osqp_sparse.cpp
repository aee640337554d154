#include <algorithm>
#include <cmath>

#include "controller/force_qp/osqp_form.hpp"

namespace stance::force_qp {
namespace {

constexpr std::size_t kStates = centroidal::kStates;

class Sparse final : public OsqpForm {
 public:
  Sparse(Sizes sizes, double typical_force, const Settings& settings)
      : OsqpForm(sizes, typical_force, centroidal::kStates, centroidal::kStates), num_forces_(3 * sizes.num_contacts) {
    const auto N = static_cast<std::size_t>(sizes.num_stages);
    std::vector<OsqpSolver::Entry> P;
    for (std::size_t k = 0; k < N; ++k) {
      for (std::size_t i = 0; i < stage_columns_; ++i) {
        const int column = static_cast<int>(force_column(k) + i);
        P.push_back({column, column});
      }
    }
    for (std::size_t column = 1; column < kStates; ++column) {
      for (std::size_t row = 0; row < column; ++row) {
        P.push_back({static_cast<int>(state_column(N - 1) + row), static_cast<int>(state_column(N - 1) + column)});
      }
    }
    std::vector<OsqpSolver::Entry> A;
    const auto entry = [&](std::size_t row, std::size_t column) {
      A.push_back({static_cast<int>(row), static_cast<int>(column)});
    };
    for (std::size_t k = 0; k < N; ++k) {
      const std::size_t row = k * stage_rows_;
      for (std::size_t i = 0; i < kStates; ++i) entry(row + i, state_column(k) + i);
      for (std::size_t j = 0; j < static_cast<std::size_t>(num_forces_); ++j) {
        for (std::size_t i = 6; i < kStates; ++i) entry(row + i, force_column(k) + j);
      }
      if (k == 0) continue;
      for (std::size_t i = 0; i < kStates; ++i) entry(row + i, state_column(k - 1) + i);
      for (const Block& block : kBlocks) {
        for (std::size_t j = 0; j < 3; ++j) {
          for (std::size_t i = 0; i < 3; ++i) entry(row + block.row + i, state_column(k - 1) + block.column + j);
        }
      }
    }
    set_up(P, A, settings);
  }

 private:
  /// Where A has entries off its diagonal.
  struct Block {
    std::size_t row;
    std::size_t column;
  };
  static constexpr std::array<Block, 3> kBlocks{{{0, 6}, {3, 9}, {6, 3}}};

  std::size_t state_column(std::size_t stage) const {
    return force_column(stage) + static_cast<std::size_t>(num_forces_);
  }

  void fill_matrices(const Problem& problem) noexcept override {
    const std::size_t N = problem.stages.size();
    const double F = typical_force_;
    double trace = 0.0;
    std::size_t entry = 0;
    for (std::size_t k = 0; k < N; ++k) {
      const StageData& stage = problem.stages[k];
      for (int i = 0; i < num_forces_; ++i) solver_->P[entry++] = F * F * stage.R(i);
      for (int i = 0; i < centroidal::kStates; ++i) {
        const bool last = k + 1 == N && problem.has_terminal_cost;
        solver_->P[entry++] = last ? problem.terminal_cost(i, i) : stage.Q(i);
      }
      trace += F * F * stage.R.sum();
    }
    for (int column = 1; column < centroidal::kStates; ++column) {
      for (int row = 0; row < column; ++row) {
        solver_->P[entry++] = problem.has_terminal_cost ? problem.terminal_cost(row, column) : 0.0;
      }
    }
    cost_scale_ = static_cast<double>(N) * num_forces_ / trace;
    for (double& value : solver_->P) value *= cost_scale_;

    entry = 0;
    for (std::size_t k = 0; k < N; ++k) {
      const Dynamics& dynamics = problem.stages[k].dynamics;
      for (std::size_t i = 0; i < kStates; ++i) solver_->A[entry++] = 1.0;
      for (int j = 0; j < num_forces_; ++j) {
        for (int i = 6; i < centroidal::kStates; ++i) solver_->A[entry++] = -F * dynamics.B(i, j);
      }
      if (k == 0) continue;
      for (std::size_t i = 0; i < kStates; ++i) solver_->A[entry++] = -1.0;
      for (const Block& block : kBlocks) {
        for (std::size_t j = 0; j < 3; ++j) {
          for (std::size_t i = 0; i < 3; ++i) {
            solver_->A[entry++] = -dynamics.A(static_cast<int>(block.row + i), static_cast<int>(block.column + j));
          }
        }
      }
    }
  }

  void fill_vectors(const Problem& problem) noexcept override {
    for (std::size_t k = 0; k < problem.stages.size(); ++k) {
      const StageData& stage = problem.stages[k];
      Eigen::Map<Eigen::VectorXd>(&solver_->q[force_column(k)], num_forces_) =
          (-cost_scale_ * typical_force_) * stage.R.cwiseProduct(stage.f_ref);
      StateVector offset = stage.dynamics.g - stage.x_ref;
      offset.noalias() += stage.dynamics.A.lazyProduct(k == 0 ? problem.x0 : problem.stages[k - 1].x_ref);
      Eigen::Map<StateVector>(&solver_->l[k * stage_rows_]) = offset;
      Eigen::Map<StateVector>(&solver_->u[k * stage_rows_]) = offset;
    }
  }

  void warm_start_states(const Problem& problem, const std::vector<StateVector>& states,
                         const std::vector<StateVector>& costates) noexcept override {
    for (std::size_t k = 0; k < states.size(); ++k) {
      Eigen::Map<StateVector>(&solver_->x[state_column(k)]) = states[k] - problem.stages[k].x_ref;
      Eigen::Map<StateVector>(&solver_->y[k * stage_rows_]) = -cost_scale_ * costates[k];
    }
  }

  int num_forces_;
};

}  // namespace

std::unique_ptr<OsqpForm> make_sparse_form(Sizes sizes, double typical_force, const Settings& settings) {
  return std::make_unique<Sparse>(sizes, typical_force, settings);
}

}  // namespace stance::force_qp
