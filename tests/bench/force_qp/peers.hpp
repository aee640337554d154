#pragma once
// The peers that were found when the benchmark was configured.
#include "tests/bench/force_qp/engine.hpp"

namespace stance::bench {

std::vector<EngineKind> peers();

#ifdef STANCE_BENCH_DAQP
EngineKind daqp();
#endif
#ifdef STANCE_BENCH_CMEEL
EngineKind eiquadprog();
EngineKind qpoases();
EngineKind proxqp();
#endif
#ifdef STANCE_BENCH_PIQP
EngineKind piqp();
#endif
#ifdef STANCE_BENCH_HPIPM
EngineKind hpipm();
#endif

}  // namespace stance::bench
