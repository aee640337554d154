#include "controller/estimation/base_error_state.hpp"

namespace stance::estimation {
namespace {

using math::exp_so3;
using math::skew;

Vector3 gravity_W() noexcept { return {0.0, 0.0, -kGravity}; }

/// What the mean velocity of a sample lacks of that under its mean acceleration.
Vector3 velocity_by_change(const Matrix3& R_mid, const ImuMean& imu) noexcept {
  return (imu.dt / 12.0) * (R_mid * imu.change);
}

/// R_WB at the middle of the sample that ended in `state`.
Matrix3 middle_rotation(const BaseState& state, const ImuMean& imu) noexcept {
  return state.R_WB * exp_so3(-0.5 * imu.dt * (imu.gyro - state.gyro_bias));
}

}  // namespace

BaseState plus(const BaseState& state, const ErrorVector& error) noexcept {
  const Matrix3 turn = exp_so3(error.segment<3>(kTheta));
  BaseState result;
  result.R_WB = turn * state.R_WB;
  result.v_WB = turn * state.v_WB + error.segment<3>(kVelocity);
  result.p_WB = state.p_WB + error.segment<3>(kPosition);
  for (int i = 0; i < kFeet; ++i) result.p_BF_W[i] = turn * state.p_BF_W[i] + error.segment<3>(foot_index(i));
  result.gyro_bias = state.gyro_bias + error.segment<3>(kGyroBias);
  result.accelerometer_bias = state.accelerometer_bias + error.segment<3>(kAccelerometerBias);
  return result;
}

ErrorVector minus(const BaseState& other, const BaseState& state) noexcept {
  const Matrix3 turn = other.R_WB * state.R_WB.transpose();
  ErrorVector error;
  error.segment<3>(kTheta) = math::log_so3(turn);
  error.segment<3>(kVelocity) = other.v_WB - turn * state.v_WB;
  error.segment<3>(kPosition) = other.p_WB - state.p_WB;
  for (int i = 0; i < kFeet; ++i) error.segment<3>(foot_index(i)) = other.p_BF_W[i] - turn * state.p_BF_W[i];
  error.segment<3>(kGyroBias) = other.gyro_bias - state.gyro_bias;
  error.segment<3>(kAccelerometerBias) = other.accelerometer_bias - state.accelerometer_bias;
  return error;
}

void Transition::multiply(ErrorMatrix& M) const noexcept {
  using Rows = Eigen::Matrix<double, 3, 21>;
  auto theta = M.middleRows<3>(kTheta);
  auto velocity = M.middleRows<3>(kVelocity);
  const Rows turn = turn_by_gyro_bias.lazyProduct(M.middleRows<3>(kGyroBias));
  theta -= 0.5 * turn;  // theta_mid
  const Rows change = velocity_by_theta.lazyProduct(theta) + velocity_by_turn.lazyProduct(turn) -
                      turn_by_gyro_bias.lazyProduct(M.middleRows<3>(kAccelerometerBias));
  const Rows path = dt * (velocity + 0.5 * change);
  M.middleRows<3>(kPosition) += path + (dt * velocity_by_turn).lazyProduct(theta);
  for (int i = 0; i < kFeet; ++i) M.middleRows<3>(foot_index(i)) += foot_by_turn[i].lazyProduct(turn) - path;
  velocity += change;
  theta -= 0.5 * turn;
}

Transition predict(BaseState& state, const ImuMean& imu) noexcept {
  const double dt = imu.dt;
  const Matrix3 half_turn = exp_so3(0.5 * dt * (imu.gyro - state.gyro_bias));
  const Matrix3 R_mid = state.R_WB * half_turn;
  const Vector3 acceleration = R_mid * (imu.accelerometer - state.accelerometer_bias) + gravity_W();
  const Vector3 v_mid = state.v_WB + (0.5 * dt) * acceleration - velocity_by_change(R_mid, imu);
  const Vector3 path = dt * v_mid;

  Transition transition;
  transition.turn_by_gyro_bias = dt * R_mid;
  transition.velocity_by_theta = dt * skew(gravity_W());
  transition.velocity_by_turn = -skew(v_mid);
  for (int i = 0; i < kFeet; ++i) {
    transition.foot_by_turn[i] = -skew(state.p_BF_W[i] - 0.5 * path);
    state.p_BF_W[i] -= path;
  }
  transition.dt = dt;
  state.R_WB = R_mid * half_turn;
  state.p_WB += path;
  state.v_WB += dt * acceleration;
  return transition;
}

Vector3 rolling_velocity(const BaseState& state, const ImuMean& imu, const FootMeasurement& foot,
                         double foot_radius) noexcept {
  const Vector3 w_link = middle_rotation(state, imu) * (imu.gyro - state.gyro_bias + foot.w_BF);
  return w_link.cross(Vector3(0.0, 0.0, foot_radius));
}

ErrorMeasurement velocity_measurement(const BaseState& state, const ImuMean& imu, const FootMeasurement& foot,
                                      double foot_radius) noexcept {
  const double half_dt = 0.5 * imu.dt;
  const Vector3 w = imu.gyro - state.gyro_bias;
  const Matrix3 R_mid = middle_rotation(state, imu);
  const Vector3 acceleration = R_mid * (imu.accelerometer - state.accelerometer_bias) + gravity_W();
  const Vector3 v_mid = state.v_WB - half_dt * acceleration - velocity_by_change(R_mid, imu);
  const Vector3 a_v = R_mid * (foot.v_BF + w.cross(foot.p_BF_mid));
  const Vector3 w_link = R_mid * (w + foot.w_BF);
  const Vector3 radius(0.0, 0.0, foot_radius);

  ErrorMeasurement result;
  result.z = w_link.cross(radius) - a_v - v_mid;
  const Matrix3 H_theta = -skew(w_link) * skew(radius) - half_dt * skew(gravity_W());
  result.H.middleCols<3>(kTheta) = H_theta;
  result.H.middleCols<3>(kVelocity).setIdentity();
  result.H.middleCols<3>(kGyroBias) =
      R_mid * skew(foot.p_BF_mid) - skew(radius) * R_mid + half_dt * (H_theta + skew(state.v_WB)) * R_mid;
  result.H.middleCols<3>(kAccelerometerBias) = half_dt * R_mid;
  return result;
}

ErrorMeasurement position_measurement(const BaseState& state, const FootMeasurement& foot, int index) noexcept {
  ErrorMeasurement result;
  result.z = state.R_WB * foot.p_BF - state.p_BF_W[index];
  result.H.middleCols<3>(foot_index(index)).setIdentity();
  return result;
}

}  // namespace stance::estimation
