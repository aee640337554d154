#pragma once
// The exact solution in extended precision, for the accuracy that the benchmark tells.
#include <Eigen/Cholesky>
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::bench {

/// Dense, states eliminated: a guess of the active set from forces near the solution, the equality-constrained problem
/// under it by Cholesky in long double, the set corrected until feasibility and multipliers hold to kCertified. Whoever
/// made the guess, what passes is the solution.
class Reference {
 public:
  static constexpr long double kCertified = 1e-10L;  ///< N, and of multipliers relative to the largest

  /// Empty where no set could be certified. `matrices_changed` as for the engines.
  std::vector<force_qp::ForceVector> solve(const force_qp::Problem& problem, bool matrices_changed,
                                           const std::vector<force_qp::ForceVector>& guess);

 private:
  using Real = long double;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  struct Constraint {
    Eigen::Index contact;
    int face;  ///< +x, -x, +y, -y, upper, lower
  };
  Matrix response_;  ///< of the states to the forces
  Eigen::LLT<Matrix> hessian_;
};

}  // namespace stance::bench
