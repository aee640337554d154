#pragma once
// What the benchmark measures: anything that solves a force QP.
#include <memory>
#include <string>
#include <vector>

#include "tests/bench/force_qp/sequence.hpp"

namespace stance::bench {

using force_qp::ForceVector;
using force_qp::Problem;

class Engine {
 public:
  virtual ~Engine() = default;
  /// Whether it claims to have solved. Assembly and update are its own, and are measured. `matrices_changed` is false
  /// where only x0, g and the references differ from the last problem: what every engine may be told.
  virtual bool solve(const Problem& problem, bool matrices_changed) = 0;
  /// f_0..f_(N-1), N, of the last solve; not measured.
  virtual void forces(const Problem& problem, std::vector<ForceVector>& out) const = 0;
  virtual int iterations() const = 0;
};

struct EngineKind {
  std::string name;
  std::string settings;  ///< as its authors advise, and told
  /// For the first `num_stages` stages of the sequence's ticks.
  std::unique_ptr<Engine> (*make)(const Sequence& sequence, int num_stages);
};

template <typename T>
std::unique_ptr<Engine> make_engine(const Sequence& sequence, int num_stages) {
  return std::make_unique<T>(sequence, num_stages);
}

/// Ours first; peers as far as they were there when the benchmark was configured.
const std::vector<EngineKind>& engine_kinds();

}  // namespace stance::bench
