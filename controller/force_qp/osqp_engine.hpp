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

class OsqpForceQp : public ForceQp {
 public:
  using ForceQp::solve;
  QpStatus solve(const Problem& problem, Solution& solution, double /*time_left*/) noexcept final {
    return solve_within(problem, solution, max_iterations_);
  }
  /// In at most `max_iterations` of OSQP, and no more than the settings' in any case.
  virtual QpStatus solve_within(const Problem& problem, Solution& solution, int max_iterations) noexcept = 0;

 protected:
  explicit OsqpForceQp(int max_iterations) : max_iterations_(max_iterations) {}
  int max_iterations_;
};

/// What may be asked of OSQP with `time_left` [s], so that it ends in time whatever it meets: 0 where that is less than
/// it takes to look whether it has converged.
///
///   iterations = (time_left - 1 ms - 50 us n N) / (0.7 us n N)        N stages, n contacts
///
/// 1 ms is for the rest of the tick. The others are upper bounds of what one call takes apart from its iterations (the
/// matrices, their factors, the corrections of the active set) and of an iteration with its share of new step sizes: on
/// one core of the reference machine the worst of 60 hard pushes at mu 0.2, matrices new, N = 10 to 100, n = 1, 2, 4,
/// took 22 us and 0.41 us. N = 22, n = 2: 219 iterations in 10 ms.
int affordable_iterations(const Settings& settings, Sizes sizes, double time_left) noexcept;

/// An engine on OSQP, in the form that `settings.engine` names.
std::unique_ptr<OsqpForceQp> make_osqp_engine(const Settings& settings, Sizes sizes, double typical_force);

}  // namespace stance::force_qp
