#include "controller/calibration/calibration.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace stance::calibration {
namespace {

/// A point in a row.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxPoints, 3>;

/// The points' spread about their origin along their principal directions, smallest first.
Vector3 spread(const Points& points) noexcept {
  const Matrix3 scatter = points.transpose() * points;
  return Eigen::SelfAdjointEigenSolver<Matrix3>(scatter, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .cwiseMax(0.0)
      .cwiseSqrt();
}

/// How many directions the fit needs the points to spread in.
int directions_needed(Kind kind) noexcept { return kind == Kind::kRigid || kind == Kind::kPlanar ? 2 : 3; }

Matrix3 rotation(const Points& K, const Points& A) noexcept {
  const Matrix3 covariance = K.transpose() * A;
  const Eigen::JacobiSVD<Matrix3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3 VUt = svd.matrixV() * svd.matrixU().transpose();
  // Points in a plane fit a reflection as well.
  const Vector3 sign(1.0, 1.0, VUt.determinant() < 0.0 ? -1.0 : 1.0);
  return svd.matrixV() * sign.asDiagonal() * svd.matrixU().transpose();
}

Matrix3 least_squares(const Points& K, const Points& A) noexcept {
  // Column by column: the solver's workspace for several is on the heap.
  const Eigen::ColPivHouseholderQR<Points> qr(K);
  Matrix3 M;
  for (int row = 0; row < 3; ++row) M.row(row) = qr.solve(A.col(row)).transpose();
  return M;
}

/// The same of (x, y) alone.
Matrix3 least_squares_in_plane(const Points& K, const Points& A) noexcept {
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, Eigen::Dynamic, 2, 0, kMaxPoints, 2>> qr(K.leftCols<2>());
  Matrix3 M = Matrix3::Zero();
  for (int row = 0; row < 2; ++row) M.row(row).head<2>() = qr.solve(A.col(row)).transpose();
  return M;
}

Status refusal(Kind kind, std::span<const Vector3> p_K, std::span<const Vector3> p_A) noexcept {
  if (p_K.size() != p_A.size()) return Status::kUnequal;
  if (p_K.size() < (kind == Kind::kAffine ? 4U : 3U)) return Status::kTooFew;
  if (p_K.size() > kMaxPoints) return Status::kTooMany;
  const auto finite = [](const Vector3& p) { return p.allFinite(); };
  const bool all = std::all_of(p_K.begin(), p_K.end(), finite) && std::all_of(p_A.begin(), p_A.end(), finite);
  return all ? Status::kOk : Status::kNotFinite;
}

}  // namespace

Calibration calibrate(Kind kind, std::span<const Vector3> p_K, std::span<const Vector3> p_A) noexcept {
  Calibration out;
  out.status = refusal(kind, p_K, p_A);
  if (out.status != Status::kOk) return out;
  const auto n = static_cast<Eigen::Index>(p_K.size());
  Points K(n, 3), A(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    K.row(i) = p_K[i].transpose();
    A.row(i) = p_A[i].transpose();
  }
  if (kind == Kind::kPlanar) {
    K.col(2).setZero();
    A.col(2).setZero();
  }
  Eigen::RowVector3d K_mean = Eigen::RowVector3d::Zero(), A_mean = K_mean;
  if (kind != Kind::kLinear) {
    K_mean = K.colwise().mean();
    A_mean = A.colwise().mean();
    K.rowwise() -= K_mean;
    A.rowwise() -= A_mean;
  }
  const Vector3 spread_K = spread(K);
  if (!(spread_K(3 - directions_needed(kind)) > kLeastSpread * spread_K(2))) {
    out.status = Status::kDegenerate;
    return out;
  }
  const Matrix3 M = kind == Kind::kRigid    ? rotation(K, A)
                    : kind == Kind::kPlanar ? least_squares_in_plane(K, A)
                                            : least_squares(K, A);
  out.T << M, A_mean.transpose() - M * K_mean.transpose();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double residual = (A.row(i).transpose() - M * K.row(i).transpose()).norm();
    sum += residual * residual;
    if (residual <= out.worst) continue;
    out.worst = residual;
    out.worst_point = static_cast<int>(i);
  }
  out.rms = std::sqrt(sum / static_cast<double>(n));
  return out;
}

}  // namespace stance::calibration
