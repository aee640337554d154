#include "controller/estimation/base_error_state.hpp"

namespace stance::estimation {
namespace {

using math::exp_so3;
using math::skew;

Vector3 gravity_W() noexcept { return {0.0, 0.0, -kGravity}; }

/// R_WB at the middle of the sample that ended in `state`.
Matrix3 middle_rotation(const BaseState& state, const ImuMean& imu) noexcept {
  return state.R_WB * exp_so3(-0.5 * imu.dt * (imu.gyro - state.gyro_bias));
}

template <int begin>
auto rows(ErrorMatrix& M) {
  return M.middleRows<3>(begin);
}

}  // namespace

BaseState plus(const BaseState& state, const ErrorVector& error) noexcept {
  BaseState result = state;
  result.R_WB = exp_so3(error.segment<3>(kTheta)) * state.R_WB;
  result.v_WB += error.segment<3>(kVelocity);
  result.p_WB += error.segment<3>(kPosition);
  for (int i = 0; i < kFeet; ++i) result.p_WF[i] += error.segment<3>(foot_index(i));
  result.gyro_bias += error.segment<3>(kGyroBias);
  result.accelerometer_bias += error.segment<3>(kAccelerometerBias);
  return result;
}

ErrorVector minus(const BaseState& other, const BaseState& state) noexcept {
  ErrorVector error;
  error.segment<3>(kTheta) = math::log_so3(other.R_WB * state.R_WB.transpose());
  error.segment<3>(kVelocity) = other.v_WB - state.v_WB;
  error.segment<3>(kPosition) = other.p_WB - state.p_WB;
  for (int i = 0; i < kFeet; ++i) error.segment<3>(foot_index(i)) = other.p_WF[i] - state.p_WF[i];
  error.segment<3>(kGyroBias) = other.gyro_bias - state.gyro_bias;
  error.segment<3>(kAccelerometerBias) = other.accelerometer_bias - state.accelerometer_bias;
  return error;
}

void Transition::multiply(ErrorMatrix& M) const noexcept {
  using Rows = Eigen::Matrix<double, 3, 21>;
  auto theta = rows<kTheta>(M);
  auto v = rows<kVelocity>(M);
  auto p = rows<kPosition>(M);
  const Rows half_turn = (0.5 * theta_by_gyro_bias).lazyProduct(rows<kGyroBias>(M));
  theta += half_turn;  // theta_mid
  const Rows dv = v_by_theta.lazyProduct(theta) + v_by_accelerometer_bias.lazyProduct(rows<kAccelerometerBias>(M));
  p += dt * v + (0.5 * dt) * dv;
  v += dv;
  theta += half_turn;
}

Transition predict(BaseState& state, const ImuMean& imu) noexcept {
  const double dt = imu.dt;
  const Vector3 half_angle = 0.5 * dt * (imu.gyro - state.gyro_bias);
  const Matrix3 half_turn = exp_so3(half_angle);
  const Matrix3 R_mid = state.R_WB * half_turn;
  const Vector3 specific_force_W = R_mid * (imu.accelerometer - state.accelerometer_bias);
  const Vector3 acceleration = specific_force_W + gravity_W();
  state.R_WB = R_mid * half_turn;
  state.p_WB += dt * state.v_WB + (0.5 * dt * dt) * acceleration;
  state.v_WB += dt * acceleration;
  return {-dt * R_mid, -dt * skew(specific_force_W), -dt * R_mid, dt};
}

Vector3 rolling_velocity(const BaseState& state, const ImuMean& imu, const FootMeasurement& foot,
                         double foot_radius) noexcept {
  const Vector3 w_link = middle_rotation(state, imu) * (imu.gyro - state.gyro_bias + foot.w_BF);
  return w_link.cross(Vector3(0.0, 0.0, foot_radius));
}

ErrorMeasurement velocity_measurement(const BaseState& state, const ImuMean& imu, const FootMeasurement& foot,
                                      double foot_radius) noexcept {
  const Vector3 w = imu.gyro - state.gyro_bias;
  const Matrix3 R_mid = middle_rotation(state, imu);
  const Vector3 specific_force_W = R_mid * (imu.accelerometer - state.accelerometer_bias);
  const Vector3 v_mid = state.v_WB - (0.5 * imu.dt) * (specific_force_W + gravity_W());
  const Vector3 a_v = R_mid * (foot.v_BF + w.cross(foot.p_BF_mid));
  const Vector3 w_link = R_mid * (w + foot.w_BF);
  const Vector3 radius(0.0, 0.0, foot_radius);

  ErrorMeasurement result;
  result.z = w_link.cross(radius) - a_v - v_mid;
  const Matrix3 H_theta = -skew(a_v) + (0.5 * imu.dt) * skew(specific_force_W) - skew(radius) * skew(w_link);
  result.H.middleCols<3>(kTheta) = H_theta;
  result.H.middleCols<3>(kVelocity).setIdentity();
  result.H.middleCols<3>(kGyroBias) =
      R_mid * skew(foot.p_BF_mid) - skew(radius) * R_mid + (0.5 * imu.dt) * H_theta * R_mid;
  result.H.middleCols<3>(kAccelerometerBias) = (0.5 * imu.dt) * R_mid;
  return result;
}

ErrorMeasurement position_measurement(const BaseState& state, const FootMeasurement& foot, int index) noexcept {
  const Vector3 c = state.R_WB * foot.p_BF;
  ErrorMeasurement result;
  result.z = c - (state.p_WF[index] - state.p_WB);
  result.H.middleCols<3>(kTheta) = skew(c);
  result.H.middleCols<3>(kPosition) = -Matrix3::Identity();
  result.H.middleCols<3>(foot_index(index)).setIdentity();
  return result;
}

void multiply_by_clone(const BaseState& state, const FootMeasurement& foot, int index, ErrorMatrix& M) noexcept {
  const Matrix3 theta_part = -skew(state.R_WB * foot.p_BF);
  M.middleRows<3>(foot_index(index)) = rows<kPosition>(M) + theta_part.lazyProduct(rows<kTheta>(M));
}

}  // namespace stance::estimation
