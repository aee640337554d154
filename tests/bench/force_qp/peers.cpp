#include "tests/bench/force_qp/peers.hpp"

namespace stance::bench {

std::vector<EngineKind> peers() {
  return {
#ifdef STANCE_BENCH_DAQP
      daqp(),
#endif
#ifdef STANCE_BENCH_EIQUADPROG
      eiquadprog(),
#endif
#ifdef STANCE_BENCH_QPOASES
      qpoases(),
#endif
#ifdef STANCE_BENCH_PROXQP
      proxqp(),
#endif
#ifdef STANCE_BENCH_PIQP
      piqp(),
#endif
#ifdef STANCE_BENCH_HPIPM
      hpipm(),
#endif
  };
}

}  // namespace stance::bench
