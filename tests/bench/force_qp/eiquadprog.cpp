// eiquadprog: Goldfarb and Idnani's dual active set on the condensed problem. It has no warm start.
#include <eiquadprog/eiquadprog-fast.hpp>

#include "tests/bench/force_qp/condensed.hpp"
#include "tests/bench/force_qp/peers.hpp"

namespace stance::bench {
namespace {

class Eiquadprog final : public Engine {
 public:
  Eiquadprog(const Sequence& sequence, int num_stages)
      : condensed_(sequence, num_stages), m_(6 * condensed_.num_contacts()), n_(condensed_.num_variables()) {
    rows_ = -friction_rows(condensed_, sequence.ticks.front().friction, 6);
    offset_.setZero(m_);
    equalities_.resize(0, n_);
    x_.setZero(n_);
    for (int c = 0; c < condensed_.num_contacts(); ++c) {
      rows_(6 * c + 4, 3 * c + 2) = 1.0;
      rows_(6 * c + 5, 3 * c + 2) = -1.0;
    }
    take_bounds();
    solver_.reset(static_cast<std::size_t>(n_), 0, static_cast<std::size_t>(m_));
    solver_.setMaxIter(5000);
  }
  bool solve(const Problem& problem, bool matrices_changed) override {
    condensed_.update(problem, matrices_changed);
    if (matrices_changed) take_bounds();
    const auto status = solver_.solve_quadprog(condensed_.H, condensed_.q, equalities_, no_offset_, rows_, offset_, x_);
    return status == eiquadprog::solvers::EIQUADPROG_FAST_OPTIMAL;
  }
  void forces(const Problem& problem, std::vector<ForceVector>& out) const override {
    condensed_.forces(problem, x_.data(), out);
  }
  int iterations() const override { return solver_.getIteratios(); }

 private:
  void take_bounds() {
    offset_(Eigen::seqN(4, condensed_.num_contacts(), 6)) = -condensed_.lower;
    offset_(Eigen::seqN(5, condensed_.num_contacts(), 6)) = condensed_.upper;
  }

  Condensed condensed_;
  int m_, n_;
  Eigen::MatrixXd rows_, equalities_;
  Eigen::VectorXd offset_, no_offset_, x_;
  eiquadprog::solvers::EiquadprogFast solver_;
};

}  // namespace

EngineKind eiquadprog() { return {"eiquadprog", "fast variant, cold", &make_engine<Eiquadprog>}; }

}  // namespace stance::bench
