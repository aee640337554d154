#pragma once
// The peers that were found when the benchmark was configured.
#include "tests/bench/force_qp/engine.hpp"

namespace stance::bench {

std::vector<EngineKind> peers();

// Each in its own file; there where peers.cmake says so.
EngineKind daqp();
EngineKind eiquadprog();
EngineKind qpoases();
EngineKind proxqp();
EngineKind piqp();
EngineKind hpipm();

}  // namespace stance::bench
