// PIQP: proximal interior point on the condensed problem, dense. An interior point has no warm start.
#include <limits>
#include <piqp/piqp.hpp>

#include "tests/bench/force_qp/condensed.hpp"
#include "tests/bench/force_qp/peers.hpp"

namespace stance::bench {
namespace {

constexpr double kAccuracy = 1e-9;

class Piqp final : public Engine {
 public:
  Piqp(const Sequence& sequence, int num_stages)
      : condensed_(sequence, num_stages),
        boxed_(condensed_, sequence.ticks.front().friction, std::numeric_limits<double>::infinity()) {
    auto& settings = solver_.settings();
    settings.eps_abs = kAccuracy;
    settings.eps_rel = 0.0;
    settings.eps_duality_gap_abs = kAccuracy;
    settings.eps_duality_gap_rel = 0.0;
    settings.preconditioner_reuse_on_update = true;
  }
  bool solve(const Problem& problem, bool matrices_changed) override {
    condensed_.update(problem, matrices_changed);
    if (matrices_changed) boxed_.take_bounds(condensed_);
    using ::piqp::nullopt;
    if (!is_set_up_) {
      is_set_up_ = true;
      solver_.setup(condensed_.H, condensed_.q, nullopt, nullopt, boxed_.C, nullopt, boxed_.C_upper, boxed_.lower,
                    boxed_.upper);
    } else if (matrices_changed) {
      solver_.update(condensed_.H, condensed_.q, nullopt, nullopt, nullopt, nullopt, nullopt, boxed_.lower,
                     boxed_.upper);
    } else {
      solver_.update(nullopt, condensed_.q);
    }
    return solver_.solve() == ::piqp::PIQP_SOLVED;
  }
  void forces(const Problem& problem, std::vector<ForceVector>& out) const override {
    condensed_.forces(problem, solver_.result().x.data(), out);
  }
  int iterations() const override { return static_cast<int>(solver_.result().info.iter); }

 private:
  Condensed condensed_;
  Boxed boxed_;
  ::piqp::DenseSolver<double> solver_;
  bool is_set_up_ = false;
};

}  // namespace

EngineKind piqp() { return {"piqp", "dense, eps 1e-9 with the duality gap, scaling kept", &make_engine<Piqp>}; }

}  // namespace stance::bench
