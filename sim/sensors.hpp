#pragma once
// The robot's sensors: IMU and encoders at 1 kHz, averaged over the samples of a control period, and contact switches.
//
// All tell of the middle of a physics step. There the velocity jumps where the step begins and the positions then move
// with it: a velocity is that of the half step before and after its position, and their mean, with the velocity's
// change as acceleration, is one motion. Half a millisecond between them is enough to turn the pitch that is estimated
// from them by 1 mrad a second at 1.2 m/s.
//
//   gyro             R_WB^T w_WB_W, the mean of before and after; with white noise, a bias and its random walk
//   accelerometer    R^T ((v_after - v_before) / dt - g), R before the step: the velocity's change, so that impacts are
//                    kept; with white noise and a bias, then saturated
//   joint velocity   mean of before and after, with white noise
//   joint position   the same with an offset, rounded to the encoder's resolution
//   contact switch   closed where the ground's normal force passes a threshold
// IMU and encoders are late by one delay, so that they stay aligned; the switches have their own.
#include <array>
#include <cstdint>
#include <stance_msgs/robot_state_t.hpp>

#include "controller/rigid_body/dynamics.hpp"
#include "sim/random.hpp"
#include "sim/scenario.hpp"

namespace stance::sim {

class Sensors {
 public:
  /// Starts as if the robot had been at rest in `state`, its feet under `foot_force_W`, for longer than any delay.
  Sensors(const SensorModel& model, int num_joints, int num_contacts, const rigid_body::State& state,
          const ContactVectors& foot_force_W, std::uint64_t seed);

  /// One physics step that took the robot from `before` to `after`.
  void step(const rigid_body::State& before, const rigid_body::State& after,
            const ContactVectors& foot_force_W) noexcept;

  /// The samples of the control period that ended with the last step.
  void read(stance_msgs::robot_state_t& state) const noexcept;

 private:
  struct Reading {
    Vector3 gyro = Vector3::Zero();
    Vector3 accelerometer = Vector3::Zero();
    JointVector joint_position = JointVector::Zero();
    JointVector joint_velocity = JointVector::Zero();
  };
  Reading measure(const rigid_body::State& before, const rigid_body::State& after) noexcept;

  SensorModel model_;
  int num_joints_;
  int num_contacts_;
  Random random_;
  Vector3 gyro_bias_;
  Vector3 accelerometer_bias_;
  JointVector joint_position_offset_ = JointVector::Zero();
  std::array<Reading, kMaxSensorDelaySteps + 1> readings_{};  // rings: entry of step k at k mod size
  std::array<ContactFlags, kMaxSensorDelaySteps + 1> switches_{};
  std::int64_t steps_ = 0;  // taken since the start
  std::array<SensorSample, kStateSamples> samples_{};
};

}  // namespace stance::sim
