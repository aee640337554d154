#pragma once
// Where the camera stands against the arm, from pairs of points: document 001. No allocation, no exceptions.
//
//   rigid    p_A = R p_K + t      R = V diag(1, 1, det(V U^T)) U^T of the covariance's U S V^T                (Kabsch)
//   affine   p_A = A p_K + t      least squares: a camera whose axes are scaled or skew
//   linear   p_A = A p_K          least squares: the document's T = P_A P_K^+, which cannot hold a translation
//   planar   p_A = A p_K + t      in the plane, (x, y) alone: the document's homogeneous form, third row ones
// Reference: Arun, Huang and Blostein, Least-squares fitting of two 3-D point sets, PAMI 9 (1987); Umeyama, PAMI 13
// (1991), for the sign.
#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "controller/math/so3.hpp"

namespace stance::calibration {

inline constexpr int kMaxPoints = 64;  ///< as calibration_points_t

/// Where the points' spread along their least direction that the fit needs falls below this share of their largest,
/// what the fit says of that direction is refused.
inline constexpr double kLeastSpread = 0.01;

enum class Kind : std::uint8_t { kRigid, kAffine, kLinear, kPlanar };

enum class Status : std::uint8_t {
  kOk,
  kUnequal,     ///< not as many points of one kind as of the other
  kTooFew,      ///< rigid, linear, planar: under 3; affine: under 4
  kTooMany,     ///< over kMaxPoints
  kNotFinite,   ///< a coordinate is no number
  kDegenerate,  ///< rigid, planar: nearly on a line; affine: nearly in a plane; linear: nearly in a plane with the
                ///< camera
};

struct Calibration {
  Status status = Status::kTooFew;
  /// [A t]: p_A = T (p_K, 1). Planar: its third row is zero and its third column counts for nothing. Zero unless kOk.
  Eigen::Matrix<double, 3, 4> T = Eigen::Matrix<double, 3, 4>::Zero();
  double rms = 0.0;     ///< m: root of the mean of |T (p_K, 1) - p_A|^2
  double worst = 0.0;   ///< m: the largest of these residuals
  int worst_point = 0;  ///< and whose it is

  Vector3 operator*(const Vector3& p_K) const noexcept { return T.leftCols<3>() * p_K + T.col(3); }
};

/// The fit to the pairs (p_K[i], p_A[i]) [m; p_K in pixels where planar].
[[nodiscard]] Calibration calibrate(Kind kind, std::span<const Vector3> p_K, std::span<const Vector3> p_A) noexcept;

}  // namespace stance::calibration
