#include <algorithm>
#include <array>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "sim/random.hpp"
#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

using stance_msgs::robot_state_t;

constexpr int kJoints = 8;
constexpr int kFeet = 2;

rigid_body::State standing() {
  rigid_body::State state;
  state.R_WB = math::rotation_from_rpy({0.1, -0.2, 0.3});
  state.q = test::biped().nominal_joint_position;
  return state;
}

ContactVectors loads(double newton) {
  ContactVectors forces;
  forces.fill(Vector3(0.0, 0.0, newton));
  return forces;
}

robot_state_t period(Sensors& sensors, const rigid_body::State& state, const ContactVectors& forces) {
  for (int i = 0; i < kStepsPerPeriod; ++i) sensors.step(state, state, forces);
  robot_state_t out{};
  sensors.read(out);
  return out;
}

struct Statistics {
  double sum = 0.0, squares = 0.0;
  int count = 0;
  void add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
  double mean() const { return sum / count; }
  double deviation() const { return std::sqrt(std::max(0.0, squares / count - mean() * mean())); }
};

}  // namespace

TEST_CASE("RandomNumbersAreStandardNormalAndTheSameForASeed") {
  Random random(7), same(7), other(8);
  Statistics statistics;
  int beyond_two_sigma = 0;
  bool repeats = true, differs = false;
  for (int i = 0; i < 200'000; ++i) {
    const double value = random.normal();
    repeats = repeats && value == same.normal();
    differs = differs || value != other.normal();
    statistics.add(value);
    if (std::abs(value) > 2.0) ++beyond_two_sigma;
  }
  CHECK(repeats);
  CHECK(differs);
  CHECK(std::abs(statistics.mean()) < 0.01);
  CHECK(std::abs(statistics.deviation() - 1.0) < 0.01);
  CHECK(std::abs(beyond_two_sigma / 200'000.0 - 0.0455) < 0.002);
}

TEST_CASE("PerfectSensorsTellTheTruth") {
  const SensorModel model = test::biped_scenario("stand").sensors;
  rigid_body::State state = standing();
  state.w_WB_W = {0.1, 0.2, -0.3};
  state.qd.setConstant(0.4);
  Sensors sensors(model, kJoints, kFeet, state, loads(60.0), 1);
  const robot_state_t read = period(sensors, state, loads(60.0));
  const Vector3 w_B = state.R_WB.transpose() * state.w_WB_W;
  const Vector3 g_B = state.R_WB.transpose() * Vector3(0.0, 0.0, kGravity);
  CHECK(read.num_joints == kJoints);
  CHECK(read.num_contacts == kFeet);
  CHECK(read.sample_period == 0.005);
  for (int s = 0; s < robot_state_t::SAMPLES; ++s) {
    for (int i = 0; i < 3; ++i) {
      CHECK(std::abs(read.gyro[s][i] - w_B[i]) < 1e-12);
      CHECK(std::abs(read.accelerometer[s][i] - g_B[i]) < 1e-12);
    }
    for (int i = 0; i < kJoints; ++i) {
      CHECK(read.joint_position[s][i] == state.q[i]);
      CHECK(std::abs(read.joint_velocity[s][i] - 0.4) < 1e-12);
    }
    CHECK(read.contact_switch[s][0] == 1);
    CHECK(read.contact_switch[s][1] == 1);
  }
}

TEST_CASE("NoiseHasTheScenariosStatistics") {
  SensorModel model = test::biped_scenario("demo").sensors;
  model.noise.gyro_bias_walk = 0.0;
  const SensorNoise& noise = model.noise;
  const rigid_body::State state = standing();
  const Vector3 g_B = state.R_WB.transpose() * Vector3(0.0, 0.0, kGravity);
  Sensors sensors(model, kJoints, kFeet, state, loads(60.0), 3);
  std::array<Statistics, 3> gyro, accelerometer;
  std::array<Statistics, kJoints> position, velocity;
  for (int k = 0; k < 5'000; ++k) {
    const robot_state_t read = period(sensors, state, loads(60.0));
    for (int s = 0; s < robot_state_t::SAMPLES; ++s) {
      for (std::size_t i = 0; i < 3; ++i) {
        gyro[i].add(read.gyro[s][i]);
        accelerometer[i].add(read.accelerometer[s][i] - g_B[static_cast<int>(i)]);
      }
      for (std::size_t i = 0; i < kJoints; ++i) {
        position[i].add(read.joint_position[s][i] - state.q[static_cast<int>(i)]);
        velocity[i].add(read.joint_velocity[s][i]);
      }
    }
  }
  const double mean_of_five = 1.0 / std::sqrt(5.0);  // a sample's deviation over that of a 1 kHz reading
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(std::abs(std::abs(gyro[i].mean()) - noise.gyro_bias) < 1e-4);
    CHECK(std::abs(gyro[i].deviation() / (noise.gyro_white * mean_of_five) - 1.0) < 0.03);
    CHECK(std::abs(std::abs(accelerometer[i].mean()) - noise.accelerometer_bias) < 1e-3);
    CHECK(std::abs(accelerometer[i].deviation() / (noise.accelerometer_white * mean_of_five) - 1.0) < 0.03);
  }
  for (std::size_t i = 0; i < kJoints; ++i) {
    CHECK(std::abs(std::abs(position[i].mean()) - noise.joint_position_offset) <=
          0.5 * noise.joint_position_resolution + 1e-12);
    CHECK(position[i].deviation() < 1e-7);
    CHECK(std::abs(velocity[i].mean()) < 1e-3);
    CHECK(std::abs(velocity[i].deviation() / (noise.joint_velocity_white * mean_of_five) - 1.0) < 0.03);
  }
}

TEST_CASE("TheGyrosBiasWalks") {
  SensorModel model = test::biped_scenario("stand").sensors;
  model.noise.gyro_bias_walk = 2e-3;
  Statistics walked;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    const rigid_body::State state = standing();
    Sensors sensors(model, kJoints, kFeet, state, loads(60.0), seed);
    const robot_state_t first = period(sensors, state, loads(60.0));
    for (int k = 0; k < 99; ++k) static_cast<void>(period(sensors, state, loads(60.0)));
    const robot_state_t last = period(sensors, state, loads(60.0));
    for (int i = 0; i < 3; ++i) walked.add(last.gyro[1][i] - first.gyro[1][i]);
  }
  CHECK(std::abs(walked.mean()) < 2e-4);
  CHECK(std::abs(walked.deviation() / 2e-3 - 1.0) < 0.06);  // over 1 s
}

TEST_CASE("SeedsChooseTheSignsOfBiasesAndOffsets") {
  const SensorModel model = test::biped_scenario("demo").sensors;
  const rigid_body::State state = standing();
  int positive_gyro = 0, positive_offset = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Sensors sensors(model, kJoints, kFeet, state, loads(60.0), seed);
    Sensors same(model, kJoints, kFeet, state, loads(60.0), seed);
    const robot_state_t read = period(sensors, state, loads(60.0));
    const robot_state_t again = period(same, state, loads(60.0));
    CHECK(read.gyro[1][2] == again.gyro[1][2]);
    CHECK(read.accelerometer[0][1] == again.accelerometer[0][1]);
    if (read.gyro[1][0] > 0.0) ++positive_gyro;
    if (read.joint_position[0][0] > state.q[0]) ++positive_offset;
  }
  CHECK(positive_gyro > 70);
  CHECK(positive_gyro < 130);
  CHECK(positive_offset > 70);
  CHECK(positive_offset < 130);
}

TEST_CASE("ImuAndEncodersTellOfOneMotion") {
  // A joint and the trunk move alike, as the physics does it: first the velocity, then the position with it.
  SensorModel model = test::biped_scenario("stand").sensors;
  model.delay_steps = 0;
  rigid_body::State state;
  state.q = standing().q;
  const double q0 = state.q[0];
  Sensors sensors(model, kJoints, kFeet, state, loads(60.0), 1);
  double position = 0.0, velocity = 0.0;  // by the accelerometer
  for (int k = 0; k < 50; ++k) {
    for (int i = 0; i < kStepsPerPeriod; ++i) {
      const rigid_body::State before = state;
      const double acceleration = 3.0 * std::cos(0.005 * (k * kStepsPerPeriod + i));
      state.v_WB.x() += kPhysicsStep * acceleration;
      state.p_WB.x() += kPhysicsStep * state.v_WB.x();
      state.qd[0] = state.v_WB.x();
      state.q[0] = q0 + state.p_WB.x();
      sensors.step(before, state, loads(60.0));
    }
    robot_state_t read{};
    sensors.read(read);
    for (int s = 0; s < robot_state_t::SAMPLES; ++s) {
      const double dt = read.sample_period, a = read.accelerometer[s][0], was = position;
      position += dt * velocity + 0.5 * dt * dt * a;
      velocity += dt * a;
      CHECK(std::abs(read.joint_position[s][0] - q0 - position) < 1.5e-5);  // m; 2e-4 with half a step between them
      CHECK(std::abs(read.joint_velocity[s][0] - (position - was) / dt) < 5e-5);
    }
  }
}

TEST_CASE("TheAccelerometerKeepsImpactsAndSaturates") {
  const SensorModel model = test::biped_scenario("stand").sensors;
  rigid_body::State before;
  before.q = standing().q;
  rigid_body::State after = before;
  after.v_WB.z() = 0.05;  // 50 m/s^2 over one step of 1 ms
  Sensors sensors(model, kJoints, kFeet, before, loads(60.0), 1);
  sensors.step(before, after, loads(60.0));
  for (int i = 1; i < kStepsPerPeriod; ++i) sensors.step(after, after, loads(60.0));
  robot_state_t read{};
  sensors.read(read);
  CHECK(std::abs(read.accelerometer[0][2] - (kGravity + 50.0 / 5.0)) < 1e-9);

  after.v_WB.z() = 1.0;
  Sensors hit(model, kJoints, kFeet, before, loads(60.0), 1);
  for (int i = 0; i < kStepsPerPeriod; ++i) hit.step(before, after, loads(60.0));
  hit.read(read);
  CHECK(std::abs(read.accelerometer[1][2] - model.accelerometer_limit) < 1e-9);
}

TEST_CASE("ImuAndEncodersAreLateAlikeAndSwitchesByTheirOwnDelay") {
  SensorModel model = test::biped_scenario("stand").sensors;
  model.delay_steps = 3;
  model.contact_delay_steps = 5;
  const rigid_body::State still = standing();
  rigid_body::State moving = still;
  moving.R_WB.setIdentity();
  moving.w_WB_W = {1.0, 0.0, 0.0};
  moving.qd.setConstant(2.0);
  moving.q.setConstant(0.5);
  Sensors sensors(model, kJoints, kFeet, still, loads(60.0), 1);
  const robot_state_t read = period(sensors, moving, loads(0.0));
  // 2 of the first sample's 5 steps and all of the second's have been seen moving.
  CHECK(std::abs(read.gyro[0][0] - 0.4) < 1e-12);
  CHECK(std::abs(read.gyro[1][0] - 1.0) < 1e-12);
  CHECK(std::abs(read.joint_velocity[0][0] - 0.8) < 1e-12);
  CHECK(read.joint_position[0][3] == 0.5);
  CHECK(read.contact_switch[0][0] == 1);
  CHECK(read.contact_switch[1][0] == 0);
}

TEST_CASE("SwitchesCloseAtTheirThreshold") {
  const SensorModel model = test::biped_scenario("stand").sensors;
  const rigid_body::State state = standing();
  Sensors sensors(model, kJoints, kFeet, state, loads(0.0), 1);
  ContactVectors forces = loads(model.contact_threshold - 0.01);
  forces[1].z() = model.contact_threshold + 0.01;
  const robot_state_t read = period(sensors, state, forces);
  CHECK(read.contact_switch[1][0] == 0);
  CHECK(read.contact_switch[1][1] == 1);
}

}  // namespace stance::sim
