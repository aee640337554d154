#include "sim/sensors.hpp"

#include <cmath>

#include "sim/world.hpp"

namespace stance::sim {
namespace {

constexpr int kStepsPerSample = kStepsPerPeriod / kStateSamples;
static_assert(kStepsPerSample * kStateSamples == kStepsPerPeriod);
static_assert(kStateSamples == stance_msgs::robot_state_t::SAMPLES &&
              kMaxJoints == stance_msgs::robot_state_t::MAX_JOINTS &&
              kMaxContacts == stance_msgs::robot_state_t::MAX_CONTACTS);

Vector3 signs3(Random& random) {
  const double x = random.sign();
  const double y = random.sign();
  const double z = random.sign();
  return {x, y, z};
}

}  // namespace

Sensors::Sensors(const SensorModel& model, int num_joints, int num_contacts, const rigid_body::State& state,
                 const ContactVectors& foot_force_W, std::uint64_t seed)
    : model_(model), num_joints_(num_joints), num_contacts_(num_contacts), random_(seed) {
  gyro_bias_ = model_.noise.gyro_bias * signs3(random_);
  accelerometer_bias_ = model_.noise.accelerometer_bias * signs3(random_);
  for (int i = 0; i < num_joints_; ++i) joint_position_offset_[i] = model_.noise.joint_position_offset * random_.sign();
  constexpr int periods = kMaxSensorDelaySteps / kStepsPerPeriod + 1;
  for (int i = 0; i < periods * kStepsPerPeriod; ++i) step(state, state, foot_force_W);
}

Sensors::Reading Sensors::measure(const rigid_body::State& before, const rigid_body::State& after) noexcept {
  const SensorNoise& noise = model_.noise;
  Reading reading;
  gyro_bias_ += noise.gyro_bias_walk * std::sqrt(kPhysicsStep) * normal3(random_);
  const Vector3 w_B = 0.5 * (before.R_WB.transpose() * before.w_WB_W + after.R_WB.transpose() * after.w_WB_W);
  reading.gyro = w_B + gyro_bias_ + noise.gyro_white * normal3(random_);

  const Vector3 acceleration_W = (after.v_WB - before.v_WB) / kPhysicsStep + Vector3(0.0, 0.0, kGravity);
  reading.accelerometer =
      before.R_WB.transpose() * acceleration_W + accelerometer_bias_ + noise.accelerometer_white * normal3(random_);
  reading.accelerometer =
      reading.accelerometer.cwiseMax(-model_.accelerometer_limit).cwiseMin(model_.accelerometer_limit);

  for (int i = 0; i < num_joints_; ++i) {
    const double position = 0.5 * (before.q[i] + after.q[i]) + joint_position_offset_[i];
    const double resolution = noise.joint_position_resolution;
    reading.joint_position[i] = resolution > 0.0 ? resolution * std::round(position / resolution) : position;
    reading.joint_velocity[i] = 0.5 * (before.qd[i] + after.qd[i]) + noise.joint_velocity_white * random_.normal();
  }
  return reading;
}

void Sensors::step(const rigid_body::State& before, const rigid_body::State& after,
                   const ContactVectors& foot_force_W) noexcept {
  const auto slot = [](std::int64_t step) {
    constexpr std::int64_t size = kMaxSensorDelaySteps + 1;
    return static_cast<std::size_t>(step < 0 ? 0 : step % size);
  };
  readings_[slot(steps_)] = measure(before, after);
  ContactFlags& closed = switches_[slot(steps_)];
  for (std::size_t i = 0; i < static_cast<std::size_t>(num_contacts_); ++i) {
    closed[i] = foot_force_W[i].z() > model_.contact_threshold;
  }

  const Reading& seen = readings_[slot(steps_ - model_.delay_steps)];
  const int step_in_period = static_cast<int>(steps_ % kStepsPerPeriod);
  SensorSample& sample = samples_[static_cast<std::size_t>(step_in_period / kStepsPerSample)];
  if (step_in_period % kStepsPerSample == 0) sample = SensorSample{};
  sample.gyro += seen.gyro / kStepsPerSample;
  sample.accelerometer += seen.accelerometer / kStepsPerSample;
  sample.joint_velocity += seen.joint_velocity / kStepsPerSample;
  sample.joint_position = seen.joint_position;
  sample.contact_switch = switches_[slot(steps_ - model_.contact_delay_steps)];
  ++steps_;
}

void Sensors::read(stance_msgs::robot_state_t& state) const noexcept {
  state.num_joints = num_joints_;
  state.num_contacts = num_contacts_;
  state.sample_period = kStepsPerSample * kPhysicsStep;
  for (std::size_t s = 0; s < kStateSamples; ++s) {
    const SensorSample& sample = samples_[s];
    for (int i = 0; i < 3; ++i) {
      state.gyro[s][i] = sample.gyro[i];
      state.accelerometer[s][i] = sample.accelerometer[i];
    }
    for (int i = 0; i < kMaxJoints; ++i) {
      state.joint_position[s][i] = sample.joint_position[i];
      state.joint_velocity[s][i] = sample.joint_velocity[i];
    }
    for (std::size_t i = 0; i < kMaxContacts; ++i) state.contact_switch[s][i] = sample.contact_switch[i] ? 1 : 0;
  }
}

}  // namespace stance::sim
