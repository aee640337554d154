#pragma once
// What behaviours share of a tick.
#include "controller/force_qp/force_qp.hpp"

namespace stance::behaviours {

/// The centroidal state and its reference, in W.
struct TickState {
  CentroidalState x = CentroidalState::Zero();
  CentroidalState x_ref = CentroidalState::Zero();
};

/// Of the control periods since the last tick, how many one tick makes good.
constexpr int periods_made_good(int periods) noexcept { return periods < 10 ? periods : 10; }
/// [s] that one tick integrates over, after `periods` control periods.
constexpr double tick_duration(int periods) noexcept { return kControlPeriod * periods_made_good(periods); }

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
