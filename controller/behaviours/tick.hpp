#pragma once
// What the behaviours that end in a force QP say of a tick.
#include "controller/force_qp/force_qp.hpp"

namespace stance::behaviours {

/// The centroidal state and its reference, in W.
struct TickState {
  CentroidalState x = CentroidalState::Zero();
  CentroidalState x_ref = CentroidalState::Zero();
};

/// [s] that one tick integrates over, after `periods` control periods: no more than ten.
constexpr double tick_duration(int periods) noexcept { return kControlPeriod * (periods < 10 ? periods : 10); }

/// Writes a solve into the trace.
inline void note(const force_qp::Solution& solution, Trace& trace) noexcept {
  trace.qp_engine = solution.engine;
  trace.qp_status = solution.status;
  trace.qp_iterations = solution.iterations;
  trace.qp_primal_residual = solution.primal_residual;
  trace.qp_dual_residual = solution.dual_residual;
  trace.qp_active = solution.active;
}

}  // namespace stance::behaviours
