#include "controller/force_qp/osqp_form.hpp"

namespace stance::force_qp {
namespace {

template <int NU>
class Condensed final : public OsqpForm {
 public:
  Condensed(Sizes sizes, double typical_force, const Settings& settings)
      : OsqpForm(sizes, typical_force, 0, 0),
        V_(static_cast<std::size_t>(sizes.num_stages)),
        no_forces_(static_cast<std::size_t>(sizes.num_stages), ForceVector::Zero(NU)),
        states_(static_cast<std::size_t>(sizes.num_stages)),
        kkt_(sizes) {
    std::vector<OsqpSolver::Entry> P;
    for (int column = 0; column < NU * sizes.num_stages; ++column) {
      for (int row = 0; row <= column; ++row) P.push_back({row, column});
    }
    set_up(P, {}, settings);
  }

 private:
  void fill_matrices(const Problem& problem) noexcept override {
    const std::size_t N = problem.stages.size();
    for (std::size_t k = N; k-- > 0;) {
      if (k + 1 == N) {
        V_[k] = problem.has_terminal_cost ? problem.terminal_cost : StateMatrix(problem.stages[k].Q.asDiagonal());
      } else {
        const StateMatrix& A = problem.stages[k + 1].dynamics.A;
        StateMatrix VA = V_[k + 1];
        times_A(A, VA);
        V_[k] = VA.transpose();
        times_A(A, V_[k]);
        V_[k].diagonal() += problem.stages[k].Q;
      }
    }

    const double F2 = typical_force_ * typical_force_;
    double trace = 0.0;
    for (std::size_t i = 0; i < N; ++i) {
      const StageData& stage = problem.stages[i];
      Eigen::Matrix<double, NU, 12> W;  // B_i' V_(i+1) A_i ... A_(j+1)
      W.noalias() = stage.dynamics.B.template bottomRows<6>().transpose().lazyProduct(V_[i].template bottomRows<6>());
      for (std::size_t j = i + 1; j-- > 0;) {
        Eigen::Matrix<double, NU, NU> block;
        block.noalias() = W.template rightCols<6>().lazyProduct(problem.stages[j].dynamics.B.template bottomRows<6>());
        if (j == i) {
          block.diagonal() += stage.R;
          trace += F2 * block.trace();
        }
        store(i, j, F2 * block);
        times_A(problem.stages[j].dynamics.A, W);
      }
    }
    cost_scale_ = static_cast<double>(N * NU) / trace;
    for (double& value : solver_->P) value *= cost_scale_;
  }

  /// Block (i, j) of H, j <= i, as block (j, i) of the upper triangle.
  void store(std::size_t i, std::size_t j, const Eigen::Matrix<double, NU, NU>& block) noexcept {
    for (int c = 0; c < NU; ++c) {
      const std::size_t column = NU * i + static_cast<std::size_t>(c);
      double* top = &solver_->P[column * (column + 1) / 2 + NU * j];
      const int rows = i == j ? c + 1 : NU;
      for (int r = 0; r < rows; ++r) top[r] = block(c, r);
    }
  }

  void fill_vectors(const Problem& problem) noexcept override {
    kkt_.evaluate(problem, no_forces_, states_);
    for (std::size_t k = 0; k < states_.size(); ++k) {
      Eigen::Map<Eigen::Matrix<double, NU, 1>>(&solver_->q[NU * k]) =
          (cost_scale_ * typical_force_) * kkt_.gradient()[k];
    }
  }

  void warm_start_states(const Problem& /*problem*/, const std::vector<StateVector>& /*states*/,
                         const std::vector<StateVector>& /*costates*/) noexcept override {}

  std::vector<StateMatrix> V_;  ///< V_(k+1)
  std::vector<ForceVector> no_forces_;
  std::vector<StateVector> states_;
  KktCheck kkt_;
};

}  // namespace

std::unique_ptr<OsqpForm> make_condensed_form(Sizes sizes, double typical_force, const Settings& settings) {
  switch (sizes.num_contacts) {
    case 1:
      return std::make_unique<Condensed<3>>(sizes, typical_force, settings);
    case 2:
      return std::make_unique<Condensed<6>>(sizes, typical_force, settings);
    case 3:
      return std::make_unique<Condensed<9>>(sizes, typical_force, settings);
    default:
      return std::make_unique<Condensed<12>>(sizes, typical_force, settings);
  }
}

}  // namespace stance::force_qp
