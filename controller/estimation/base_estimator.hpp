#pragma once
// The base's orientation, velocity and position from IMU, encoders and contact switches: an error-state Kalman filter.
// Law and measured parameters: see base_estimator.cpp's head.
#include <array>
#include <vector>

#include "controller/estimation/kalman_filter.hpp"
#include "controller/interface/signals.hpp"
#include "controller/kinematics/leg.hpp"

namespace stance::estimation {

inline constexpr int kFeet = 2;

/// Gains of the filter; standard deviations, densities in 1/sqrt(s). Read from robots/<robot>/<robot>.yaml.
struct BaseEstimatorConfig {
  double gyro_noise = 0.0;              ///< rad/s/sqrt(Hz)
  double accelerometer_noise = 0.0;     ///< m/s^2/sqrt(Hz)
  double position_noise = 0.0;          ///< m/sqrt(s)
  double gyro_bias_noise = 0.0;         ///< rad/s/sqrt(s)
  double accelerometer_bias_noise = 0.0;  ///< m/s^2/sqrt(s)
  double stance_foot_noise = 0.0;       ///< m/sqrt(s)
  double unloading_foot_noise = 0.0;    ///< m/sqrt(s), added as a foot loads or unloads
  double swing_foot_noise = 0.0;        ///< m/sqrt(s)
  double foot_velocity_sigma = 0.0;     ///< m/s
  double foot_position_sigma = 0.0;     ///< m
  double contact_ramp = 0.0;            ///< s, from touchdown to full trust
  double ramp_gain = 0.0;               ///< measurement noise grows by this factor at no trust
  double slip_gate = 0.0;               ///< NIS of the foot velocity (3 degrees of freedom) above which a foot slips
  double slip_timeout = 0.0;            ///< s of rejections after which the velocity is taken with slip_inflation
  double slip_inflation = 0.0;
  double initial_tilt_sigma = 0.0;      ///< rad
  double initial_yaw_sigma = 0.0;       ///< rad
  double initial_velocity_sigma = 0.0;  ///< m/s
  double initial_position_sigma = 0.0;  ///< m
  double initial_foot_sigma = 0.0;      ///< m
  double initial_gyro_bias_sigma = 0.0;           ///< rad/s
  double initial_accelerometer_bias_sigma = 0.0;  ///< m/s^2
  void validate() const;                ///< throws std::invalid_argument naming the field, its value and the range
};

/// What the controller knows and the sensors do not.
struct ContactPlan {
  std::array<bool, kFeet> stance{true, true};   ///< planned to bear load
  std::array<double, kFeet> load{1.0, 1.0};     ///< 0..1, how much of its load a foot about to lift still bears
};

class BaseEstimator {
 public:
  /// `foot_radius` [m]: the tip is a sphere that rolls; `legs` in the order of the contacts (left first).
  BaseEstimator(const BaseEstimatorConfig& config, const std::array<kinematics::LegGeometry, kFeet>& legs, double foot_radius);

  /// Starts from rest on the switched-on feet: roll and pitch from the accelerometer, yaw zero, the mean of the feet's ground
  /// points at W's origin.
  void initialise(const RobotState& state) noexcept;
  bool initialised() const noexcept;

  /// One control period: every sample of `state`, oldest first.
  void step(const RobotState& state, const ContactPlan& plan, BaseEstimate& estimate) noexcept;

 private:
  struct Filter;
  // (members are the implementer's)
};

}  // namespace stance::estimation
