#pragma once
// The force QP by a dual active set over one Riccati factor: exact but for rounding, in work that is linear in the
// horizon as long as few constraints are active; where many are, by revisions of whole sets, each linear in the
// horizon.
//
// Stages k = 0..N-1, x = (pose | rate) with pose = (theta | p) and rate = (omega | v), forces f = (f_1 .. f_n):
//
//   pose+ = pose + diag(D, E) rate              D: dt Rz', E: dt I            A = [I D; C I] in 6 x 6 blocks
//   rate+ = rate + [C p; 0] + Bv f + g          C: the coupling term          B = [0; Bv]
//
// Factor. The cost-to-go of the problem without constraints, z'P z with P_N the terminal cost or Q, backwards:
//
//   Quu = R + B'P B        Qux = B'P A        K = Quu^-1 Qux        P <- Q + A'P A - K'Qux
//
//   P is kept in four 6 x 6 blocks, and every product uses the blocks of A and B. Quu^-1 is explicit, from 3 x 3
//   cofactors.
//
// Sweep. The free minimiser u0, as a step from a nominal path x_k, f_k with z_k = x_k - xref_k (f = fref to begin
// with):
//
//   p_N = P_N z_N     su = B'p + R (f - fref)     kf = Quu^-1 su     p <- A'p - K'su + Q z     step = -kf - K dx
//
// Columns. With H the Hessian of the condensed problem and c_i f <= b_i its constraints, v_i = H^-1 c_i is the sweep
//   with su = c_i at the constraint's own stage and zero elsewhere; eight constraints go together, in the lanes.
//   They live as long as the factor: where the matrices stay from solve to solve, eight more are taken ahead in each.
//
// Active set A. The minimiser under c_i f = b_i, i in A, is u = u0 - sum_A y_i v_i with M y = C_A u0 - b_A,
//   M = C_A H^-1 C_A' = L L'. Only L^-1 is kept. Appending i adds a row: with g = C_A v_i and r = M^-1 g it is
//   (-r', 1) / sqrt(c_i v_i - g'r). Dropping j rotates rows until column j is zero but for one row, which goes.
//
//   1. Begin with the set of the last solve, moved to where each stage was then; append what depends on nothing
//      appended yet, and drop negative multipliers until there are none.
//   2. Up to 6 passes, each where at most 16 constraints are violated: append all (at most 3 of a contact), drop
//      negative multipliers.
//   3. Steps of Goldfarb and Idnani (Math. Programming 27, 1983): the most violated constraint i becomes active;
//      direction r = M^-1 C_A v_i for the multipliers, full step to c_i u = b_i, or a partial one to where the first
//      multiplier of A reaches zero, whose constraint is dropped. Until nothing is violated by more than 1e-10 m g.
//   4. What rounding has left of the active constraints is taken out.
//
// Held faces. The work above grows with the square of A. The minimiser under c_i f = b_i can be had at the cost of a
//   factor, whatever A is: the faces held at a contact leave f = t + T w, and within them recursion and sweep, from a
//   nominal path on the faces, stand as they are but for Quu^-1, in whose place there is
//
//     T (T'Quu T)^-1 T'        T = [kx 0 ex; 0 ky ey; 0 0 kz], k = 1 where no face fixes the component, else 0;
//                              ex = +-mu where fx = +-mu fz is held and kz = 1, else 0; ey likewise; T = 0 at fz = 0
//
//   The multipliers follow from the gradient d = R (f - fref) + B'p of the minimiser: those of side faces are -+dx and
//   -+dy, that of a bound of fz is +-(mu (their sum) - dz).
//
//   0. With more than 80 constraints to begin with, on two feet or more, and before 1 to 3: hold them, solve, let go of
//      what has a negative multiplier, hold what is violated, factor again from the last stage that has changed back:
//      a Newton method for the optimality conditions (Hintermueller, Ito and Kunisch, SIAM J. Optim. 13, 2003), which
//      may cycle. From the 7th revision on only the first contact that is to change and three in four of the others
//      may, others each time, which breaks most cycles. Where there is nothing to revise it is the solution; after 40
//      revisions 1 to 3 begin from where 0 began, with the budget that is left.
//
// Why it ends. Revisions in 0 are counted. Dropping in 1 and 2 shrinks a finite set, and passes are counted. Both leave
//   the minimiser under A with no negative multiplier: a state that 3 may start from. Each full step of 3 raises the
//   dual objective strictly, so no set comes twice; between two of them are no more partial ones than active
//   constraints. Every problem that passes inspect() is feasible (f = fz_min along z), so the dual is bounded. A budget
//   ends it all the same.
//
// Contacts in swing take no part: each stage has as many inputs as it has contacts in stance.
//
// No call allocates after set-up. The arithmetic is compiled for AVX-512, for AVX2 and for any machine; the machine
// chooses when the engine is made. All three give the same bits.
#include <memory>
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

enum class Simd : std::int8_t { kPortable = 0, kAvx2 = 1, kAvx512 = 2 };
/// The paths that this machine has, the fastest last.
const std::vector<Simd>& available_simd();
const char* name(Simd simd) noexcept;

/// The solver without inspection and certificate: for problems that have passed inspect(). Engines are made by
/// make_force_qp.
class StructuredSolver {
 public:
  virtual ~StructuredSolver() = default;
  /// Takes A, B, Q, R, P, mu and the bounds over, and factors. False where the cost is not convex.
  virtual bool take_matrices(const Problem& problem) noexcept = 0;
  /// Takes x0, g and the references over.
  virtual void take_vectors(const Problem& problem) noexcept = 0;
  /// kSolved, or kMaxIterations where the budget or the numbers gave out.
  virtual QpStatus solve() noexcept = 0;
  /// Solves for what rounding has left of the gradient, under the active set that `solve` ended with.
  virtual void refine() noexcept = 0;
  /// To be called where the next problem has the same matrices: takes eight more columns.
  virtual void take_ahead() noexcept = 0;
  /// Revisions, passes and steps of the last solve; 0 where the first guess was right.
  virtual int iterations() const noexcept = 0;
  /// Whether the last solve held faces in its factor.
  virtual bool holds() const noexcept = 0;
  /// f_0..f_(N-1), N, of the last solve; exactly zero in swing.
  virtual void forces(std::vector<ForceVector>& out) const noexcept = 0;
  /// The next solve starts from no active constraint.
  virtual void reset() noexcept = 0;
};

/// `typical_force` [N] scales what counts as violated. Takes all memory.
std::unique_ptr<StructuredSolver> make_structured_solver(Sizes sizes, double typical_force, int max_iterations,
                                                         Simd simd = available_simd().back());

/// The engine: inspection, solver, independent check. What the check finds not exact is refined; where that does not
/// help, or the solver gives up, OSQP solves the same problem in at most `settings.fallback_iterations` and what the
/// time left affords (osqp_engine.hpp), and the solution says that it was OSQP. Where OSQP fails too, the status is
/// OSQP's; where it may not begin, it is the solver's. A problem that inspection refuses reaches neither.
std::unique_ptr<ForceQp> make_structured_engine(const Settings& settings, Sizes sizes, double typical_force,
                                                Simd simd = available_simd().back());
/// The same around any solver: what the engine trusts is the check.
std::unique_ptr<ForceQp> make_structured_engine(const Settings& settings, Sizes sizes, double typical_force,
                                                std::unique_ptr<StructuredSolver> solver);

}  // namespace stance::force_qp
