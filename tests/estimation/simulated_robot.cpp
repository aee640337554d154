#include "tests/estimation/simulated_robot.hpp"

#include <cmath>
#include <stdexcept>

#include "controller/config/biped_config_yaml.hpp"

namespace stance::estimation::test {
namespace {

constexpr int kSubsteps = 10;
constexpr int kImuSamples = 5;  // of a 1 kHz IMU in one sample

Vector3 gravity_W() { return {0.0, 0.0, -kGravity}; }

}  // namespace

const ShippedBiped& shipped_biped() {
  static const ShippedBiped biped = [] {
    const config::RobotDescription robot = config::load_robot(config::share_directory() / "robots", "biped");
    const behaviours::BipedConfig config = config::biped_config(robot);
    return ShippedBiped{config.estimator, config.com_offset_observer,
                        kinematics::leg_geometries(robot.model, robot.feet), robot.feet[0].radius,
                        robot.model.total_mass};
  }();
  return biped;
}

BaseEstimator shipped_estimator() {
  const ShippedBiped& biped = shipped_biped();
  return {biped.estimator, biped.legs, biped.foot_radius};
}

CentreOfMassOffsetObserver shipped_offset_observer() {
  const ShippedBiped& biped = shipped_biped();
  return {biped.com_offset_observer, biped.mass, biped.foot_radius};
}

Motion standing_motion(double amplitude) {
  // Each part is amplitude (1 - cos(w t)), faded in over a second so that the robot starts at rest, acceleration
  // included.
  const auto sway = [amplitude](double size, double w, double t) {
    return amplitude * size * (1.0 - std::cos(w * t)) * (1.0 - std::exp(-t * t));
  };
  Motion motion;
  motion.p_WB = [sway](double t) { return Vector3(sway(0.02, 2.1, t), sway(0.03, 1.3, t), 0.80 + sway(0.01, 3.0, t)); };
  motion.rpy = [sway](double t) { return Vector3(sway(0.03, 1.7, t), sway(0.05, 2.6, t), sway(0.04, 0.9, t)); };
  return motion;
}

SensorErrors consumer_sensors() {
  SensorErrors e;
  e.gyro_noise = 0.003;
  e.gyro_bias = 0.002;
  e.gyro_bias_walk = 2e-5;
  e.accelerometer_noise = 0.05;
  e.accelerometer_bias = 0.05;
  e.encoder_step = 5e-4;
  e.encoder_offset = 2e-3;
  e.joint_velocity_noise = 0.05;
  return e;
}

SimulatedRobot::SimulatedRobot(Motion motion, const SensorErrors& errors, std::uint32_t seed)
    : motion_(std::move(motion)), errors_(errors), random_(seed) {
  const Vector3 p_WB = motion_.p_WB(0.0);
  const Vector3 heading_offset(0.0, legs_[0].p_BL.y(), 0.0);
  p_WF_ = {Vector3(p_WB.x(), p_WB.y(), foot_radius_) + heading_offset,
           Vector3(p_WB.x(), p_WB.y(), foot_radius_) - heading_offset};
  truth_.p_WB = p_WB;
  truth_.R_WB = R_WB(0.0);
  truth_.v_WB = v_WB(0.0);
  truth_.gyro_bias = errors_.gyro_bias * Vector3(sign(), sign(), sign());
  truth_.accelerometer_bias = errors_.accelerometer_bias * Vector3(sign(), sign(), sign());
  for (double& offset : encoder_offset_) offset = errors_.encoder_offset * sign();
  q_ = joints(0.0, p_WF_);
  state_.num_joints = kMaxJoints;
  state_.num_contacts = kFeet;
  state_.sample_period = kSamplePeriod;
}

const RobotState& SimulatedRobot::next() {
  for (SensorSample& sample : state_.samples) measure(sample);
  state_.utime += std::llround(1e6 * kStateSamples * kSamplePeriod);
  ++state_.seq;
  return state_;
}

Vector3 SimulatedRobot::v_WB(double time) const {
  constexpr double h = 1e-4;
  return (motion_.p_WB(time + h) - motion_.p_WB(time - h)) / (2.0 * h);
}

JointVector SimulatedRobot::joints(double time, const std::array<Vector3, kFeet>& p_WF) const {
  const Matrix3 R_BW = R_WB(time).transpose();
  const Vector3 p_WB = motion_.p_WB(time);
  JointVector q;
  for (int i = 0; i < kFeet; ++i) {
    const Vector3 p_LF = kinematics::leg_rotation().transpose() * (R_BW * (p_WF[i] - p_WB) - legs_[i].p_BL);
    kinematics::LegVector leg_q;
    if (kinematics::leg_ik(legs_[i], p_LF, motion_.pitch_sum(time), leg_q) != kinematics::LegIkStatus::kOk) {
      throw std::runtime_error("the test's motion is out of the leg's reach");
    }
    q.segment<4>(4 * i) = leg_q;
  }
  return q;
}

void SimulatedRobot::measure(SensorSample& sample) {
  const double h = kSamplePeriod / kSubsteps;
  const JointVector q_start = q_;
  Vector3 gyro = Vector3::Zero(), accelerometer = Vector3::Zero();
  for (int k = 0; k < kSubsteps; ++k) {
    const double t1 = time_ + h, t_mid = time_ + 0.5 * h;
    const Matrix3 R_mid = R_WB(t_mid);
    const Vector3 w_B = math::log_so3(R_WB(time_).transpose() * R_WB(t1)) / h;
    gyro += w_B / kSubsteps;
    accelerometer += R_mid.transpose() * ((v_WB(t1) - v_WB(time_)) / h - gravity_W()) / kSubsteps;

    // The tips' velocities depend on the joints' through rolling: iterate.
    std::array<Vector3, kFeet> p_WF;
    JointVector q1;
    for (int iteration = 0; iteration < 3; ++iteration) {
      for (int i = 0; i < kFeet; ++i) p_WF[i] = p_WF_[i] + h * foot_velocity_[i];
      q1 = joints(t1, p_WF);
      for (int i = 0; i < kFeet; ++i) {
        const FootMotion foot = motion_.foot(t_mid, i);
        const auto qd = (q1 - q_).segment<4>(4 * i) / h;
        const double roll = 0.5 * (q1[4 * i] + q_[4 * i]);
        const double pitch_rate = qd[1] + qd[2] + qd[3];
        const Vector3 w_link_B = w_B + Vector3(qd[0], std::cos(roll) * pitch_rate, std::sin(roll) * pitch_rate);
        const Vector3 rolling = (R_mid * w_link_B).cross(Vector3(0.0, 0.0, foot_radius_));
        foot_velocity_[i] = foot.velocity + (foot.contact ? rolling : Vector3::Zero());
      }
    }
    p_WF_ = p_WF;
    q_ = q1;
    time_ = t1;
  }
  truth_.R_WB = R_WB(time_);
  truth_.p_WB = motion_.p_WB(time_);
  truth_.v_WB = v_WB(time_);
  for (int i = 0; i < kFeet; ++i) truth_.p_BF_W[i] = p_WF_[i] - truth_.p_WB;
  truth_.gyro_bias += errors_.gyro_bias_walk * std::sqrt(kSamplePeriod) * gaussian3();

  const double averaging = 1.0 / std::sqrt(static_cast<double>(kImuSamples));
  sample.gyro = gyro + truth_.gyro_bias + averaging * errors_.gyro_noise * gaussian3();
  sample.accelerometer =
      accelerometer + truth_.accelerometer_bias + averaging * errors_.accelerometer_noise * gaussian3();
  sample.joint_position = q_ + encoder_offset_;
  sample.joint_velocity = (q_ - q_start) / kSamplePeriod;
  for (int j = 0; j < kMaxJoints; ++j) {
    if (errors_.encoder_step > 0.0) {
      sample.joint_position[j] = errors_.encoder_step * std::round(sample.joint_position[j] / errors_.encoder_step);
    }
    sample.joint_velocity[j] += averaging * errors_.joint_velocity_noise * gaussian();
  }
  for (int i = 0; i < kFeet; ++i) sample.contact_switch[i] = motion_.foot(time_, i).contact;
}

}  // namespace stance::estimation::test
