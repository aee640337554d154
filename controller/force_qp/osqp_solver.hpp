#pragma once
// OSQP 1.0 with its sparsity frozen:   min 1/2 x'P x + q'x   s.t.   l <= A x <= u
//
// Deterministic: rho adapts by iterations, never by time. Nothing allocates after the constructor. OSQP's own scaling
// is off: whoever fills the data scales it, so that nothing of an earlier problem survives in a later one.
#include <memory>
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

class OsqpSolver {
 public:
  struct Entry {
    int row = 0;
    int column = 0;
  };
  struct Outcome {
    QpStatus status = QpStatus::kNotRun;
    int iterations = 0;
  };

  /// `P` lists the upper triangle's entries. Throws std::runtime_error where OSQP refuses the set-up.
  OsqpSolver(int num_variables, int num_constraints, const std::vector<Entry>& P, const std::vector<Entry>& A,
             const Settings& settings);
  ~OsqpSolver();
  OsqpSolver(const OsqpSolver&) = delete;
  OsqpSolver& operator=(const OsqpSolver&) = delete;

  // The problem, to be filled by the caller; P and A in the order of the constructor's lists.
  std::vector<double> P, A, q, l, u;
  // The iterate to start from, and after `solve` the one that it ended with.
  std::vector<double> x, y;

  /// Hands P and A over. False where OSQP refuses them.
  bool update_matrices() noexcept;
  /// Hands q, l and u over. False where OSQP refuses them.
  bool update_vectors() noexcept;
  /// Runs from x and y to `tolerance` (absolute and relative), in `max_iterations` at most.
  Outcome solve(double tolerance, int max_iterations) noexcept;
  /// Back to the state after set-up.
  void reset() noexcept;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace stance::force_qp
