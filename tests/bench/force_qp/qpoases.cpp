// qpOASES: the online active set strategy on the condensed problem, hot-started, with its options for MPC.
#include <qpOASES.hpp>

#include "tests/bench/force_qp/condensed.hpp"
#include "tests/bench/force_qp/peers.hpp"

namespace stance::bench {
namespace {

constexpr double kNone = 1e10;
constexpr int kMaxChanges = 5000;

class QpOases final : public Engine {
 public:
  QpOases(const Sequence& sequence, int num_stages)
      : condensed_(sequence, num_stages),
        boxed_(condensed_, sequence.ticks.front().friction, kNone),
        rows_(boxed_.C),
        x_(Eigen::VectorXd::Zero(condensed_.num_variables())),
        solver_(condensed_.num_variables(), static_cast<qpOASES::int_t>(rows_.rows()), qpOASES::HST_POSDEF) {
    qpOASES::Options options;
    options.setToMPC();
    options.printLevel = qpOASES::PL_NONE;
    solver_.setOptions(options);
  }
  bool solve(const Problem& problem, bool matrices_changed) override {
    condensed_.update(problem, matrices_changed);
    if (matrices_changed) boxed_.take_bounds(condensed_);
    changes_ = kMaxChanges;
    bool solved = false;
    if (is_set_up_ && !matrices_changed) {
      solved = static_cast<qpOASES::QProblem&>(solver_).hotstart(
                   condensed_.q.data(), boxed_.lower.data(), boxed_.upper.data(), boxed_.C_lower.data(),
                   boxed_.C_upper.data(), changes_) == qpOASES::SUCCESSFUL_RETURN;
    } else if (is_set_up_) {
      solved = solver_.hotstart(condensed_.H.data(), condensed_.q.data(), rows_.data(), boxed_.lower.data(),
                                boxed_.upper.data(), boxed_.C_lower.data(), boxed_.C_upper.data(),
                                changes_) == qpOASES::SUCCESSFUL_RETURN;
    }
    if (!solved) {
      solver_.reset();
      changes_ = kMaxChanges;
      solved =
          solver_.init(condensed_.H.data(), condensed_.q.data(), rows_.data(), boxed_.lower.data(), boxed_.upper.data(),
                       boxed_.C_lower.data(), boxed_.C_upper.data(), changes_) == qpOASES::SUCCESSFUL_RETURN;
      is_set_up_ = solved;
    }
    solver_.getPrimalSolution(x_.data());
    return solved;
  }
  void forces(const Problem& problem, std::vector<ForceVector>& out) const override {
    condensed_.forces(problem, x_.data(), out);
  }
  int iterations() const override { return static_cast<int>(changes_); }

 private:
  Condensed condensed_;
  Boxed boxed_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows_;
  Eigen::VectorXd x_;
  qpOASES::SQProblem solver_;
  qpOASES::int_t changes_ = 0;
  bool is_set_up_ = false;
};

}  // namespace

EngineKind qpoases() { return {"qpoases", "setToMPC, hot-started, cold where that fails", &make_engine<QpOases>}; }

}  // namespace stance::bench
