// ProxQP: proximal augmented Lagrangian on the condensed problem, dense, warm-started with the last result.
#include <proxsuite/proxqp/dense/dense.hpp>

#include "tests/bench/force_qp/condensed.hpp"
#include "tests/bench/force_qp/peers.hpp"

namespace stance::bench {
namespace {

using namespace proxsuite;

constexpr double kAccuracy = 1e-9;
constexpr double kNone = 1e20;

class ProxQp final : public Engine {
 public:
  ProxQp(const Sequence& sequence, int num_stages)
      : condensed_(sequence, num_stages),
        boxed_(condensed_, sequence.ticks.front().friction, kNone),
        solver_(condensed_.num_variables(), 0, boxed_.C.rows(), true, proxqp::HessianType::Dense,
                proxqp::DenseBackend::Automatic) {
    solver_.settings.eps_abs = kAccuracy;
    solver_.settings.eps_rel = 0.0;
    solver_.settings.initial_guess = proxqp::InitialGuessStatus::WARM_START_WITH_PREVIOUS_RESULT;
  }
  bool solve(const Problem& problem, bool matrices_changed) override {
    condensed_.update(problem, matrices_changed);
    if (matrices_changed) boxed_.take_bounds(condensed_);
    if (!is_set_up_) {
      is_set_up_ = true;
      solver_.init(condensed_.H, condensed_.q, nullopt, nullopt, boxed_.C, boxed_.C_lower, boxed_.C_upper, boxed_.lower,
                   boxed_.upper);
    } else if (matrices_changed) {
      solver_.update(condensed_.H, condensed_.q, nullopt, nullopt, nullopt, nullopt, nullopt, boxed_.lower,
                     boxed_.upper, false);
    } else {
      solver_.update(nullopt, condensed_.q, nullopt, nullopt, nullopt, nullopt, nullopt, nullopt, nullopt, false);
    }
    solver_.solve();
    return solver_.results.info.status == proxqp::QPSolverOutput::PROXQP_SOLVED;
  }
  void forces(const Problem& problem, std::vector<ForceVector>& out) const override {
    condensed_.forces(problem, solver_.results.x.data(), out);
  }
  int iterations() const override { return static_cast<int>(solver_.results.info.iter); }

 private:
  Condensed condensed_;
  Boxed boxed_;
  proxqp::dense::QP<double> solver_;
  bool is_set_up_ = false;
};

}  // namespace

EngineKind proxqp() {
  return {"proxqp", "dense, automatic backend, eps_abs 1e-9, warm start with the previous result",
          &make_engine<ProxQp>};
}

}  // namespace stance::bench
