#pragma once
// The force QP by the solver of structured/structured.hpp between inspection and the independent check of kkt.hpp. What
// the check finds not exact is refined; where that does not help, or the solver gives up, OSQP solves the same problem
// in at most `settings.fallback_iterations` and what the time left affords (osqp_engine.hpp), and the solution says
// that it was OSQP. Where OSQP fails too, the status is OSQP's; where it may not begin, it is the solver's. A problem
// that inspection refuses reaches neither.
#include "controller/force_qp/structured/structured.hpp"

namespace stance::force_qp {

std::unique_ptr<ForceQp> make_structured_engine(const Settings& settings, Sizes sizes, double typical_force,
                                                Simd simd = available_simd().back());
/// The same around any solver: what the engine trusts is the check.
std::unique_ptr<ForceQp> make_structured_engine(const Settings& settings, Sizes sizes, double typical_force,
                                                std::unique_ptr<StructuredSolver> solver);

}  // namespace stance::force_qp
