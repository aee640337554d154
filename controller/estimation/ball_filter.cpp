#include "controller/estimation/ball_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "controller/interface/require.hpp"

namespace stance::estimation {
namespace {

constexpr double kLongestStep = 0.01;  ///< s: the midpoint rule's error in a throw of 1 s is far below a millimetre

template <int n>
double drag_of(const BallFilterConfig& config, const Eigen::Matrix<double, n, 1>& x) noexcept {
  if constexpr (n == 7) {
    return x(6);
  } else {
    return config.drag;
  }
}

/// d(-k |v| v) / dv
Matrix3 drag_slope(double k, const Vector3& v) noexcept {
  const double speed = v.norm();
  if (!(speed > 0.0)) return Matrix3::Zero();
  return -k * (speed * Matrix3::Identity() + v * v.transpose() / speed);
}

}  // namespace

void BallFilterConfig::validate() const {
  const Require require{"ball."};
  const auto number = [&](double value, const char* field, double low, const char* range) {
    require(std::isfinite(value) && value >= low, field, value, range);
  };
  require(std::isfinite(measurement_sigma) && measurement_sigma > 0.0, "measurement_sigma", measurement_sigma,
          "above 0 m");
  number(acceleration_density, "acceleration_density", 0.0, "at least 0 m^2/s^3");
  require(std::isfinite(velocity_sigma) && velocity_sigma > 0.0, "velocity_sigma", velocity_sigma, "above 0 m/s");
  number(drag, "drag", 0.0, "at least 0 1/m");
  number(drag_sigma, "drag_sigma", 0.0, "at least 0 1/m");
  for (int i = 0; i < 3; ++i) {
    require(std::isfinite(velocity(i)), "velocity", velocity(i), "finite");
    require(std::isfinite(gravity(i)), "gravity", gravity(i), "finite");
  }
}

template <int n>
BallFilter<n>::BallFilter(const BallFilterConfig& config) : config_(config) {
  config.validate();
  if (n == 6) {
    Require{"ball."}(config.drag_sigma == 0.0, "drag_sigma", config.drag_sigma, "0 where the drag is not estimated");
  }
  reset();
}

template <int n>
void BallFilter<n>::reset() noexcept {
  started_ = false;
  filter_.x.setZero();
  filter_.P.setZero();
}

template <int n>
double BallFilter<n>::step(double dt, const std::optional<Vector3>& z) noexcept {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  const double variance = config_.measurement_sigma * config_.measurement_sigma;
  if (!started_) {
    if (!z || !z->allFinite()) return kNothing;
    filter_.x.template head<6>() << *z, config_.velocity;
    filter_.P.diagonal().template head<6>() << Vector3::Constant(variance),
        Vector3::Constant(config_.velocity_sigma * config_.velocity_sigma);
    if constexpr (n == 7) {
      filter_.x(6) = config_.drag;
      filter_.P(6, 6) = config_.drag_sigma * config_.drag_sigma;
    }
    started_ = true;
    return kNothing;
  }
  advance(filter_, dt);
  if (!z) return kNothing;
  return filter_.update(*z, position(), variance * Matrix3::Identity()).nis / 3.0;
}

template <int n>
double BallFilter<n>::nis(double dt, const Vector3& z) const noexcept {
  if (!started_) return std::numeric_limits<double>::quiet_NaN();
  Filter filter = filter_;
  advance(filter, dt);
  const double variance = config_.measurement_sigma * config_.measurement_sigma;
  return filter.innovation(z, position(), variance * Matrix3::Identity()).nis / 3.0;
}

/// H
template <int n>
typename BallFilter<n>::Filter::MeasurementMatrix BallFilter<n>::position() noexcept {
  typename Filter::MeasurementMatrix H = Filter::MeasurementMatrix::Zero();
  H.template leftCols<3>().setIdentity();
  return H;
}

template <int n>
typename BallFilter<n>::Estimate BallFilter<n>::predict(double ahead) const noexcept {
  Filter filter = filter_;
  if (started_) advance(filter, ahead);
  return {filter.x, filter.P};
}

template <int n>
void BallFilter<n>::advance(Filter& filter, double dt) const noexcept {
  const int steps = std::max(1, static_cast<int>(std::ceil(dt / kLongestStep - 1e-9)));
  const double h = dt / steps;
  StateMatrix Q = StateMatrix::Zero();
  const double q = config_.acceleration_density;
  Q.template topLeftCorner<3, 3>().diagonal().setConstant(q * h * h * h / 3.0);
  Q.template block<3, 3>(0, 3).diagonal().setConstant(q * h * h / 2.0);
  Q.template block<3, 3>(3, 0).diagonal().setConstant(q * h * h / 2.0);
  Q.template block<3, 3>(3, 3).diagonal().setConstant(q * h);
  for (int i = 0; i < steps; ++i) {
    const double k = drag_of<n>(config_, filter.x);
    const Vector3 v = filter.x.template segment<3>(3);
    const auto acceleration = [&](const Vector3& at) -> Vector3 { return config_.gravity - k * at.norm() * at; };
    const Vector3 v_m = v + 0.5 * h * acceleration(v);
    State next = filter.x;
    next.template head<3>() += h * v_m;
    next.template segment<3>(3) += h * acceleration(v_m);

    const Matrix3 slope_m = drag_slope(k, v_m);
    const Matrix3 dv_m = Matrix3::Identity() + 0.5 * h * drag_slope(k, v);
    StateMatrix F = StateMatrix::Identity();
    F.template block<3, 3>(0, 3) = h * dv_m;
    F.template block<3, 3>(3, 3) += h * slope_m * dv_m;
    if constexpr (n == 7) {
      const Vector3 dv_m_dk = -0.5 * h * v.norm() * v;
      F.template block<3, 1>(0, 6) = h * dv_m_dk;
      F.template block<3, 1>(3, 6) = h * (slope_m * dv_m_dk - v_m.norm() * v_m);
    }
    filter.predict(F, next - F * filter.x, Q);
  }
}

template class BallFilter<6>;
template class BallFilter<7>;

}  // namespace stance::estimation
