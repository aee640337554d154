#pragma once
// The force QP as OSQP takes it, in two forms over the same friction rows. Forces in units of the typical one: u = f/F.
//
// Friction rows of a contact, all five zero in swing:
//   u_x - mu u_z <= 0      u_x + mu u_z >= 0      the same for y      fz_min/F <= u_z <= fz_max/F
//
// Condensed: variables u_0..u_(N-1). With the states eliminated the cost is 1/2 u'Hu + h'u, and of H block (i, j <= i)
//   F^2 (B_i' V_(i+1) A_i ... A_(j+1) B_j + delta_ij R)      V_k = Q + A_k' V_(k+1) A_k      h = F gradient at f = 0
//
// Sparse: variables (u_k, z_(k+1)) by stage, z = x - xref, and rows
//   z_(k+1) - A_k z_k - F B_k u_k = A_k xref_k + g_k - xref_(k+1)
//
// The cost is divided by the mean of its diagonal over the forces, so that rho means the same whatever the weights.
#include <memory>
#include <vector>

#include "controller/force_qp/active_set.hpp"
#include "controller/force_qp/kkt.hpp"
#include "controller/force_qp/osqp_solver.hpp"

namespace stance::force_qp {

class OsqpForm {
 public:
  virtual ~OsqpForm() = default;
  OsqpForm(const OsqpForm&) = delete;
  OsqpForm& operator=(const OsqpForm&) = delete;

  /// Takes P and A over from `problem`. False where OSQP refuses them.
  bool update_matrices(const Problem& problem) noexcept;
  /// Takes q, l and u over. False where OSQP refuses them.
  bool update_vectors(const Problem& problem) noexcept;
  /// The next solve starts from `forces` and the multipliers that the last one ended with, or none.
  void warm_start(const Problem& problem, const std::vector<ForceVector>& forces,
                  const std::vector<StateVector>& states, const std::vector<StateVector>& costates,
                  bool keep_multipliers) noexcept;
  OsqpSolver::Outcome solve(double tolerance, int max_iterations) noexcept {
    return solver_->solve(tolerance, max_iterations);
  }
  void reset() noexcept { solver_->reset(); }

  /// Forces of the last solve; those in swing are zero.
  void forces(const Problem& problem, std::vector<ForceVector>& out) const noexcept;
  /// What the last solve's multipliers say is active.
  void activity(const Problem& problem, Activity& out) const noexcept;

 protected:
  OsqpForm(Sizes sizes, double typical_force, int extra_columns, int extra_rows);
  std::size_t force_column(std::size_t stage) const { return stage * stage_columns_; }
  std::size_t friction_row(std::size_t stage, std::size_t contact) const {
    return stage * stage_rows_ + extra_rows_ + kRows * contact;
  }
  /// Appends the friction entries to A's list and makes the solver.
  void set_up(const std::vector<OsqpSolver::Entry>& P, std::vector<OsqpSolver::Entry> A, const Settings& settings);

  virtual void fill_matrices(const Problem& problem) noexcept = 0;
  virtual void fill_vectors(const Problem& problem) noexcept = 0;
  virtual void warm_start_states(const Problem& problem, const std::vector<StateVector>& states,
                                 const std::vector<StateVector>& costates) noexcept = 0;

  static constexpr std::size_t kRows = 5;  ///< friction rows of a contact
  Sizes sizes_;
  double typical_force_;     ///< N
  double cost_scale_ = 1.0;  ///< of the cost handed to OSQP over half the force QP's
  std::size_t stage_columns_;
  std::size_t stage_rows_;
  std::size_t extra_rows_;
  std::size_t first_friction_entry_ = 0;
  std::unique_ptr<OsqpSolver> solver_;
};

std::unique_ptr<OsqpForm> make_condensed_form(Sizes sizes, double typical_force, const Settings& settings);
std::unique_ptr<OsqpForm> make_sparse_form(Sizes sizes, double typical_force, const Settings& settings);

}  // namespace stance::force_qp
