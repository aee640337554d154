#pragma once
// Kinematics of a tree of screws whose base stands still: poses by the product of exponentials, Jacobians, and
// velocities both ways. Nothing here allocates or throws.
//
// With T_(i,p) of screw_tree.hpp along the chain 0, 1, .. n that carries a tip, the product of exponentials is
//   T_(0,tip) = M_(0,1) exp([A_1] theta_1) M_(1,2) exp([A_2] theta_2) .. T_(n,tip)                        (4.14, 8.50)
// and its derivative is V = J thetad, V = (omega, v): the body Jacobian J_b has its twist in the tip's frame (5.18),
// the space Jacobian J_s = Ad_T J_b in the base's (5.11). Columns are the tree's joints; those off the chain are zero.
// Reference: Lynch and Park, Modern Robotics (2017), chapters 4 to 6.
#include <Eigen/QR>
#include <array>

#include "controller/rigid_body/screw_tree.hpp"

namespace stance::rigid_body {

/// Shape 6 x n, angular rows first.
using JointJacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxJoints>;

/// T_(0,tip): coordinates in the tip's frame to those in the base's frame of the tree.
RigidTransform tip_pose(const ScrewTree& tree, const Tip& tip, const JointVector& theta) noexcept;

/// J_b, and T_(0,tip).
RigidTransform body_jacobian(const ScrewTree& tree, const Tip& tip, const JointVector& theta,
                             JointJacobian& J_b) noexcept;

/// J_s, and T_(0,tip).
RigidTransform space_jacobian(const ScrewTree& tree, const Tip& tip, const JointVector& theta,
                              JointJacobian& J_s) noexcept;

/// Of a pivot of J over its largest: below it a direction counts as lost.
inline constexpr double kRankTolerance = 1e-12;

/// An x of least |A x - b|, with no more than rank(A) entries that are not zero: by the QR's rank, where Eigen's own
/// solve divides by pivots of rounding, too.
template <typename Matrix, typename Vector>
auto basic_solution(const Eigen::ColPivHouseholderQR<Matrix>& qr, const Vector& b) noexcept {
  const auto rank = qr.rank();
  Eigen::Matrix<double, Matrix::RowsAtCompileTime, 1, 0, Matrix::MaxRowsAtCompileTime, 1> turned =
      qr.householderQ().transpose() * b;
  auto solved = turned.head(rank);
  qr.matrixR().topLeftCorner(rank, rank).template triangularView<Eigen::Upper>().solveInPlace(solved);
  using Solution = Eigen::Matrix<double, Matrix::ColsAtCompileTime, 1, 0, Matrix::MaxColsAtCompileTime, 1>;
  Solution x = Solution::Zero(qr.cols());
  x.head(rank) = solved;
  return Solution(qr.colsPermutation() * x);
}

/// The joint rates of least |J thetad - V|; where several are, the smallest of them (6.7). Jumps where J loses rank.
template <typename Derived>
auto inverse_velocity(const Eigen::MatrixBase<Derived>& J, const Vector6& V) noexcept {
  constexpr int kCols = Derived::ColsAtCompileTime, kMaxCols = Derived::MaxColsAtCompileTime;
  using Rates = Eigen::Matrix<double, kCols, 1, 0, kMaxCols, 1>;
  Eigen::ColPivHouseholderQR<typename Derived::PlainObject> of_columns(J);
  of_columns.setThreshold(kRankTolerance);
  const Rates any = basic_solution(of_columns, V);
  if (of_columns.rank() == J.cols()) return any;
  // What of it is normal to every row of J moves nothing.
  Eigen::ColPivHouseholderQR<Eigen::Matrix<double, kCols, 6, 0, kMaxCols, 6>> of_rows(J.transpose());
  of_rows.setThreshold(kRankTolerance);
  Rates normal = of_rows.householderQ().transpose() * any;
  normal.tail(J.cols() - of_rows.rank()).setZero();
  return Rates(of_rows.householderQ() * normal);
}

/// Those of least |J thetad - V|^2 + damping^2 |thetad|^2, for chains that come near singular poses: |thetad| is at
/// most |V| / (2 damping), and is continuous in J. `damping` > 0, in the unit of J.
template <typename Derived>
auto inverse_velocity(const Eigen::MatrixBase<Derived>& J, const Vector6& V, double damping) noexcept {
  constexpr int kCols = Derived::ColsAtCompileTime, kMaxCols = Derived::MaxColsAtCompileTime;
  constexpr int kRows = kCols == Eigen::Dynamic ? Eigen::Dynamic : 6 + kCols;
  Eigen::Matrix<double, kRows, kCols, 0, 6 + kMaxCols, kMaxCols> stacked(6 + J.cols(), J.cols());
  stacked.template topRows<6>() = J;
  stacked.bottomRows(J.cols()).setZero();
  stacked.bottomRows(J.cols()).diagonal().setConstant(damping);
  Eigen::Matrix<double, kRows, 1, 0, 6 + kMaxCols, 1> rhs(6 + J.cols());
  rhs.setZero();
  rhs.template head<6>() = V;
  return Eigen::Matrix<double, kCols, 1, 0, kMaxCols, 1>(stacked.colPivHouseholderQr().solve(rhs));
}

}  // namespace stance::rigid_body
