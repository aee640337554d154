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
        m_(4 * condensed_.num_contacts()),
        n_(condensed_.num_variables()),
        solver_(n_, m_, qpOASES::HST_POSDEF) {
    rows_.setZero(m_, n_);
    row_lower_.setConstant(m_, -kNone);
    row_upper_.setZero(m_);
    lower_.setConstant(n_, -kNone);
    upper_.setConstant(n_, kNone);
    x_.setZero(n_);
    for (int c = 0; c < condensed_.num_contacts(); ++c) {
      rows_.block<4, 3>(4 * c, 3 * c) = friction_faces(sequence.ticks.front().friction);
    }
    qpOASES::Options options;
    options.setToMPC();
    options.printLevel = qpOASES::PL_NONE;
    solver_.setOptions(options);
  }
  bool solve(const Problem& problem, bool matrices_changed) override {
    condensed_.update(problem, matrices_changed);
    if (matrices_changed) {
      for (int c = 0; c < condensed_.num_contacts(); ++c) {
        lower_(3 * c + 2) = condensed_.lower(c);
        upper_(3 * c + 2) = condensed_.upper(c);
      }
    }
    changes_ = kMaxChanges;
    bool solved = false;
    if (is_set_up_ && !matrices_changed) {
      solved = static_cast<qpOASES::QProblem&>(solver_).hotstart(condensed_.q.data(), lower_.data(), upper_.data(),
                                                                 row_lower_.data(), row_upper_.data(),
                                                                 changes_) == qpOASES::SUCCESSFUL_RETURN;
    } else if (is_set_up_) {
      solved = solver_.hotstart(condensed_.H.data(), condensed_.q.data(), rows_.data(), lower_.data(), upper_.data(),
                                row_lower_.data(), row_upper_.data(), changes_) == qpOASES::SUCCESSFUL_RETURN;
    }
    if (!solved) {
      solver_.reset();
      changes_ = kMaxChanges;
      solved = solver_.init(condensed_.H.data(), condensed_.q.data(), rows_.data(), lower_.data(), upper_.data(),
                            row_lower_.data(), row_upper_.data(), changes_) == qpOASES::SUCCESSFUL_RETURN;
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
  int m_, n_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows_;
  Eigen::VectorXd row_lower_, row_upper_, lower_, upper_, x_;
  qpOASES::SQProblem solver_;
  qpOASES::int_t changes_ = 0;
  bool is_set_up_ = false;
};

}  // namespace

EngineKind qpoases() { return {"qpoases", "setToMPC, hot-started, cold where that fails", &make_engine<QpOases>}; }

}  // namespace stance::bench
