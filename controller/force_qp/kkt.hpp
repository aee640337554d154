#pragma once
// The independent check of a force QP's solution: computed outside every solver, from the problem and the forces alone.
//
//   states     x_(k+1) = A_k x_k + B_k f_k + g_k
//   costates   lambda_N = P (x_N - xref_N), with Q for P where none is given;
//              lambda_k = Q (x_k - xref_k) + A_k^T lambda_(k+1)
//   gradient   d_k = R (f_k - fref_k) + B_k^T lambda_(k+1), of half the cost
//   residual   f - projection(f - d / min R) [N], each contact on its truncated friction pyramid
//
// The residual is zero at the solution and nowhere else. Where no constraint is active it is at least as large as the
// distance from f to the solution, both in the norm of each contact's min R.
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

struct Residuals {
  double primal = 0.0;  ///< N, largest violation of a friction face or of a bound
  double dual = 0.0;    ///< N, largest component of the residual
};

/// The nearest point to `f` of { |fx|, |fy| <= mu fz, fz_min <= fz <= fz_max }, which must not be empty.
Vector3 project_on_pyramid(const Vector3& f, double friction, double fz_min, double fz_max) noexcept;

/// Constraints of stage `stage` that `f` meets to within `tolerance` [N], contacts in swing left out.
int count_active(const Problem& problem, int stage, const ForceVector& f, double tolerance) noexcept;

class KktCheck {
 public:
  explicit KktCheck(Sizes sizes);  ///< takes all memory
  /// Rolls `forces` out into `states` and checks them. Both residuals are infinite where a number is not finite.
  Residuals evaluate(const Problem& problem, const std::vector<ForceVector>& forces,
                     std::vector<StateVector>& states) noexcept;
  /// lambda_(k+1), k = 0..N-1, of the last evaluation.
  const std::vector<StateVector>& costates() const { return costates_; }
  /// d_k of the last evaluation.
  const std::vector<ForceVector>& gradient() const { return gradient_; }

 private:
  std::vector<StateVector> costates_;
  std::vector<ForceVector> gradient_;
};

}  // namespace stance::force_qp
