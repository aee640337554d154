#pragma once
// The base's state and its error: the maps of the error-state filter and their Jacobians.
//
// State: R_WB, v_WB, p_WB, the feet's tips p_WF (left, right), gyro bias b_g and accelerometer bias b_a (in B).
// Error, 21 = 7 x 3: (theta, v, p, f_left, f_right, b_g, b_a), additive but for R_true = exp([theta]x) R, theta in W.
//
// A sample of `dt` seconds brings means (gyro, accelerometer, joint velocity) and, at its end, joint positions. A mean
// stands for the sample's middle, so that the filter lags nothing: with w = gyro - b_g, s = accelerometer - b_a, R_mid
// at the middle
//   predict    a = R_mid s + g        R = R exp(w dt)        p += v dt + a dt^2/2        v += a dt
//   F          theta' = theta - R_mid dt b_g        dv = -[R_mid s]x dt theta_mid - R_mid dt b_a
//              v' = v + dv        p' = p + dt v + dt/2 dv        theta_mid = (theta + theta')/2        all else
//              unchanged
//   rolling    the tip is the centre of a sphere of radius r: u = w_link x (0, 0, r); a stance foot moves by u dt.
//              F leaves out how u varies with the error: r dt = 1e-4 m/rad
//   velocity   the point of the sphere on the ground rests: 0 = v_mid + a_v - u,  v_mid = v - a dt/2,
//              a_v = R_mid (J qd + w x c),  w_link = R_mid (w + w_BF)
//              H: theta_mid: -[a_v]x + dt/2 [R_mid s]x - [r]x [w_link]x    v: I    b_g: R_mid [c]x - [r]x R_mid
//                 b_a: dt/2 R_mid    with theta_mid = theta + R_mid dt/2 b_g    [r]x = skew(0, 0, r)
//   position   0 = f - p - R c
//              H: theta: [R c]x    p: -I    f: I
#include <Eigen/Core>
#include <array>

#include "controller/estimation/kalman_filter.hpp"
#include "controller/math/so3.hpp"

namespace stance::estimation {

inline constexpr int kFeet = 2;

using ErrorFilter = KalmanFilter<21, 3>;
using ErrorVector = ErrorFilter::State;
using ErrorMatrix = ErrorFilter::StateMatrix;

/// Where the error's parts begin.
inline constexpr int kTheta = 0;               ///< rad, in W
inline constexpr int kVelocity = 3;            ///< m/s
inline constexpr int kPosition = 6;            ///< m
inline constexpr int kFoot = 9;                ///< m, the right foot's 3 further
inline constexpr int kGyroBias = 15;           ///< rad/s, in B
inline constexpr int kAccelerometerBias = 18;  ///< m/s^2, in B
constexpr int foot_index(int foot) { return kFoot + 3 * foot; }

struct BaseState {
  Matrix3 R_WB = Matrix3::Identity();
  Vector3 v_WB = Vector3::Zero();                                     ///< m/s
  Vector3 p_WB = Vector3::Zero();                                     ///< m
  std::array<Vector3, kFeet> p_WF{Vector3::Zero(), Vector3::Zero()};  ///< m, tips
  Vector3 gyro_bias = Vector3::Zero();                                ///< rad/s, in B
  Vector3 accelerometer_bias = Vector3::Zero();                       ///< m/s^2, in B
};

/// The state that is `error` away from `state`.
BaseState plus(const BaseState& state, const ErrorVector& error) noexcept;
/// The error that leads from `state` to `other`: plus(state, minus(other, state)) = other.
ErrorVector minus(const BaseState& other, const BaseState& state) noexcept;

/// Means over a sample, in B.
struct ImuMean {
  Vector3 gyro = Vector3::Zero();           ///< rad/s
  Vector3 accelerometer = Vector3::Zero();  ///< m/s^2
  double dt = 0.0;                          ///< s
};

/// What the encoders of one leg say over a sample, in B.
struct FootMeasurement {
  Vector3 p_BF = Vector3::Zero();      ///< m, at the sample's end
  Vector3 p_BF_mid = Vector3::Zero();  ///< m, at its middle
  Vector3 v_BF = Vector3::Zero();      ///< m/s, J qd at its middle
  Vector3 w_BF = Vector3::Zero();      ///< rad/s, of the foot's link against B, at its middle
};

/// F of one sample, by its blocks: it is the identity but for the rows of theta, v and p.
struct Transition {
  Matrix3 theta_by_gyro_bias = Matrix3::Zero();
  Matrix3 v_by_theta = Matrix3::Zero();
  Matrix3 v_by_accelerometer_bias = Matrix3::Zero();
  double dt = 0.0;  ///< s

  /// M = F M in place.
  void multiply(ErrorMatrix& M) const noexcept;
};

/// One sample ahead; feet stay where they are.
Transition predict(BaseState& state, const ImuMean& imu) noexcept;

/// u: the velocity of a rolling foot's tip [m/s, in W], of the state at the sample's end.
Vector3 rolling_velocity(const BaseState& state, const ImuMean& imu, const FootMeasurement& foot,
                         double foot_radius) noexcept;

/// A measurement in the error's terms: z = H error + noise.
struct ErrorMeasurement {
  Vector3 z = Vector3::Zero();
  ErrorFilter::MeasurementMatrix H = ErrorFilter::MeasurementMatrix::Zero();
};

/// The stance foot's ground point rests.
ErrorMeasurement velocity_measurement(const BaseState& state, const ImuMean& imu, const FootMeasurement& foot,
                                      double foot_radius) noexcept;
/// The stance foot's tip is where it was.
ErrorMeasurement position_measurement(const BaseState& state, const FootMeasurement& foot, int index) noexcept;

/// M = G M in place, G the error's map when foot `index` is put anew at its tip, f = p + R c: f' = p - [R c]x theta.
void multiply_by_clone(const BaseState& state, const FootMeasurement& foot, int index, ErrorMatrix& M) noexcept;

}  // namespace stance::estimation
