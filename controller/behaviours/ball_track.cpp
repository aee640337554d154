#include "controller/behaviours/ball_track.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stance::behaviours {
namespace {

double seconds(std::int64_t from_us, std::int64_t to_us) noexcept {
  return static_cast<double>(to_us - from_us) * 1e-6;
}

}  // namespace

BallTrack::BallTrack(const BallTrackConfig& config, const estimation::BallFilterConfig& filter)
    : config_(config), filter_(filter) {}

void BallTrack::reset() noexcept {
  filter_.reset();
  observations_ = 0;
  rejected_in_a_row_ = 0;
}

void BallTrack::start(std::int64_t utime, const Vector3& p_A) noexcept {
  reset();
  static_cast<void>(filter_.step(0.0, p_A));
  utime_ = believed_utime_ = utime;
  observations_ = 1;
}

double BallTrack::observe(std::int64_t utime, const Vector3& p_A) noexcept {
  if (!filter_.has_started() || seconds(believed_utime_, utime) > config_.max_gap) {
    start(utime, p_A);
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double dt = seconds(utime_, utime);
  const double nis = filter_.nis(dt, p_A);
  utime_ = utime;
  if (nis <= config_.gate) {
    static_cast<void>(filter_.step(dt, p_A));
    believed_utime_ = utime;
    ++observations_;
    rejected_in_a_row_ = 0;
    return nis;
  }
  static_cast<void>(filter_.step(dt, std::nullopt));
  ++rejected_;
  if (++rejected_in_a_row_ >= config_.max_rejected) start(utime, p_A);
  return nis;
}

bool BallTrack::is_known(std::int64_t utime) const noexcept {
  return filter_.has_started() && observations_ >= config_.min_observations &&
         seconds(believed_utime_, utime) <= config_.max_gap;
}

estimation::BallFilter<7>::Estimate BallTrack::at(std::int64_t utime) const noexcept {
  return filter_.predict(std::max(seconds(utime_, utime), 0.0));
}

estimation::BallFilter<7>::Estimate BallTrack::thrown_at_aim(std::int64_t utime) const noexcept {
  constexpr double longest = 2.0;  // s, to the aim or since
  estimation::BallFilter<7>::Estimate estimate = at(utime);
  planning::BallState ball{estimate.p(), estimate.v(), estimate.x(6)};
  const double t = ball.coast_to_nearest(config_.aim, -longest, longest);
  constexpr double at_the_end = 0.99;
  if (!(std::abs(t) < at_the_end * longest)) return estimate;  // it is not at its nearest
  using Prior = estimation::KalmanFilter<7, 2>;
  const Eigen::Matrix<double, 2, 3> D = ball.across();
  Prior::MeasurementMatrix H = Prior::MeasurementMatrix::Zero();
  H.leftCols<3>() = D;
  H.middleCols<3>(3) = t * D;
  Prior prior;
  prior.x = estimate.x;
  prior.P = estimate.P;
  const Prior::MeasurementCovariance R =
      config_.aim_sigma * config_.aim_sigma * Prior::MeasurementCovariance::Identity();
  const Prior::Measurement z = H * estimate.x + D * (config_.aim - ball.p_A);
  if (!(prior.innovation(z, H, R).nis / 2.0 <= config_.gate)) return estimate;  // it is thrown elsewhere
  static_cast<void>(prior.update(z, H, R));
  estimate.x = prior.x;
  estimate.P = prior.P;
  return estimate;
}

}  // namespace stance::behaviours
