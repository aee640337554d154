// HPIPM: interior point with a Riccati recursion on the stage-wise problem (BLASFEO), warm-started in its variables.
#include <array>
#include <vector>

#include "tests/bench/force_qp/condensed.hpp"
#include "tests/bench/force_qp/peers.hpp"

extern "C" {
#include <hpipm_d_ocp_qp.h>
#include <hpipm_d_ocp_qp_dim.h>
#include <hpipm_d_ocp_qp_ipm.h>
#include <hpipm_d_ocp_qp_sol.h>
}

namespace stance::bench {
namespace {

constexpr int kStates = 12;
constexpr double kNone = 1e8;

/// One of HPIPM's objects in memory of its own.
template <typename T>
struct Held {
  T object{};
  std::vector<char> memory;
  T* operator&() { return &object; }
};

class Hpipm final : public Engine {
 public:
  Hpipm(const Sequence& sequence, int num_stages)
      : num_stages_(num_stages),
        contacts_(sequence.ticks.front().sizes.num_contacts),
        typical_force_(sequence.typical_force) {
    const auto stages = static_cast<std::size_t>(num_stages) + 1;
    std::vector<int> nx(stages, kStates), nu(stages, 3 * contacts_), none(stages, 0), nbu(stages, contacts_),
        ng(stages, 4 * contacts_);
    nx.front() = 0;  // x0 is known
    nu.back() = nbu.back() = ng.back() = 0;
    dim_.memory.resize(static_cast<std::size_t>(d_ocp_qp_dim_memsize(num_stages)));
    d_ocp_qp_dim_create(num_stages, &dim_, dim_.memory.data());
    d_ocp_qp_dim_set_all(nx.data(), nu.data(), none.data(), nbu.data(), ng.data(), none.data(), none.data(),
                         none.data(), &dim_);
    qp_.memory.resize(static_cast<std::size_t>(d_ocp_qp_memsize(&dim_)));
    d_ocp_qp_create(&dim_, &qp_, qp_.memory.data());
    solution_.memory.resize(static_cast<std::size_t>(d_ocp_qp_sol_memsize(&dim_)));
    d_ocp_qp_sol_create(&dim_, &solution_, solution_.memory.data());
    settings_.memory.resize(static_cast<std::size_t>(d_ocp_qp_ipm_arg_memsize(&dim_)));
    d_ocp_qp_ipm_arg_create(&dim_, &settings_, settings_.memory.data());
    d_ocp_qp_ipm_arg_set_default(SPEED, &settings_);
    double accuracy = 1e-9;
    int max_iterations = 100;
    int warm_start = 1;
    d_ocp_qp_ipm_arg_set_tol_stat(&accuracy, &settings_);
    d_ocp_qp_ipm_arg_set_tol_eq(&accuracy, &settings_);
    d_ocp_qp_ipm_arg_set_tol_ineq(&accuracy, &settings_);
    d_ocp_qp_ipm_arg_set_tol_comp(&accuracy, &settings_);
    d_ocp_qp_ipm_arg_set_iter_max(&max_iterations, &settings_);
    d_ocp_qp_ipm_arg_set_warm_start(&warm_start, &settings_);
    workspace_.memory.resize(static_cast<std::size_t>(d_ocp_qp_ipm_ws_memsize(&dim_, &settings_)));
    d_ocp_qp_ipm_ws_create(&dim_, &settings_, &workspace_, workspace_.memory.data());
  }

  bool solve(const Problem& problem, bool matrices_changed) override {
    if (matrices_changed) take_matrices(problem);
    take_vectors(problem);
    d_ocp_qp_ipm_solve(&qp_, &solution_, &settings_, &workspace_);
    int status = 0;
    d_ocp_qp_ipm_get_status(&workspace_, &status);
    return status == SUCCESS;
  }
  void forces(const Problem&, std::vector<ForceVector>& out) const override {
    std::array<double, 12> u{};
    for (int k = 0; k < num_stages_; ++k) {
      d_ocp_qp_sol_get_u(k, const_cast<d_ocp_qp_sol*>(&solution_.object), u.data());
      for (int i = 0; i < 3 * contacts_; ++i) {
        out[static_cast<std::size_t>(k)](i) = typical_force_ * u[static_cast<std::size_t>(i)];
      }
    }
  }
  int iterations() const override {
    int iterations = 0;
    d_ocp_qp_ipm_get_iter(const_cast<d_ocp_qp_ipm_ws*>(&workspace_.object), &iterations);
    return iterations;
  }

 private:
  void take_matrices(const Problem& problem) {
    const int m = 3 * contacts_;
    Eigen::Matrix<double, 12, 12> Q, A;
    Eigen::MatrixXd R = Eigen::MatrixXd::Zero(m, m), B(kStates, m), D = Eigen::MatrixXd::Zero(4 * contacts_, m);
    std::array<int, kMaxContacts> bounded{};
    for (int c = 0; c < contacts_; ++c) {
      D.block<4, 3>(4 * c, 3 * c) = friction_faces(problem.friction);
      bounded[static_cast<std::size_t>(c)] = 3 * c + 2;
    }
    Eigen::VectorXd lower = Eigen::VectorXd::Constant(4 * contacts_, -kNone),
                    upper = Eigen::VectorXd::Zero(4 * contacts_);
    Eigen::VectorXd no_lower = Eigen::VectorXd::Zero(4 * contacts_);
    for (int k = 0; k < num_stages_; ++k) {
      const force_qp::StageData& stage = problem.stages[static_cast<std::size_t>(k)];
      A = stage.dynamics.A;
      B = typical_force_ * stage.dynamics.B;
      R.diagonal() = typical_force_ * typical_force_ * stage.R;
      if (k > 0) d_ocp_qp_set_A(k, A.data(), &qp_);
      d_ocp_qp_set_B(k, B.data(), &qp_);
      d_ocp_qp_set_R(k, R.data(), &qp_);
      const bool last = k + 1 == num_stages_;
      if (last && problem.has_terminal_cost) {
        Q = problem.terminal_cost;
      } else {
        Q = stage.Q.asDiagonal();
      }
      d_ocp_qp_set_Q(k + 1, Q.data(), &qp_);
      d_ocp_qp_set_D(k, D.data(), &qp_);
      d_ocp_qp_set_lg(k, lower.data(), &qp_);
      d_ocp_qp_set_lg_mask(k, no_lower.data(), &qp_);
      d_ocp_qp_set_ug(k, upper.data(), &qp_);
      d_ocp_qp_set_idxbu(k, bounded.data(), &qp_);
      std::array<double, kMaxContacts> lbu{}, ubu{};
      for (std::size_t c = 0; c < static_cast<std::size_t>(contacts_); ++c) {
        lbu[c] = std::max(stage.fz_min[c], 0.0) / typical_force_;
        ubu[c] = stage.fz_max[c] / typical_force_;
      }
      d_ocp_qp_set_lbu(k, lbu.data(), &qp_);
      d_ocp_qp_set_ubu(k, ubu.data(), &qp_);
    }
  }
  void take_vectors(const Problem& problem) {
    force_qp::StateVector b, q;
    ForceVector r;
    for (int k = 0; k < num_stages_; ++k) {
      const force_qp::StageData& stage = problem.stages[static_cast<std::size_t>(k)];
      b = stage.dynamics.g;
      if (k == 0) b += stage.dynamics.A * problem.x0;
      d_ocp_qp_set_b(k, b.data(), &qp_);
      if (k + 1 == num_stages_ && problem.has_terminal_cost) {
        q = -(problem.terminal_cost * stage.x_ref);
      } else {
        q = -stage.Q.cwiseProduct(stage.x_ref);
      }
      d_ocp_qp_set_q(k + 1, q.data(), &qp_);
      r = -typical_force_ * stage.R.cwiseProduct(stage.f_ref);
      d_ocp_qp_set_r(k, r.data(), &qp_);
    }
  }

  int num_stages_, contacts_;
  double typical_force_;  ///< N
  Held<d_ocp_qp_dim> dim_;
  Held<d_ocp_qp> qp_;
  Held<d_ocp_qp_sol> solution_;
  Held<d_ocp_qp_ipm_arg> settings_;
  Held<d_ocp_qp_ipm_ws> workspace_;
};

}  // namespace

EngineKind hpipm() {
  return {"hpipm", "mode SPEED, tolerances 1e-9, warm start 1, x0 eliminated", &make_engine<Hpipm>};
}

}  // namespace stance::bench
