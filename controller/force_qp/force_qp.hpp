#pragma once
// The force QP: over N stages, states x_1..x_N (12) and forces f_0..f_(N-1) (3 per contact),
//
//   min  sum_k ||x_k - xref_k||^2_Q + ||f_k - fref_k||^2_R     (the last state weighs P instead of Q where P is given)
//   s.t. x_(k+1) = A_k x_k + B_k f_k + g_k
//        |fx|, |fy| <= mu fz,   fz_min <= fz <= fz_max         for each contact and stage; fz_max = 0 in swing
//
// A and B have the structure of centroidal.hpp. Sizes and sparsity are frozen at set-up: a contact change alters bounds
// and values, never dimensions. What the engines do is told in structured_engine.hpp and osqp_engine.hpp.
#include <memory>
#include <vector>

#include "controller/centroidal/centroidal.hpp"

namespace stance::force_qp {

using centroidal::Dynamics;
using centroidal::ForceVector;
using centroidal::StateMatrix;
using centroidal::StateVector;

struct Sizes {
  int num_stages = 1;    ///< N
  int num_contacts = 2;  ///< n
};

/// One stage k: from x_k to x_(k+1).
struct StageData {
  Dynamics dynamics;
  StateVector x_ref = StateVector::Zero();    ///< reference of x_(k+1)
  ForceVector f_ref;                          ///< N, 3n
  StateVector Q = StateVector::Zero();        ///< diagonal, on x_(k+1)
  ForceVector R;                              ///< diagonal, 3n, positive
  std::array<double, kMaxContacts> fz_min{};  ///< N
  std::array<double, kMaxContacts> fz_max{};  ///< N
};

struct Problem {
  explicit Problem(Sizes with);  ///< takes all memory
  Sizes sizes;
  StateVector x0 = StateVector::Zero();
  double friction = 0.0;          ///< mu, of every contact
  std::vector<StageData> stages;  ///< N
  bool has_terminal_cost = false;
  StateMatrix terminal_cost = StateMatrix::Zero();  ///< P, symmetric positive semidefinite
};

struct Solution {
  explicit Solution(Sizes sizes);
  QpStatus status = QpStatus::kNotRun;
  QpEngine engine = QpEngine::kOsqpCondensed;
  int iterations = 0;               ///< of the engine; 0 where what it began with is the solution
  double primal_residual = 0.0;     ///< N, largest violation of a force constraint
  double dual_residual = 0.0;       ///< N, largest step of a projected gradient (see kkt.hpp)
  int active = 0;                   ///< constraints active in stage 0
  std::vector<ForceVector> forces;  ///< f_0..f_(N-1), N in W
  std::vector<StateVector> states;  ///< x_1..x_N
};

struct Settings {
  QpEngine engine = QpEngine::kOsqpCondensed;
  double tolerance = 1e-6;           ///< OSQP's eps_abs and eps_rel, on the scaled problem
  int max_iterations = 1000;         ///< in one solve: a deterministic bound
  int fallback_iterations = 200;     ///< of OSQP after `structured` has failed, in the same tick; 0: OSQP is not asked
  int check_interval = 10;           ///< iterations between OSQP's termination checks
  double rho = 1.0;                  ///< OSQP's, to start with
  double max_primal_residual = 0.5;  ///< N, above it a solution is kInaccurate
  double max_dual_residual = 2.0;    ///< N, above it a solution is kInaccurate
  bool try_free_minimiser = true;    ///< step 1 of osqp_engine.hpp
  bool correct_active_set = true;    ///< step 3 of osqp_engine.hpp
  void validate() const;             ///< throws std::invalid_argument naming the field, its value and the range
};

/// An engine. `solve` is noexcept, allocates nothing, never blocks and gives the same bits for the same sequence of
/// problems.
class ForceQp {
 public:
  virtual ~ForceQp() = default;
  /// Forces of `problem` into `solution`; forces are usable only where the status is kSolved. Warm-starts from the last
  /// solve. `time_left` [s], to the deadline of whoever asks, bounds a second engine's iterations; nobody reads a
  /// clock.
  virtual QpStatus solve(const Problem& problem, Solution& solution, double time_left) noexcept = 0;
  /// With a whole control period left.
  QpStatus solve(const Problem& problem, Solution& solution) noexcept {
    return solve(problem, solution, kControlPeriod);
  }
  /// Forgets the last solve: the next starts cold.
  virtual void reset() noexcept = 0;
};

/// Makes the engine of `settings` for problems of `sizes`, all memory taken and one throw-away solve done.
/// `typical_force` [N], m g, scales the forces. Throws std::invalid_argument on bad settings.
std::unique_ptr<ForceQp> make_force_qp(const Settings& settings, Sizes sizes, double typical_force);

}  // namespace stance::force_qp
