#pragma once
// The force QP with a given set of active constraints: an unconstrained linear-quadratic problem, solved exactly by one
// backward recursion. It gives the free minimiser (no friction face and no bound active) and refines what a first-order
// solver has found.
//
// The constraints that are active at a contact fix some of its three components as functions of the others:
//
//   f_k = T_k w_k + t_k     fx = +mu fz:  T = [0 0 mu; 0 1 0; 0 0 1],  t = 0
//                           fz = fz_max:  T = [1 0 0; 0 1 0; 0 0 0],   t = (0, 0, fz_max)
//
// T's columns are orthogonal, and a column of zeros with a weight of one stands for a component that is gone, so that
// sizes stay fixed. With z_k = x_k - xref_k, z_0 = 0, the cost-to-go (z' S z)/2 + s' z, and B for B T:
//
//   V = S_(k+1) + Q              Quu = T'RT + B'VB                 Qux = B'VA
//   K = Quu^-1 Qux               S_k = A'VA - K' Qux
//   d = A xref_k + B t + g - xref_(k+1)
//   h = V d + s_(k+1)            su = B'h + T'R (t - fref)         kf = Quu^-1 su
//   s_k = A'h - K' su            forward: w = -kf - K z
//
// A = [I 0 D 0; 0 I 0 E; 0 C I 0; 0 0 0 I] and B = [0; Bv], as centroidal.hpp has them; every product uses it.
#include <Eigen/Cholesky>
#include <array>
#include <cstdint>
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

/// Which constraints hold as equalities at a contact.
struct ContactActivity {
  std::int8_t x = 0;  ///< fx = x mu fz where not 0
  std::int8_t y = 0;  ///< fy = y mu fz where not 0
  std::int8_t z = 0;  ///< -1: fz = fz_min, +1: fz = fz_max
  friend bool operator==(const ContactActivity&, const ContactActivity&) = default;
};
using StageActivity = std::array<ContactActivity, kMaxContacts>;
using Activity = std::vector<StageActivity>;

/// Nothing active but what the bounds fix: swing contacts, and normal forces with fz_min = fz_max.
void activity_of_bounds(const Problem& problem, Activity& activity) noexcept;

/// The next set for a contact with force `f` and gradient `d`, by the signs of the multipliers of what is active and
/// the violation of what is not. `f_tolerance` [N] and `d_tolerance` are what counts as zero.
ContactActivity next_activity(const ContactActivity& now, const Vector3& f, const Vector3& d, double friction,
                              double fz_min, double fz_max, double f_tolerance, double d_tolerance) noexcept;

/// W A, for W with 12 columns.
template <typename W>
void times_A(const StateMatrix& A, W& w) noexcept {
  w.template middleCols<3>(9).noalias() += w.template middleCols<3>(3).lazyProduct(A.block<3, 3>(3, 9));
  w.template middleCols<3>(3).noalias() += w.template middleCols<3>(6).lazyProduct(A.block<3, 3>(6, 3));
  w.template middleCols<3>(6).noalias() += w.template leftCols<3>().lazyProduct(A.block<3, 3>(0, 6));
}

template <int NU>
class ActiveSetProblem {
 public:
  explicit ActiveSetProblem(Sizes sizes);  ///< takes all memory
  /// The backward recursion of the matrices. Stages after `last` keep what they have: their sets and data are as
  /// before. False where Quu is not positive definite.
  bool factor(const Problem& problem, const Activity& activity, int last) noexcept;
  /// The forces that minimise the cost under the factored set.
  void solve(const Problem& problem, std::vector<ForceVector>& forces) noexcept;

 private:
  using Input = Eigen::Matrix<double, NU, 1>;
  using VelocityInput = Eigen::Matrix<double, 6, NU>;
  struct Stage {
    std::array<Matrix3, NU / 3> T;  ///< diagonal blocks, one a contact
    Input t;                        ///< N
    VelocityInput B;                ///< rows 6..11 of B T
    StateMatrix V;
    Eigen::LLT<Eigen::Matrix<double, NU, NU>> Quu;
    Eigen::Matrix<double, NU, 12> K;
    Input kf;
  };
  std::vector<Stage> stages_;
};

}  // namespace stance::force_qp
