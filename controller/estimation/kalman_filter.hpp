#pragma once
// The Kalman filter of document 001 for n states and m measurements, of fixed size: it never allocates.
//
//   predict   x = F x + B u          P = F P F^T + Q
//   update    y = z - H x            S = H P H^T + R       K = P H^T S^-1       nis = y^T S^-1 y
//             x = x + K y            P = (I - K H) P (I - K H)^T + K R K^T                             (Joseph's form)
//
//   x, Bu (n)     P, F, Q (n x n)     z, y (m)     H (m x n)     S, R (m x m)     K (n x m)
//
// Joseph's form is evaluated as two rank-m corrections, P1 = P - K (H P), then P1 - (P1 H^T) K^T + K R K^T: the same
// matrix for any K, errors of K of second order only, in O(n^2 m) operations instead of O(n^3).
//
// States may be considered only: a measurement that says something about them that is not to be believed leaves them
// alone (their rows of K are zero), and P says what is known without it (Schmidt, 1966).
//
// An error-state filter holds the nominal state outside: x is the error, zero before an update, z the residual. After
// the update its owner moves x into the nominal state and sets it to zero.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <utility>

namespace stance::estimation {

template <int n, int m>
class KalmanFilter {
 public:
  using State = Eigen::Matrix<double, n, 1>;
  using StateMatrix = Eigen::Matrix<double, n, n>;
  using Measurement = Eigen::Matrix<double, m, 1>;
  using MeasurementMatrix = Eigen::Matrix<double, m, n>;
  using MeasurementCovariance = Eigen::Matrix<double, m, m>;

  /// What a measurement says against the prediction.
  struct Innovation {
    Measurement y = Measurement::Zero();                      ///< unit of z
    MeasurementCovariance S = MeasurementCovariance::Zero();  ///< unit of z squared
    /// chi^2 of m degrees of freedom. NaN: S is not positive definite, or z or the filter is not finite.
    double nis = std::numeric_limits<double>::quiet_NaN();
  };

  State x = State::Zero();
  StateMatrix P = StateMatrix::Identity();

  void predict(const StateMatrix& F, const State& Bu, const StateMatrix& Q) noexcept {
    x = F * x + Bu;
    P = F * P * F.transpose() + Q;
    symmetrise();
  }

  /// P = F P F^T + diag(q) for an F that its owner knows how to multiply by: `multiply(M)` replaces M (n x n) by F M.
  template <class Multiply>
  void predict_covariance(const Multiply& multiply, const State& q) noexcept {
    multiply(P);
    P.transposeInPlace();
    multiply(P);
    P.diagonal() += q;
    symmetrise();
  }

  /// The innovation that `update` would use: for gates.
  Innovation innovation(const Measurement& z, const MeasurementMatrix& H,
                        const MeasurementCovariance& R) const noexcept {
    return innovation_of(z, H, R, StateTimesMeasurement(P.lazyProduct(H.transpose()))).first;
  }

  /// Takes the measurement z, which leaves the states of these indices alone. Changes nothing where the result's nis is
  /// NaN.
  template <class... Index>
  Innovation update(const Measurement& z, const MeasurementMatrix& H, const MeasurementCovariance& R,
                    Index... considered) noexcept {
    const StateTimesMeasurement PHt = P.lazyProduct(H.transpose());
    const auto [innovation, cholesky] = innovation_of(z, H, R, PHt);
    if (std::isnan(innovation.nis)) return innovation;
    StateTimesMeasurement K = cholesky.solve(PHt.transpose()).transpose();
    (K.row(considered).setZero(), ...);
    x += K * innovation.y;
    P -= K.lazyProduct(PHt.transpose());
    const StateTimesMeasurement right = K * R - P.lazyProduct(H.transpose());
    P += right.lazyProduct(K.transpose());
    symmetrise();
    return innovation;
  }

 private:
  using StateTimesMeasurement = Eigen::Matrix<double, n, m>;
  using Cholesky = Eigen::LLT<MeasurementCovariance>;

  std::pair<Innovation, Cholesky> innovation_of(const Measurement& z, const MeasurementMatrix& H,
                                                const MeasurementCovariance& R,
                                                const StateTimesMeasurement& PHt) const noexcept {
    Innovation innovation;
    innovation.y = z - H * x;
    innovation.S = H * PHt + R;
    const Cholesky cholesky(innovation.S);
    const double nis = innovation.y.dot(cholesky.solve(innovation.y));
    if (cholesky.info() == Eigen::Success && std::isfinite(nis)) innovation.nis = nis;
    return {innovation, cholesky};
  }

  void symmetrise() noexcept {
    for (int j = 1; j < n; ++j) {
      for (int i = 0; i < j; ++i) P(i, j) = P(j, i) = 0.5 * (P(i, j) + P(j, i));
    }
  }
};

}  // namespace stance::estimation
