#pragma once
// A thrown ball from positions: document 001's filter (kalman_filter.hpp) with the process noise that a ball has.
//
//   pd = v     vd = g - k |v| v + w     kd = 0     z = p + r,  r ~ N(0, sigma^2 1),  w white of density q
//
// State (p, v) where the drag k is known (0: ballistic), (p, v, k) where it is estimated too; with drag_sigma = 0 the
// latter knows it as well, and is the former. One step h by the
// midpoint rule, exact without drag, and F its derivative:
//   v_m = v + h/2 a(v)     p+ = p + h v_m     v+ = v + h a(v_m),     a(v) = g - k |v| v
//   Q = q [h^3/3 1, h^2/2 1; h^2/2 1, h 1]
// The document's Q = 0.1 1 a step lets the velocity wander by 0.3 m/s each 10 ms, so that the filter believes the last
// few positions only and predicts nothing; its normalised innovations, far below 1, say so.
#include <optional>

#include "controller/estimation/kalman_filter.hpp"
#include "controller/math/so3.hpp"

namespace stance::estimation {

struct BallFilterConfig {
  double measurement_sigma = 0.0;           ///< m, of each axis of an observation
  double acceleration_density = 0.0;        ///< m^2/s^3, q
  double velocity_sigma = 0.0;              ///< m/s, of each axis at the first observation, about `velocity`
  Vector3 velocity = Vector3::Zero();       ///< m/s, expected at the first observation
  Vector3 gravity = {0.0, 0.0, -kGravity};  ///< m/s^2, in the frame of the observations
  double drag = 0.0;                        ///< 1/m, k; with estimated drag its mean at the start
  double drag_sigma = 0.0;                  ///< 1/m, of estimated drag at the start; 0 where it is known
  void validate() const;                    ///< throws std::invalid_argument naming the field, its value and the range
};

/// States: 6, or 7 with the drag estimated.
template <int n>
class BallFilter {
  static_assert(n == 6 || n == 7, "position and velocity, or those and the drag");

 public:
  using State = Eigen::Matrix<double, n, 1>;
  using StateMatrix = Eigen::Matrix<double, n, n>;

  /// The ball at an instant, in the frame of the observations.
  struct Estimate {
    State x = State::Zero();              ///< (p, v) [m, m/s], and k [1/m]
    StateMatrix P = StateMatrix::Zero();  ///< covariance of x

    Vector3 p() const noexcept { return x.template head<3>(); }
    Vector3 v() const noexcept { return x.template segment<3>(3); }
  };

  /// Throws what config.validate() throws; std::invalid_argument, too, where n = 6 and drag_sigma is not 0.
  explicit BallFilter(const BallFilterConfig& config);

  /// A camera frame a time `dt` (s, >= 0) after the last one; `z` [m], if the ball was seen. The first ball seen starts
  /// the filter. Returns the innovation's chi^2 over its 3 degrees of freedom (1 in the mean, where the model holds);
  /// NaN where nothing was compared: no ball, the first one, or a z that is no number.
  double step(double dt, const std::optional<Vector3>& z) noexcept;

  /// What step(dt, z) would return, for gates.
  double nis(double dt, const Vector3& z) const noexcept;

  bool has_started() const noexcept { return started_; }

  /// At the last frame. All zero before the first ball.
  Estimate estimate() const noexcept { return {filter_.x, filter_.P}; }

  /// A time `ahead` (s, >= 0) after the last frame.
  Estimate predict(double ahead) const noexcept;

  /// The next ball is another one.
  void reset() noexcept;

 private:
  using Filter = KalmanFilter<n, 3>;
  static typename Filter::MeasurementMatrix position() noexcept;
  void advance(Filter& filter, double dt) const noexcept;

  BallFilterConfig config_;
  Filter filter_;
  bool started_ = false;
};

extern template class BallFilter<6>;
extern template class BallFilter<7>;

}  // namespace stance::estimation
