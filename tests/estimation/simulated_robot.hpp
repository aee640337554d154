#pragma once
// A robot whose trunk follows a given path and whose feet stand, roll, slide or swing as told: exact IMU, encoders and
// contact switches, and, on request, the errors of real ones. It has no forces: it is kinematics, for the estimator's
// tests.
#include <array>
#include <cstdint>
#include <functional>
#include <random>

#include "controller/estimation/base_estimator.hpp"
#include "controller/estimation/com_offset_observer.hpp"

namespace stance::estimation::test {

/// Of robots/biped, as the robot stands with it.
struct ShippedBiped {
  BaseEstimatorConfig estimator;
  CentreOfMassOffsetConfig com_offset_observer;
  std::array<kinematics::LegGeometry, kFeet> legs;
  double foot_radius = 0.0;  ///< m
  double mass = 0.0;         ///< kg
};
const ShippedBiped& shipped_biped();
BaseEstimator shipped_estimator();
CentreOfMassOffsetObserver shipped_offset_observer();

inline constexpr double kSamplePeriod = 0.005;  ///< s

struct FootMotion {
  bool contact = true;
  Vector3 velocity =
      Vector3::Zero();  ///< m/s, in W: of the sphere's lowest point in contact (slip), else of the tip (swing)
};

struct Motion {
  std::function<Vector3(double)> p_WB;  ///< m, of time
  std::function<Vector3(double)> rpy;   ///< rad, of time
  std::function<FootMotion(double, int)> foot = [](double, int) { return FootMotion{}; };
  std::function<double(double)> pitch_sum = [](double) { return -0.25; };  ///< rad, of the last link in L
};

/// Standing with B 0.8 m up, swaying by centimetres and hundredths of a radian times `amplitude`. At rest at time 0.
Motion standing_motion(double amplitude = 1.0);

/// White noise is that of a 1 kHz sensor, of which a sample is the mean of 5.
struct SensorErrors {
  double gyro_noise = 0.0;            ///< rad/s
  double gyro_bias = 0.0;             ///< rad/s, of random sign on each axis
  double gyro_bias_walk = 0.0;        ///< rad/s/sqrt(s)
  double accelerometer_noise = 0.0;   ///< m/s^2
  double accelerometer_bias = 0.0;    ///< m/s^2, of random sign on each axis
  double encoder_step = 0.0;          ///< rad
  double encoder_offset = 0.0;        ///< rad, of random sign on each joint
  double joint_velocity_noise = 0.0;  ///< rad/s
};
/// The simulator's defaults.
SensorErrors consumer_sensors();

class SimulatedRobot {
 public:
  SimulatedRobot(Motion motion, const SensorErrors& errors, std::uint32_t seed);

  /// The next control period's sensors; the first is at rest at time 0.
  const RobotState& next();
  /// The truth at the end of the last period, W's origin under the first position of the feet, biases included.
  const BaseState& truth() const { return truth_; }
  double time() const { return time_; }  ///< s

 private:
  void measure(SensorSample& sample);
  JointVector joints(double time, const std::array<Vector3, kFeet>& p_WF) const;
  Matrix3 R_WB(double time) const { return math::rotation_from_rpy(motion_.rpy(time)); }
  Vector3 v_WB(double time) const;
  double gaussian() { return normal_(random_); }
  Vector3 gaussian3() { return {gaussian(), gaussian(), gaussian()}; }
  double sign() { return random_() % 2 == 0 ? 1.0 : -1.0; }

  Motion motion_;
  SensorErrors errors_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  std::array<kinematics::LegGeometry, kFeet> legs_ = shipped_biped().legs;
  double foot_radius_ = shipped_biped().foot_radius;  ///< m
  std::array<Vector3, kFeet> foot_velocity_{Vector3::Zero(), Vector3::Zero()};
  JointVector q_ = JointVector::Zero();
  JointVector encoder_offset_ = JointVector::Zero();
  BaseState truth_;
  std::array<Vector3, kFeet> p_WF_{Vector3::Zero(), Vector3::Zero()};  ///< m, tips
  RobotState state_;
  double time_ = 0.0;
};

}  // namespace stance::estimation::test
