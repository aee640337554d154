#pragma once
// The force QP by OSQP, in either form, in three steps, each judged by the independent check of kkt.hpp:
//
//   1. The free minimiser, by one backward recursion: where it satisfies every constraint it is the solution.
//   2. OSQP, to a coarse and then to the full tolerance, from the free minimiser moved into the constraints and the
//      multipliers that the last solve ended with (fewer iterations than from the last forces, shifted or not).
//   3. After each of the two the minimiser under the constraints that OSQP finds active, the set corrected a bounded
//      number of times by the signs of the multipliers: where the check finds it exact it is the solution.
#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

/// An engine on OSQP, in the form that `settings.engine` names.
std::unique_ptr<ForceQp> make_osqp_engine(const Settings& settings, Sizes sizes, double typical_force);

}  // namespace stance::force_qp
