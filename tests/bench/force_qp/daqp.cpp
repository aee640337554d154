// DAQP: a dual active set on the condensed problem. Warm-started with the working set of the last solve; where the
// matrices change, its factorisations are reset and the working set is given again.
#include <cstring>
#include <vector>

#include "tests/bench/force_qp/condensed.hpp"
#include "tests/bench/force_qp/peers.hpp"

extern "C" {
#include <api.h>
#include <utils.h>
}

namespace stance::bench {
namespace {

constexpr double kNone = 1e30;

class Daqp final : public Engine {
 public:
  Daqp(const Sequence& sequence, int num_stages)
      : condensed_(sequence, num_stages), m_(5 * condensed_.num_contacts()), n_(condensed_.num_variables()) {
    rows_ = friction_rows(condensed_, sequence.ticks.front().friction, 5);
    upper_.setZero(m_);
    lower_.setConstant(m_, -kNone);
    for (int c = 0; c < condensed_.num_contacts(); ++c) rows_(5 * c + 4, 3 * c + 2) = 1.0;
    take_bounds();
    sense_.assign(static_cast<std::size_t>(m_), 0);
    x_.assign(static_cast<std::size_t>(n_), 0.0);
    multipliers_.assign(static_cast<std::size_t>(m_), 0.0);
    problem_.n = n_;
    problem_.m = m_;
    problem_.H = condensed_.H.data();
    problem_.f = condensed_.q.data();
    problem_.A = rows_.data();
    problem_.bupper = upper_.data();
    problem_.blower = lower_.data();
    problem_.sense = sense_.data();
    result_.x = x_.data();
    result_.lam = multipliers_.data();
  }
  ~Daqp() override {
    if (!is_set_up_) return;
    free_daqp_workspace(&work_);
    free_daqp_ldp(&work_);
  }
  Daqp(const Daqp&) = delete;
  Daqp& operator=(const Daqp&) = delete;

  bool solve(const Problem& problem, bool matrices_changed) override {
    condensed_.update(problem, matrices_changed);
    if (matrices_changed) take_bounds();
    if (!is_set_up_) {
      is_set_up_ = true;
      if (setup_daqp(&problem_, &work_, nullptr) < 0) return false;
    } else if (matrices_changed) {
      std::copy_n(work_.sense, m_, sense_.begin());
      reset_daqp_workspace(&work_);
      daqp_update_ldp(DAQP_UPDATE_Rinv | DAQP_UPDATE_M | DAQP_UPDATE_v | DAQP_UPDATE_d | DAQP_UPDATE_sense, &work_,
                      &problem_);
    } else {
      daqp_update_ldp(DAQP_UPDATE_v | DAQP_UPDATE_d, &work_, &problem_);
    }
    daqp_solve(&result_, &work_);
    return result_.exitflag > 0;
  }
  void forces(const Problem& problem, std::vector<ForceVector>& out) const override {
    condensed_.forces(problem, x_.data(), out);
  }
  int iterations() const override { return result_.iter; }

 private:
  void take_bounds() {
    lower_(Eigen::seqN(4, condensed_.num_contacts(), 5)) = condensed_.lower;
    upper_(Eigen::seqN(4, condensed_.num_contacts(), 5)) = condensed_.upper;
  }

  Condensed condensed_;
  int m_, n_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows_;
  Eigen::VectorXd upper_, lower_;
  std::vector<int> sense_;
  std::vector<double> x_, multipliers_;
  DAQPProblem problem_{};
  DAQPWorkspace work_{};
  DAQPResult result_{};
  bool is_set_up_ = false;
};

}  // namespace

EngineKind daqp() {
  return {"daqp", "default settings, working set kept; where matrices change, reset and given again",
          &make_engine<Daqp>};
}

}  // namespace stance::bench
