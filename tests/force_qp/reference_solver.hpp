#pragma once
// The force QP solved by other means, for tests: states eliminated by brute force, a primal-dual interior point in
// extended precision. Slow, without structure, and within 1e-7 N of the solution also where a constraint is only
// weakly active.
#include <Eigen/Cholesky>
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp::test {

/// f_0..f_(N-1) [N]. Throws std::runtime_error where it does not converge. Wants fz_min < fz_max in stance.
std::vector<ForceVector> reference_forces(const Problem& problem);

}  // namespace stance::force_qp::test
