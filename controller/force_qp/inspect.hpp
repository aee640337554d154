#pragma once
// What must hold of a problem before a solver may see it.
#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

/// kSolved where `problem` is fit to be solved by an engine for `sizes`; kInvalidProblem where a size is another, a
/// number is not finite, A or B have not the structure of centroidal.hpp, mu or R is not positive, Q is negative, P is
/// not symmetric, or fz_min > fz_max; kInfeasible where fz_max < 0.
[[nodiscard]] QpStatus inspect(const Problem& problem, Sizes sizes) noexcept;

/// Whether the two differ in A, B, Q, R, P, mu or a bound; the vectors x0, g and the references are left out.
[[nodiscard]] bool matrices_differ(const Problem& a, const Problem& b) noexcept;

}  // namespace stance::force_qp
