#pragma once
// The base's orientation, velocity and position from IMU, encoders and contact switches: an error-state Kalman filter.
// Maps and Jacobians: base_error_state.hpp. Law of contacts: see base_estimator.cpp's head.
#include <array>
#include <cstdint>

#include "controller/estimation/base_error_state.hpp"
#include "controller/estimation/kalman_filter.hpp"
#include "controller/interface/signals.hpp"
#include "controller/kinematics/leg.hpp"

namespace stance::estimation {

/// Gains of the filter; standard deviations, densities in 1/sqrt(s). Read from robots/<robot>/<robot>.yaml.
struct BaseEstimatorConfig {
  double gyro_noise = 0.0;                ///< rad/s/sqrt(Hz)
  double accelerometer_noise = 0.0;       ///< m/s^2/sqrt(Hz)
  double position_noise = 0.0;            ///< m/sqrt(s)
  double gyro_bias_noise = 0.0;           ///< rad/s/sqrt(s)
  double accelerometer_bias_noise = 0.0;  ///< m/s^2/sqrt(s)
  double stance_foot_noise = 0.0;         ///< m/sqrt(s)
  double standing_foot_noise = 0.0;       ///< m/sqrt(s), of feet that stand
  double standing_time = 0.0;             ///< s, with both feet on, from which on they stand
  double unloading_foot_noise = 0.0;      ///< m/sqrt(s), added as a foot loads or unloads
  double swing_foot_noise = 0.0;          ///< m/sqrt(s)
  double foot_velocity_sigma = 0.0;       ///< m/s
  double foot_position_sigma = 0.0;       ///< m
  double contact_ramp = 0.0;              ///< s, from touchdown to full trust
  double ramp_gain = 0.0;                 ///< measurement variances grow by 1 + this at no trust
  double slip_gate = 0.0;                 ///< NIS of the foot velocity (3 degrees of freedom) above which a foot slips
  double slip_timeout = 0.0;              ///< s of rejections after which the velocity is taken with slip_inflation
  double slip_inflation = 0.0;            ///< of the velocity's variance
  double initial_tilt_sigma = 0.0;        ///< rad, beyond the tilt that an accelerometer bias feigns
  double initial_yaw_sigma = 0.0;         ///< rad
  double initial_velocity_sigma = 0.0;    ///< m/s
  double initial_position_sigma = 0.0;    ///< m
  double initial_foot_sigma = 0.0;        ///< m, of the tips from B
  double initial_gyro_bias_sigma = 0.0;   ///< rad/s
  double initial_accelerometer_bias_sigma = 0.0;  ///< m/s^2
  void validate() const;  ///< throws std::invalid_argument naming the field, its value and the range
};

/// What the controller knows and the sensors do not.
struct ContactPlan {
  std::array<bool, kFeet> stance{true, true};  ///< planned to bear load
  std::array<double, kFeet> load{1.0, 1.0};    ///< 0..1, how much of its load a foot about to lift still bears
};

class BaseEstimator {
 public:
  /// `foot_radius` [m]: the tip is a sphere that rolls; `legs` in the order of the contacts (left first), leg i's
  /// joints being joints 4 i to 4 i + 3. Throws where the config is invalid.
  BaseEstimator(const BaseEstimatorConfig& config, const std::array<kinematics::LegGeometry, kFeet>& legs,
                double foot_radius);

  /// Starts from rest: roll and pitch from the accelerometer, yaw zero. W's origin lies midway between the feet, z = 0
  /// on the ground under the feet that are switched on (both, where none is).
  void initialise(const RobotState& state) noexcept;
  bool initialised() const noexcept { return initialised_; }

  /// One control period: every sample of `state`, oldest first. The first one also initialises. Where `utime` says that
  /// samples were lost in between, the oldest sample's IMU bridges the gap.
  void step(const RobotState& state, const ContactPlan& plan, BaseEstimate& estimate) noexcept;

  static constexpr int kMaxBridgedSamples = 20;

  /// The filter's own variables, for tests and consistency statistics. The covariance is the error's
  /// (base_error_state.hpp).
  const BaseState& state() const noexcept { return state_; }
  const ErrorMatrix& covariance() const noexcept { return filter_.P; }
  /// The foot's velocity is being refused: it slips.
  bool slipping(int foot) const noexcept { return slipping_[foot]; }

 private:
  FootMeasurement measure_foot(const SensorSample& sample, int foot, double dt) const noexcept;
  void step_sample(const ImuMean& imu, const SensorSample& sample, const ContactPlan& plan) noexcept;
  void advance(const ImuMean& imu) noexcept;
  /// Judges a foot by its velocity, whose residual [m/s] it returns.
  Vector3 gate(const ImuMean& imu, const FootMeasurement& foot, int index) noexcept;
  bool given_up(int foot) const noexcept;
  bool stands() const noexcept;
  /// The three parts of the error from `begin` on: uncorrelated, of this variance.
  void forget(int begin, double variance) noexcept;
  void update(const ErrorMeasurement& measurement, double variance) noexcept;
  void write(const SensorSample& now, BaseEstimate& estimate) const noexcept;

  BaseEstimatorConfig config_;
  std::array<kinematics::LegGeometry, kFeet> legs_;
  double foot_radius_;  ///< m

  BaseState state_;
  ErrorFilter filter_;
  std::array<double, kFeet> contact_time_{};   ///< s since touchdown or slip
  std::array<double, kFeet> rejected_time_{};  ///< s
  std::array<bool, kFeet> in_contact_{};
  std::array<bool, kFeet> slipping_{};
  std::int64_t utime_ = 0;  ///< us, of the last sample taken
  double nis_sum_ = 0.0;    ///< of this step's updates
  int updates_ = 0;
  bool initialised_ = false;
};

}  // namespace stance::estimation
