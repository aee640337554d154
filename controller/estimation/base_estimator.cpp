// The base estimator's law, one sample after the other. State, maps and Jacobians: base_error_state.hpp.
//
//   contact     = contact switch and planned stance
//   trust alpha = min(1, time in contact / contact_ramp, load)
//   1. predict  state and P; a foot in contact rolls: d += u dt
//   2. gate     before any update: a foot in contact slips where its velocity's NIS > slip_gate (or is no number);
//               its time in contact starts again
//   3. feet     not in contact or slipping: d = R c anew, its error uncorrelated, of variance swing_foot_noise^2 dt;
//               others: variance plus (stance_foot_noise + unloading_foot_noise (1 - alpha))^2 dt; where the robot
//               stands, which is with both feet on for standing_time, standing_foot_noise^2 dt
//   4. update   each foot in contact: velocity, position; variances times 1 + ramp_gain (1 - alpha). A slipping foot's
//               velocity is skipped, but once refused for slip_timeout it is taken, its variance times slip_inflation.
//
// Of the heading feet tell only where the robot stands. In the double supports of a gait an encoder's offset and a foot
// that gives by a millimetre turn the line between the feet by milliradians, always the same way, so that the gyro's
// bias would be taken for another: there the heading is the gyro's, its bias as it was found while standing.
//
// The position is the velocity's integral: no measurement moves it. Each new look at the heading would turn the way
// walked so far about its start: far from there the position, and with it every foothold in W, would jump by more than
// a foot may.
//
// Gating the velocity alone would not do: a slipping foot's position drags velocity and tilt too, hence step 3 for it.
//
// Where both feet were refused for slip_timeout and agree with each other, it is the filter that is wrong (a blow that
// the accelerometer did not see): it forgets its velocity and takes theirs. Inflated measurements would bring it back
// ten times slower and would explain the difference by a tilt that is not there.
//
// At the start the accelerometer gives the tilt, so that its bias and the tilt's error are one: theta = z x (R b_a)/g +
// own error. P starts with that correlation: without it the filter would count the accelerometer twice.
#include "controller/estimation/base_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace stance::estimation {
namespace {

constexpr double kMicrosecond = 1e-6;       ///< s
constexpr double kForgottenVelocity = 3.0;  ///< m/s, sigma of a velocity of which nothing is known

double squared(double x) { return x * x; }

/// `change` [m/s^2]: of the accelerometer over a sample.
ImuMean imu_mean(const SensorSample& sample, const Vector3& change, double dt) {
  return {sample.gyro, sample.accelerometer, change, dt};
}

/// The rotation next to R, for an R that rounding alone has moved (one Newton step).
Matrix3 orthonormal(const Matrix3& R) { return 1.5 * R - 0.5 * R * R.transpose() * R; }

Vector3 sigma(const Vector3& variance) { return variance.cwiseMax(0.0).cwiseSqrt(); }

}  // namespace

void BaseEstimatorConfig::validate() const {
  struct Field {
    const char* name;
    double value;
    double low;
    double high;
  };
  constexpr double kTiny = 1e-9;  // what a variance is divided by must not vanish
  const Field fields[] = {
      {"gyro_noise", gyro_noise, 0.0, 1.0},
      {"accelerometer_noise", accelerometer_noise, kTiny, 10.0},
      {"position_noise", position_noise, 0.0, 1.0},
      {"gyro_bias_noise", gyro_bias_noise, 0.0, 1.0},
      {"accelerometer_bias_noise", accelerometer_bias_noise, 0.0, 1.0},
      {"stance_foot_noise", stance_foot_noise, 0.0, 1.0},
      {"standing_foot_noise", standing_foot_noise, 0.0, 1.0},
      {"standing_time", standing_time, 1e-3, 10.0},
      {"unloading_foot_noise", unloading_foot_noise, 0.0, 10.0},
      {"swing_foot_noise", swing_foot_noise, 0.1, 1000.0},
      {"foot_velocity_sigma", foot_velocity_sigma, 1e-5, 10.0},
      {"foot_position_sigma", foot_position_sigma, 1e-6, 1.0},
      {"contact_ramp", contact_ramp, kTiny, 1.0},
      {"ramp_gain", ramp_gain, 0.0, 1e4},
      {"slip_gate", slip_gate, 3.0, 1e6},
      {"slip_timeout", slip_timeout, 0.0, 10.0},
      {"slip_inflation", slip_inflation, 1.0, 1e6},
      {"initial_tilt_sigma", initial_tilt_sigma, 0.0, 1.0},
      {"initial_yaw_sigma", initial_yaw_sigma, 0.0, 1.0},
      {"initial_velocity_sigma", initial_velocity_sigma, 0.0, 10.0},
      {"initial_position_sigma", initial_position_sigma, 0.0, 10.0},
      {"initial_foot_sigma", initial_foot_sigma, 0.0, 10.0},
      {"initial_gyro_bias_sigma", initial_gyro_bias_sigma, 0.0, 1.0},
      {"initial_accelerometer_bias_sigma", initial_accelerometer_bias_sigma, 0.0, 10.0},
  };
  for (const Field& field : fields) {
    if (field.value >= field.low && field.value <= field.high) continue;
    std::ostringstream message;
    message << "base estimator: " << field.name << " = " << field.value << " is not within [" << field.low << ", "
            << field.high << "]";
    throw std::invalid_argument(message.str());
  }
}

BaseEstimator::BaseEstimator(const BaseEstimatorConfig& config, const std::array<kinematics::LegGeometry, kFeet>& legs,
                             double foot_radius)
    : config_(config), legs_(legs), foot_radius_(foot_radius) {
  config_.validate();
}

void BaseEstimator::initialise(const RobotState& state) noexcept {
  Vector3 mean_accelerometer = Vector3::Zero();
  for (const SensorSample& sample : state.samples) mean_accelerometer += sample.accelerometer / kStateSamples;
  const SensorSample& now = state.now();

  state_ = BaseState{};
  const double roll = std::atan2(mean_accelerometer.y(), mean_accelerometer.z());
  const double pitch = std::atan2(-mean_accelerometer.x(), std::hypot(mean_accelerometer.y(), mean_accelerometer.z()));
  state_.R_WB = math::rotation_from_rpy({roll, pitch, 0.0});

  const bool any_on = now.contact_switch[0] || now.contact_switch[1];
  Vector3 origin = Vector3::Zero();  // W's, from B's origin, with the axes of W
  int on_ground = 0;
  for (int i = 0; i < kFeet; ++i) {
    state_.p_BF_W[i] = state_.R_WB * measure_foot(now, i, 0.0).p_BF;
    origin.head<2>() += state_.p_BF_W[i].head<2>() / kFeet;
    if (any_on && !now.contact_switch[i]) continue;
    origin.z() += state_.p_BF_W[i].z() - foot_radius_;
    ++on_ground;
  }
  origin.z() /= on_ground;
  state_.p_WB = -origin;

  const BaseEstimatorConfig& c = config_;
  ErrorVector sigma0;
  sigma0 << c.initial_tilt_sigma, c.initial_tilt_sigma, c.initial_yaw_sigma,
      Vector3::Constant(c.initial_velocity_sigma), Vector3::Constant(c.initial_position_sigma),
      Vector3::Constant(c.initial_foot_sigma), Vector3::Constant(c.initial_foot_sigma),
      Vector3::Constant(c.initial_gyro_bias_sigma), Vector3::Constant(c.initial_accelerometer_bias_sigma);
  filter_.x.setZero();
  filter_.P = sigma0.cwiseAbs2().asDiagonal();
  const Matrix3 tilt_by_bias = math::skew(Vector3::UnitZ()) * state_.R_WB / kGravity;
  const double bias_variance = squared(c.initial_accelerometer_bias_sigma);
  filter_.P.block<3, 3>(kTheta, kTheta) += bias_variance * tilt_by_bias * tilt_by_bias.transpose();
  filter_.P.block<3, 3>(kTheta, kAccelerometerBias) = bias_variance * tilt_by_bias;
  filter_.P.block<3, 3>(kAccelerometerBias, kTheta) = bias_variance * tilt_by_bias.transpose();

  contact_time_.fill(c.contact_ramp);
  rejected_time_.fill(0.0);
  in_contact_.fill(false);
  slipping_.fill(false);
  utime_ = state.utime - std::llround(kStateSamples * state.sample_period / kMicrosecond);
  initialised_ = true;
}

void BaseEstimator::step(const RobotState& state, const ContactPlan& plan, BaseEstimate& estimate) noexcept {
  if (!initialised_) initialise(state);
  nis_sum_ = 0.0;
  updates_ = 0;
  const double dt = state.sample_period;
  const double since_last = static_cast<double>(state.utime) - static_cast<double>(utime_);  // us
  const double gap = kMicrosecond * since_last - kStateSamples * dt;
  const Vector3 change =
      (state.samples.back().accelerometer - state.samples.front().accelerometer) / (kStateSamples - 1);
  const ImuMean oldest = imu_mean(state.samples.front(), Vector3::Zero(), dt);
  for (int lost = 0; lost < kMaxBridgedSamples && (lost + 0.5) * dt < gap; ++lost) advance(oldest);
  for (const SensorSample& sample : state.samples) step_sample(imu_mean(sample, change, dt), sample, plan);
  state_.R_WB = orthonormal(state_.R_WB);
  utime_ = state.utime;
  write(state.now(), estimate);
}

FootMeasurement BaseEstimator::measure_foot(const SensorSample& sample, int foot, double dt) const noexcept {
  const kinematics::LegVector q = sample.joint_position.segment<4>(4 * foot);
  const kinematics::LegVector qd = sample.joint_velocity.segment<4>(4 * foot);
  const kinematics::LegVector q_mid = q - 0.5 * dt * qd;
  FootMeasurement result;
  Eigen::Matrix<double, 3, 4> J_BF;
  kinematics::foot_in_base(legs_[foot], q, result.p_BF, J_BF);
  kinematics::foot_in_base(legs_[foot], q_mid, result.p_BF_mid, J_BF);
  result.v_BF = J_BF * qd;
  const double pitch_rate = qd[1] + qd[2] + qd[3];
  const Vector3 w_LF(qd[0], -std::sin(q_mid[0]) * pitch_rate, std::cos(q_mid[0]) * pitch_rate);
  result.w_BF = kinematics::leg_rotation() * w_LF;
  return result;
}

void BaseEstimator::advance(const ImuMean& imu) noexcept {
  const BaseEstimatorConfig& c = config_;
  const Transition transition = predict(state_, imu);
  ErrorVector q = ErrorVector::Zero();
  q.segment<3>(kTheta).setConstant(squared(c.gyro_noise) * imu.dt);
  q.segment<3>(kVelocity).setConstant(squared(c.accelerometer_noise) * imu.dt);
  q.segment<3>(kPosition).setConstant(squared(c.position_noise) * imu.dt);
  q.segment<3>(kGyroBias).setConstant(squared(c.gyro_bias_noise) * imu.dt);
  q.segment<3>(kAccelerometerBias).setConstant(squared(c.accelerometer_bias_noise) * imu.dt);
  filter_.predict_covariance([&transition](ErrorMatrix& M) { transition.multiply(M); }, q);
}

void BaseEstimator::step_sample(const ImuMean& imu, const SensorSample& sample, const ContactPlan& plan) noexcept {
  const BaseEstimatorConfig& c = config_;
  const double dt = imu.dt;
  advance(imu);

  std::array<FootMeasurement, kFeet> feet;
  for (int i = 0; i < kFeet; ++i) {
    feet[i] = measure_foot(sample, i, dt);
    in_contact_[i] = sample.contact_switch[i] && plan.stance[i];
    contact_time_[i] = in_contact_[i] ? contact_time_[i] + dt : 0.0;
    if (in_contact_[i]) state_.p_BF_W[i] += dt * rolling_velocity(state_, imu, feet[i], foot_radius_);
  }

  // Both gates before any update: each foot is judged by the prediction alone.
  std::array<Vector3, kFeet> velocity_residual;
  for (int i = 0; i < kFeet; ++i) velocity_residual[i] = gate(imu, feet[i], i);
  if (given_up(0) && given_up(1) &&
      (velocity_residual[0] - velocity_residual[1]).squaredNorm() <=
          c.slip_gate * 2.0 * squared(c.foot_velocity_sigma)) {
    forget(kVelocity, squared(kForgottenVelocity));
    slipping_.fill(false);
    rejected_time_.fill(0.0);
  }

  std::array<double, kFeet> variance_scale;
  for (int i = 0; i < kFeet; ++i) {
    const double trust =
        in_contact_[i] ? std::clamp(std::min(contact_time_[i] / c.contact_ramp, plan.load[i]), 0.0, 1.0) : 0.0;
    variance_scale[i] = 1.0 + c.ramp_gain * (1.0 - trust);
    if (in_contact_[i] && !slipping_[i]) {
      const double noise =
          stands() ? c.standing_foot_noise : c.stance_foot_noise + c.unloading_foot_noise * (1.0 - trust);
      filter_.P.diagonal().segment<3>(foot_index(i)).array() += squared(noise) * dt;
    } else {
      state_.p_BF_W[i] = state_.R_WB * feet[i].p_BF;
      forget(foot_index(i), squared(c.swing_foot_noise) * dt);
    }
  }

  for (int i = 0; i < kFeet; ++i) {
    if (!in_contact_[i]) continue;
    if (!slipping_[i] || given_up(i)) {
      update(velocity_measurement(state_, imu, feet[i], foot_radius_),
             squared(c.foot_velocity_sigma) * (slipping_[i] ? c.slip_inflation : variance_scale[i]));
    }
    update(position_measurement(state_, feet[i], i), squared(c.foot_position_sigma) * variance_scale[i]);
  }

  // A swing foot's tip is where the corrected base puts it.
  for (int i = 0; i < kFeet; ++i) {
    if (!in_contact_[i]) state_.p_BF_W[i] = state_.R_WB * feet[i].p_BF;
  }
}

Vector3 BaseEstimator::gate(const ImuMean& imu, const FootMeasurement& foot, int index) noexcept {
  bool& slipping = slipping_[index];
  double& rejected_time = rejected_time_[index];
  slipping = false;
  if (!in_contact_[index]) {
    rejected_time = 0.0;
    return Vector3::Zero();
  }
  const ErrorMeasurement velocity = velocity_measurement(state_, imu, foot, foot_radius_);
  const Matrix3 R = squared(config_.foot_velocity_sigma) * Matrix3::Identity();
  slipping = !(filter_.innovation(velocity.z, velocity.H, R).nis <= config_.slip_gate);
  if (slipping) contact_time_[index] = 0.0;
  rejected_time = std::clamp(rejected_time + (slipping ? imu.dt : -imu.dt), 0.0, config_.slip_timeout);
  return velocity.z;
}

bool BaseEstimator::given_up(int foot) const noexcept {
  return slipping_[foot] && rejected_time_[foot] >= config_.slip_timeout;
}

bool BaseEstimator::stands() const noexcept {
  return contact_time_[0] >= config_.standing_time && contact_time_[1] >= config_.standing_time;
}

void BaseEstimator::forget(int begin, double variance) noexcept {
  filter_.P.middleRows<3>(begin).setZero();
  filter_.P.middleCols<3>(begin).setZero();
  filter_.P.diagonal().segment<3>(begin).setConstant(variance);
}

void BaseEstimator::update(const ErrorMeasurement& measurement, double variance) noexcept {
  const Matrix3 R = variance * Matrix3::Identity();
  const auto innovation = stands()
                              ? filter_.update(measurement.z, measurement.H, R, kPosition, kPosition + 1, kPosition + 2)
                              : filter_.update(measurement.z, measurement.H, R, kPosition, kPosition + 1, kPosition + 2,
                                               kTheta + 2, kGyroBias + 2);
  state_ = plus(state_, filter_.x);
  filter_.x.setZero();
  nis_sum_ += innovation.nis;
  ++updates_;
}

void BaseEstimator::write(const SensorSample& now, BaseEstimate& estimate) const noexcept {
  estimate.p_WB = state_.p_WB;
  estimate.R_WB = state_.R_WB;
  estimate.v_WB = state_.v_WB;
  estimate.w_WB_W = state_.R_WB * (now.gyro - state_.gyro_bias);
  estimate.gyro_bias = state_.gyro_bias;
  estimate.accelerometer_bias = state_.accelerometer_bias;
  // v's additive error is dv - [v]x theta.
  const Matrix3 theta_part = -math::skew(state_.v_WB);
  const Matrix3 cross = theta_part * filter_.P.block<3, 3>(kTheta, kVelocity);
  const Matrix3 velocity_covariance = filter_.P.block<3, 3>(kVelocity, kVelocity) + cross + cross.transpose() +
                                      theta_part * filter_.P.block<3, 3>(kTheta, kTheta) * theta_part.transpose();
  estimate.sigma_p = sigma(filter_.P.diagonal().segment<3>(kPosition));
  estimate.sigma_v = sigma(velocity_covariance.diagonal());
  estimate.sigma_theta = sigma(filter_.P.diagonal().segment<3>(kTheta));
  for (int i = 0; i < kFeet; ++i) {
    estimate.p_WF[i] = state_.p_WB + state_.p_BF_W[i];
    estimate.contact[i] = in_contact_[i];
  }
  estimate.nis = updates_ > 0 ? nis_sum_ / (3 * updates_) : 0.0;
}

}  // namespace stance::estimation
