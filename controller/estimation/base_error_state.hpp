#pragma once
// The base's state and its error: the maps of the error-state filter and their Jacobians.
//
// State: R = R_WB, v = v_WB, p = p_WB, the tips of the feet from B d_i = p_BF_W (left, right), gyro bias b_g and
// accelerometer bias b_a (in B). Error, 21 = 7 x 3, in this order, theta to d_i in W:
//   R_true = exp([theta]x) R        v_true = exp([theta]x) v + dv        p_true = p + dp
//   d_true = exp([theta]x) d + dd_left, dd_right        b_true = b + db_g, db_a
// v and d turn with theta (the right-invariant error of Hartley et al., IJRR 2020): no derivative by theta below holds
// an estimated motion, so that noise cannot make the yaw and the accelerometer's bias look observed. With the additive
// error it does: the filter is sure of a yaw that drifts with the gyro's bias.
//
// A sample of `dt` seconds brings means (gyro, accelerometer, joint velocity) and, at its end, joint positions. A mean
// stands for the sample's middle, so that the filter does not lag: with w = gyro - b_g, s = accelerometer - b_a, R_mid
// at the middle
//   predict    a = R_mid s + g     R = R exp([w dt]x)     p += v_mid dt    d -= v_mid dt (the foot stays)    v += a dt
//              v_mid: the mean velocity, of an acceleration that grows by R_mid c over the sample, c that of s:
//              v_mid = v + a dt/2 - R_mid c dt/12. Without c a walk at 1.2 m/s would turn the pitch by 0.2 mrad/s
//   F          turn = dt R_mid db_g                       theta_mid = theta - turn/2
//              change = dt [g]x theta_mid - [v_mid]x turn - dt R_mid db_a
//              dp += dt (dv + change/2) - dt [v_mid]x theta_mid      (p does not turn: it is in no measurement)
//              dd -= dt (dv + change/2) + [d_mid]x turn        dv += change        theta -= turn
//   rolling    the tip is the centre of a sphere of radius r: u = w_link x (0, 0, r); a stance foot moves by u dt.
//              F leaves out how u varies with the tilt: r dt |w| = 1e-4 m/rad
//   noise      of the gyro turns v and d too: left out beside their own, 2e-4 |d| next to 3e-3 m/sqrt(s)
//   velocity   the point of the sphere on the ground rests: z = u - a_v - v_mid = 0,  v_mid = v - a dt/2 - R_mid c
//   dt/12,
//              a_v = R_mid (J qd + w x c),  w_link = R_mid (w + w_BF)
//              H: theta_mid: -[w_link]x [r]x - dt/2 [g]x    dv: I    db_g: R_mid [c]x - [r]x R_mid + dt/2 [v]x R_mid
//                 db_a: dt/2 R_mid    with theta_mid = theta + turn/2    [r]x = skew(0, 0, r)
//   position   z = R c - d = 0         H: dd: I
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
  Vector3 v_WB = Vector3::Zero();                                       ///< m/s
  Vector3 p_WB = Vector3::Zero();                                       ///< m
  std::array<Vector3, kFeet> p_BF_W{Vector3::Zero(), Vector3::Zero()};  ///< m, tips
  Vector3 gyro_bias = Vector3::Zero();                                  ///< rad/s, in B
  Vector3 accelerometer_bias = Vector3::Zero();                         ///< m/s^2, in B
};

/// The state that is `error` away from `state`.
BaseState plus(const BaseState& state, const ErrorVector& error) noexcept;
/// The error that leads from `state` to `other`: plus(state, minus(other, state)) = other.
ErrorVector minus(const BaseState& other, const BaseState& state) noexcept;

/// Means over a sample, in B.
struct ImuMean {
  Vector3 gyro = Vector3::Zero();           ///< rad/s
  Vector3 accelerometer = Vector3::Zero();  ///< m/s^2
  Vector3 change = Vector3::Zero();         ///< m/s^2, of the accelerometer from the sample's start to its end
  double dt = 0.0;                          ///< s
};

/// What the encoders of one leg say over a sample, in B.
struct FootMeasurement {
  Vector3 p_BF = Vector3::Zero();      ///< m, at the sample's end
  Vector3 p_BF_mid = Vector3::Zero();  ///< m, at its middle
  Vector3 v_BF = Vector3::Zero();      ///< m/s, J qd at its middle
  Vector3 w_BF = Vector3::Zero();      ///< rad/s, of the foot's link against B, at its middle
};

/// F of one sample, by its blocks.
struct Transition {
  Matrix3 turn_by_gyro_bias = Matrix3::Zero();                                ///< dt R_mid
  Matrix3 velocity_by_theta = Matrix3::Zero();                                ///< dt [g]x
  Matrix3 velocity_by_turn = Matrix3::Zero();                                 ///< -[v_mid]x
  std::array<Matrix3, kFeet> foot_by_turn{Matrix3::Zero(), Matrix3::Zero()};  ///< -[d_mid]x
  double dt = 0.0;                                                            ///< s

  /// M = F M in place.
  void multiply(ErrorMatrix& M) const noexcept;
};

/// One sample ahead; the feet stay where they are in W.
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
/// The stance foot's tip is where it was: the joints say where that is from B.
ErrorMeasurement position_measurement(const BaseState& state, const FootMeasurement& foot, int index) noexcept;

}  // namespace stance::estimation
