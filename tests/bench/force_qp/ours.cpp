#include "controller/force_qp/structured/structured.hpp"
#include "tests/bench/force_qp/engine.hpp"
#include "tests/bench/force_qp/peers.hpp"

namespace stance::bench {
namespace {

using namespace force_qp;

/// The solver alone, as the peers are: no inspection, no check.
template <Simd simd>
class Structured final : public Engine {
 public:
  Structured(const Sequence& sequence, int num_stages)
      : solver_(make_structured_solver({num_stages, sequence.ticks.front().sizes.num_contacts}, sequence.typical_force,
                                       Settings{}.max_iterations, simd)) {}
  bool solve(const Problem& problem, bool matrices_changed) override {
    if (matrices_changed) {
      if (!solver_->take_matrices(problem)) return false;
    } else {
      solver_->take_ahead();
    }
    solver_->take_vectors(problem);
    return solver_->solve() == QpStatus::kSolved;
  }
  void forces(const Problem&, std::vector<ForceVector>& out) const override { solver_->forces(out); }
  int iterations() const override { return solver_->iterations(); }

 private:
  std::unique_ptr<StructuredSolver> solver_;
};

/// An engine as the controller uses it: inspection, check and all.
template <QpEngine which, bool alone = false>
class Certified final : public Engine {
 public:
  Certified(const Sequence& sequence, int num_stages)
      : solution_({num_stages, sequence.ticks.front().sizes.num_contacts}) {
    Settings settings;
    settings.engine = which;
    settings.try_free_minimiser = !alone;
    settings.correct_active_set = !alone;
    engine_ = make_force_qp(settings, {num_stages, sequence.ticks.front().sizes.num_contacts}, sequence.typical_force);
  }
  bool solve(const Problem& problem, bool) override { return engine_->solve(problem, solution_) == QpStatus::kSolved; }
  void forces(const Problem&, std::vector<ForceVector>& out) const override { out = solution_.forces; }
  int iterations() const override { return solution_.iterations; }

 private:
  std::unique_ptr<ForceQp> engine_;
  Solution solution_;
};

}  // namespace

const std::vector<EngineKind>& engine_kinds() {
  static const std::vector<EngineKind> kinds = [] {
    std::vector<EngineKind> all;
    for (const Simd simd : available_simd()) {
      if (simd == Simd::kPortable) continue;  // for its bits, not for its speed
      const bool wide = simd == Simd::kAvx512;
      all.push_back({wide ? "structured" : "structured-avx2", std::string("the solver alone, ") + name(simd),
                     wide ? &make_engine<Structured<Simd::kAvx512>> : &make_engine<Structured<Simd::kAvx2>>});
    }
    all.push_back({"structured-certified", "with inspection and KKT check, as in the controller",
                   &make_engine<Certified<QpEngine::kStructured>>});
    all.push_back({"osqp-condensed",
                   "OSQP 1.0 between our free minimiser and our correction of its set, as in the controller",
                   &make_engine<Certified<QpEngine::kOsqpCondensed>>});
    all.push_back({"osqp-sparse", "the same, sparse", &make_engine<Certified<QpEngine::kOsqpSparse>>});
    all.push_back({"osqp", "OSQP 1.0 alone, sparse, eps 1e-6, rho 1 (adaptive), check every 10",
                   &make_engine<Certified<QpEngine::kOsqpSparse, true>>});
    for (EngineKind& kind : peers()) all.push_back(std::move(kind));
    return all;
  }();
  return kinds;
}

}  // namespace stance::bench
