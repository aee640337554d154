// Every Jacobian of the error-state filter against finite differences of the non-linear maps.
#include "controller/estimation/base_error_state.hpp"

#include <catch2/catch_test_macros.hpp>
#include <random>

namespace stance::estimation {
namespace {

constexpr double kStep = 1e-5;               // of the central differences
constexpr double kJacobianTolerance = 5e-5;  // F and H are exact but for terms of dt^2 |w|
constexpr double kExact = 1e-12;
constexpr double kFootRadius = 0.02;
constexpr int kCases = 50;

class RandomCase {
 public:
  explicit RandomCase(std::uint32_t seed) : random_(seed) {
    state.R_WB = math::exp_so3(vector(1.5));
    state.v_WB = vector(1.0);
    state.p_WB = vector(5.0);
    for (Vector3& p_BF_W : state.p_BF_W) p_BF_W = vector(0.8);
    state.gyro_bias = vector(0.02);
    state.accelerometer_bias = vector(0.2);
    imu = {vector(2.0), vector(5.0) + Vector3(0.0, 0.0, kGravity), vector(5.0), 0.005};
    foot = {vector(0.8), vector(0.8), vector(1.0), vector(3.0)};
  }

  Vector3 vector(double size) { return {size * uniform_(random_), size * uniform_(random_), size * uniform_(random_)}; }
  ErrorVector error(double size) {
    return ErrorVector::NullaryExpr([&] { return size * uniform_(random_); });
  }

  BaseState state;
  ImuMean imu;
  FootMeasurement foot;

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
};

/// d map(plus(state, error)) / d error, map giving a vector of `rows`.
template <int rows, class Map>
Eigen::Matrix<double, rows, 21> differences(const BaseState& state, const Map& map) {
  Eigen::Matrix<double, rows, 21> J;
  for (int j = 0; j < 21; ++j) {
    const ErrorVector e = kStep * ErrorVector::Unit(j);
    J.col(j) = (map(plus(state, e)) - map(plus(state, -e))) / (2.0 * kStep);
  }
  return J;
}

}  // namespace

TEST_CASE("MinusUndoesPlus") {
  for (std::uint32_t seed = 0; seed < kCases; ++seed) {
    RandomCase c(seed);
    const ErrorVector error = c.error(0.5);
    CHECK((minus(plus(c.state, error), c.state) - error).cwiseAbs().maxCoeff() < kExact);
  }
}

TEST_CASE("TransitionIsThePredictionsJacobian") {
  for (std::uint32_t seed = 0; seed < kCases; ++seed) {
    const RandomCase c(seed);
    BaseState next = c.state;
    ErrorMatrix F = ErrorMatrix::Identity();
    predict(next, c.imu).multiply(F);
    const auto differenced = differences<21>(c.state, [&](BaseState state) {
      predict(state, c.imu);
      return minus(state, next);
    });
    CHECK((F - differenced).cwiseAbs().maxCoeff() < kJacobianTolerance);
  }
}

TEST_CASE("RollingWhichFLeavesOutMovesTheFootLessThanAThousandthOfTheTilt") {
  constexpr double kLeftOut = 1e-3;
  for (std::uint32_t seed = 0; seed < kCases; ++seed) {
    const RandomCase c(seed);
    const auto differenced = differences<3>(c.state, [&](const BaseState& state) {
      // In the error's terms: against the foot that turns with theta.
      const Vector3 u = rolling_velocity(state, c.imu, c.foot, kFootRadius);
      const Vector3 u0 = rolling_velocity(c.state, c.imu, c.foot, kFootRadius);
      return Vector3(c.imu.dt * (u - state.R_WB * c.state.R_WB.transpose() * u0));
    });
    CHECK(differenced.cwiseAbs().maxCoeff() < kLeftOut);
  }
}

TEST_CASE("VelocityMeasurementsJacobianIsItsDerivativeWhereTheResidualVanishes") {
  for (std::uint32_t seed = 0; seed < kCases; ++seed) {
    RandomCase c(seed);
    c.state.v_WB += velocity_measurement(c.state, c.imu, c.foot, kFootRadius).z;
    const ErrorMeasurement measurement = velocity_measurement(c.state, c.imu, c.foot, kFootRadius);
    CHECK(measurement.z.norm() < kExact);
    const auto differenced = differences<3>(
        c.state, [&](const BaseState& state) { return velocity_measurement(state, c.imu, c.foot, kFootRadius).z; });
    CHECK((measurement.H + differenced).cwiseAbs().maxCoeff() < kJacobianTolerance);
  }
}

TEST_CASE("PositionMeasurementsJacobianIsItsDerivativeWhereTheResidualVanishes") {
  for (std::uint32_t seed = 0; seed < kCases; ++seed) {
    RandomCase c(seed);
    for (int i = 0; i < kFeet; ++i) {
      c.state.p_BF_W[i] = c.state.R_WB * c.foot.p_BF;
      const ErrorMeasurement measurement = position_measurement(c.state, c.foot, i);
      CHECK(measurement.z.norm() < kExact);
      const auto differenced =
          differences<3>(c.state, [&](const BaseState& state) { return position_measurement(state, c.foot, i).z; });
      CHECK((measurement.H + differenced).cwiseAbs().maxCoeff() < kJacobianTolerance);
    }
  }
}

TEST_CASE("YawIsUnobservableWhateverTheEstimate") {
  // A turn of everything about the vertical passes F unchanged and shows in no measurement, residuals or not.
  for (std::uint32_t seed = 0; seed < kCases; ++seed) {
    const RandomCase c(seed);
    ErrorMatrix M = ErrorMatrix::Zero();
    M(kTheta + 2, 0) = 1.0;
    BaseState next = c.state;
    predict(next, c.imu).multiply(M);
    ErrorVector yaw = M.col(0);
    yaw.segment<3>(kPosition).setZero();  // the place where the run ends turns with it
    CHECK((yaw - ErrorVector::Unit(kTheta + 2)).cwiseAbs().maxCoeff() < kExact);
    const auto velocity = velocity_measurement(c.state, c.imu, c.foot, kFootRadius);
    CHECK((velocity.H * ErrorVector::Unit(kTheta + 2)).cwiseAbs().maxCoeff() < kExact);
    CHECK(position_measurement(c.state, c.foot, 0).H.middleCols<9>(kTheta).isZero());
  }
}

}  // namespace stance::estimation
