#pragma once
// The force QP by a dual active set over one Riccati factor: exact but for rounding. The faces that were active in the
// last solution are held in the factor itself, and only what changes of them makes work beyond the horizon's.
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
// Held faces G. The minimiser under c_i f = b_i, i in G, can be had at the cost of the free one: the faces held at a
//   contact leave f = t + T w, and within them recursion and sweep, from a nominal path on the faces, stand as they are
//   but for Quu^-1, in whose place there is
//
//     T (T'Quu T)^-1 T'        T = [kx 0 ex; 0 ky ey; 0 0 kz], k = 1 where no face fixes the component, else 0;
//                              ex = +-mu where fx = +-mu fz is held and kz = 1, else 0; ey likewise; T = 0 at fz = 0
//
//   Their multipliers follow from the gradient d = R (f - fref) + B'p: those of side faces are -+dx and -+dy, that of a
//   bound of fz is +-(mu (their sum) - dz). At fz = 0 all sides hold; those that d pushes against have the names.
//
// Changes E of G: constraints i added, and constraints r of G released. With s = (f | d + C_E'y) the solution is
//   s = s0 - sum_E u_e v_e from the minimiser s0 within G, and M u = N s0 - b, M = N V:
//
//               u                              column v, a sweep with                            row n, its bound b
//     added     its multiplier y_i             su = c_i at its own stage                         c_i f, b_i
//     released  how far it is off its face:    f = tau at its own stage, c_r tau = 1, all other  -tau'd, its
//               c_r f = b_r - u                faces of G still: su = -Quu tau, p -= Qux'tau     multiplier: 0
//
//   Eight columns go together in the lanes; four of a G, where seldom more are wanted at a time. They live as long as
//   their factor: where the matrices stay from solve to solve, eight more of the free one, which has no G, are taken
//   ahead in each.
//   M is symmetric, positive on what is added and negative on what is released: M = L S L', S = diag(+-1). Only L^-1 is
//   kept. Appending e adds a row: with g = N v_e and r = M^-1 g it is (-r', 1) / sqrt(|n_e v_e - g'r|). Dropping j
//   rotates rows until column j is zero but for one row, which goes: Givens rotations between equal signs, hyperbolic
//   ones between others.
//
//   1. Begin with the set of the last solve, moved to where each stage was then, and its multipliers. More than a few
//      constraints become G; else G is empty and E the set.
//   2. Ascend: from the multipliers, none of which is negative, towards those of the set's minimiser. The first to
//      reach zero on the way leaves the set, is dropped or released; again, until the minimiser is reached. While G is
//      empty, the first six times, all whose multipliers are negative there are dropped at once, until none is.
//   3. Where constraints are violated append all (at most 3 of a contact; of more than 32 those violated at least half
//      as much as the worst, 32 at most), with multipliers of zero, and go to 2. Where none can be, as each depends on
//      the set, a step of Goldfarb and Idnani (Math. Programming 27, 1983) for the worst: along it others reach zero
//      and leave.
//   4. Where E has become large, or rounding has spoilt L^-1, G becomes the set as it is, with its multipliers, E is
//      empty, and 2 goes on; the second time that a set is held, while more than 48 contacts have negative multipliers
//      in the minimiser within G, they let go of these at once.
//   5. Nothing is violated by more than 1e-10 m g (30 times that, where it does not go). What rounding has left of the
//   active constraints is taken out.
//
// Why it ends. In 2 sets only shrink. But for what is dropped or let go at once, which is counted, the dual objective
//   never falls: 2 moves towards its maximum over a set, 3 begins where 2 has ended, 4 keeps the multipliers. Where 2
//   has ended and something is violated, it rises with one of the appended constraints at least, or by a full step of
//   3: no set comes twice. 4 is done at most 30 times. Every problem that passes inspect() is feasible (f = fz_min
//   along z), so the dual is bounded. A budget ends it all the same.
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

/// The solver without inspection and check, which structured_engine.hpp puts around it: for problems that have passed
/// inspect().
class StructuredSolver {
 public:
  virtual ~StructuredSolver() = default;
  /// Takes A, B, Q, R, P, mu and the bounds over. False where the cost is not convex.
  virtual bool take_matrices(const Problem& problem) noexcept = 0;
  /// Takes x0, g and the references over.
  virtual void take_vectors(const Problem& problem) noexcept = 0;
  /// kSolved, or kMaxIterations where the budget or the numbers gave out.
  virtual QpStatus solve() noexcept = 0;
  /// Solves for what rounding has left of the gradient, under the active set that `solve` ended with.
  virtual void refine() noexcept = 0;
  /// To be called where the next problem has the same matrices: takes eight more columns.
  virtual void take_ahead() noexcept = 0;
  /// Rounds, and constraints that left the set on the way, of the last solve; 0 where the first guess was right.
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

}  // namespace stance::force_qp
