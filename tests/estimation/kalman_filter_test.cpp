#include "controller/estimation/kalman_filter.hpp"

#include <Eigen/Eigenvalues>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <cmath>
#include <limits>
#include <random>

namespace stance::estimation {
namespace {

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

constexpr double kExact = 1e-12;
constexpr double kSymmetry = 0.0;  // exactly

// The ball of document 001: position and velocity, gravity known, position measured.
using BallFilter = KalmanFilter<6, 3>;

struct Ball {
  static constexpr double dt = 0.01;
  BallFilter::StateMatrix F = BallFilter::StateMatrix::Identity();
  BallFilter::State Bu = BallFilter::State::Zero();
  BallFilter::MeasurementMatrix H = BallFilter::MeasurementMatrix::Zero();

  Ball() {
    const Eigen::Vector3d g(0.0, -9.81, 0.0);
    F.topRightCorner<3, 3>() = dt * Eigen::Matrix3d::Identity();
    Bu << 0.5 * dt * dt * g, dt * g;
    H.leftCols<3>().setIdentity();
  }
};

double smallest_eigenvalue(const BallFilter::StateMatrix& P) {
  return Eigen::SelfAdjointEigenSolver<BallFilter::StateMatrix>(P, Eigen::EigenvaluesOnly).eigenvalues().minCoeff();
}

}  // namespace

TEST_CASE("ScalarFilterGivesTheTextbookNumbers") {
  // x0 = 0, P0 = 1, Q = 1, R = 2, z = 3:  P- = 2, S = 4, K = 1/2, x = 3/2, P = 1, nis = 9/4.
  KalmanFilter<1, 1> filter;
  using Scalar = Eigen::Matrix<double, 1, 1>;
  filter.predict(Scalar(1.0), Scalar(0.0), Scalar(1.0));
  CHECK_THAT(filter.P(0), WithinAbs(2.0, kExact));
  const auto innovation = filter.update(Scalar(3.0), Scalar(1.0), Scalar(2.0));
  CHECK_THAT(innovation.y(0), WithinAbs(3.0, kExact));
  CHECK_THAT(innovation.S(0), WithinAbs(4.0, kExact));
  CHECK_THAT(innovation.nis, WithinAbs(2.25, kExact));
  CHECK_THAT(filter.x(0), WithinAbs(1.5, kExact));
  CHECK_THAT(filter.P(0), WithinAbs(1.0, kExact));
}

TEST_CASE("ScalarFilterSettlesAtTheRiccatiEquationsRoot") {
  // P- = P + Q, P = P- R / (P- + R): P-^2 - Q P- - Q R = 0.
  constexpr double Q = 0.3, R = 0.7;
  KalmanFilter<1, 1> filter;
  using Scalar = Eigen::Matrix<double, 1, 1>;
  for (int k = 0; k < 200; ++k) {
    filter.predict(Scalar(1.0), Scalar(0.0), Scalar(Q));
    filter.update(Scalar(0.0), Scalar(1.0), Scalar(R));
  }
  const double prior = 0.5 * (Q + std::sqrt(Q * Q + 4.0 * Q * R));
  CHECK_THAT(filter.P(0), WithinRel(prior * R / (prior + R), kExact));
}

TEST_CASE("StaticFilterIsTheLeastSquaresSolution") {
  // Without motion n updates equal weighted least squares with the prior.
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  KalmanFilter<4, 2> filter;
  Eigen::Matrix4d information = Eigen::Matrix4d::Identity();
  Eigen::Vector4d information_vector = Eigen::Vector4d::Zero();
  for (int k = 0; k < 20; ++k) {
    const Eigen::Matrix<double, 2, 4> H = Eigen::Matrix<double, 2, 4>::NullaryExpr([&] { return normal(random); });
    const Eigen::Vector2d z = Eigen::Vector2d::NullaryExpr([&] { return normal(random); });
    const Eigen::Matrix2d R = Eigen::Vector2d(0.5, 0.2).asDiagonal();
    filter.update(z, H, R);
    information += H.transpose() * R.inverse() * H;
    information_vector += H.transpose() * R.inverse() * z;
  }
  const Eigen::Matrix4d P = information.inverse();
  CHECK((filter.P - P).cwiseAbs().maxCoeff() < kExact);
  CHECK((filter.x - P * information_vector).cwiseAbs().maxCoeff() < kExact);
}

TEST_CASE("WrongStartOfTheBallIsForgottenAtThePredictedRate") {
  // Without noise the error obeys e = (I - K H) F e; here it is followed beside the filter.
  const Ball ball;
  BallFilter filter;
  filter.x << 1.0, 1.0, 1.0, 1.0, 20.0, 1.0;
  BallFilter::State truth = BallFilter::State::Zero();
  BallFilter::State error = truth - filter.x;
  const auto Q = BallFilter::StateMatrix(0.1 * BallFilter::StateMatrix::Identity());
  const Eigen::Matrix3d R = 0.01 * Eigen::Matrix3d::Identity();
  for (int k = 0; k < 100; ++k) {
    truth = ball.F * truth + ball.Bu;
    filter.predict(ball.F, ball.Bu, Q);
    const BallFilter::StateMatrix prior = filter.P;
    const auto innovation = filter.update(truth.head<3>(), ball.H, R);
    const Eigen::Matrix<double, 6, 3> K = prior * ball.H.transpose() * innovation.S.inverse();
    error = (BallFilter::StateMatrix::Identity() - K * ball.H) * ball.F * error;
    CHECK((truth - filter.x - error).cwiseAbs().maxCoeff() < 1e-10);
  }
  CHECK(error.head<3>().norm() < 0.05);
}

TEST_CASE("ConsideredStatesStayAndTheCovarianceIsThatOfTheGainUsed") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const Eigen::Matrix4d A = Eigen::Matrix4d::NullaryExpr([&] { return normal(random); });
  const Eigen::Matrix<double, 2, 4> H = Eigen::Matrix<double, 2, 4>::NullaryExpr([&] { return normal(random); });
  const Eigen::Matrix2d R = Eigen::Vector2d(0.5, 0.2).asDiagonal();
  const Eigen::Vector2d z(1.0, -2.0);
  KalmanFilter<4, 2> filter;
  filter.x << 1.0, 2.0, 3.0, 4.0;
  filter.P = A * A.transpose();
  const Eigen::Matrix4d prior = filter.P;
  Eigen::Matrix<double, 4, 2> K = prior * H.transpose() * (H * prior * H.transpose() + R).inverse();
  K.row(1).setZero();
  K.row(3).setZero();
  const Eigen::Matrix4d rest = Eigen::Matrix4d::Identity() - K * H;
  filter.update(z, H, R, 1, 3);
  CHECK(filter.x(1) == 2.0);
  CHECK(filter.x(3) == 4.0);
  CHECK(std::abs(filter.x(0) - 1.0) > 1e-3);
  CHECK((filter.P - (rest * prior * rest.transpose() + K * R * K.transpose())).cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("PredictByBlocksEqualsPredictByTheMatrix") {
  const Ball ball;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const BallFilter::StateMatrix A = BallFilter::StateMatrix::NullaryExpr([&] { return normal(random); });
  BallFilter dense, blocks;
  dense.P = blocks.P = A * A.transpose();
  const BallFilter::State q = BallFilter::State::LinSpaced(0.1, 0.6);
  dense.predict(ball.F, BallFilter::State::Zero(), q.asDiagonal());
  blocks.predict_covariance([](auto& M) { M.template topRows<3>() += Ball::dt * M.template bottomRows<3>(); }, q);
  CHECK((dense.P - blocks.P).cwiseAbs().maxCoeff() < kExact);
}

TEST_CASE("CovarianceStaysSymmetricAndPositiveOver100000Updates") {
  // Scales 1e10 apart, where P - K S K^T turns indefinite.
  const Ball ball;
  BallFilter filter;
  filter.P *= 1e4;
  const Eigen::Matrix3d R = 1e-6 * Eigen::Matrix3d::Identity();
  const BallFilter::StateMatrix Q = 1e-12 * BallFilter::StateMatrix::Identity();
  double smallest = 1.0;
  for (int k = 0; k < 100000; ++k) {
    filter.predict(ball.F, ball.Bu, Q);
    filter.update(Eigen::Vector3d::Zero(), ball.H, R);
    if (k < 100 || k % 1000 == 0) smallest = std::min(smallest, smallest_eigenvalue(filter.P));
  }
  CHECK((filter.P - filter.P.transpose()).cwiseAbs().maxCoeff() == kSymmetry);
  CHECK(smallest > 0.0);
}

TEST_CASE("NisAndNeesOfAMatchedModelLieWithinTheirChiSquaredBounds") {
  const Ball ball;
  constexpr int kRuns = 40, kSteps = 200;
  constexpr double kAccelerationNoise = 0.5;  // m/s^2/sqrt(Hz)
  constexpr double kMeasurementSigma = 0.02;  // m
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) -> Eigen::Vector3d {
    return {sigma * normal(random), sigma * normal(random), sigma * normal(random)};
  };
  BallFilter::StateMatrix Q = BallFilter::StateMatrix::Zero();
  Q.bottomRightCorner<3, 3>().diagonal().setConstant(kAccelerationNoise * kAccelerationNoise * Ball::dt);
  const Eigen::Matrix3d R = kMeasurementSigma * kMeasurementSigma * Eigen::Matrix3d::Identity();
  double nis = 0.0, nees = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    BallFilter filter;
    BallFilter::State truth;
    truth << noise(1.0), noise(1.0);
    for (int k = 0; k < kSteps; ++k) {
      truth = ball.F * truth + ball.Bu;
      truth.tail<3>() += noise(kAccelerationNoise * std::sqrt(Ball::dt));
      filter.predict(ball.F, ball.Bu, Q);
      nis += filter.update(truth.head<3>() + noise(kMeasurementSigma), ball.H, R).nis;
    }
    const BallFilter::State error = truth - filter.x;
    nees += error.dot(filter.P.llt().solve(error));
  }
  // chi^2 of many degrees of freedom is normal: mean d, variance 2 d. Five sigma, the seed being fixed.
  const double nis_freedom = 3.0 * kRuns * kSteps, nees_freedom = 6.0 * kRuns;
  CHECK(std::abs(nis - nis_freedom) < 5.0 * std::sqrt(2.0 * nis_freedom));
  CHECK(std::abs(nees - nees_freedom) < 5.0 * std::sqrt(2.0 * nees_freedom));
}

TEST_CASE("MeasurementThatIsNoNumberOrHasNoCovarianceChangesNothing") {
  const Ball ball;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  BallFilter filter;
  const BallFilter before = filter;
  CHECK(std::isnan(filter.update(Eigen::Vector3d::Ones(), ball.H, -10.0 * I).nis));
  CHECK(std::isnan(filter.update(Eigen::Vector3d::Ones(), ball.H, kNan * I).nis));
  CHECK(std::isnan(filter.update({0.0, kNan, 0.0}, ball.H, I).nis));
  CHECK(std::isnan(filter.update({kInfinity, 0.0, 0.0}, ball.H, I).nis));
  CHECK(filter.x == before.x);
  CHECK(filter.P == before.P);
}

TEST_CASE("GateSeesTheInnovationOfTheUpdate") {
  const Ball ball;
  BallFilter filter;
  const Eigen::Vector3d z(1.0, 2.0, 3.0);
  const auto asked = filter.innovation(z, ball.H, Eigen::Matrix3d::Identity());
  const auto taken = filter.update(z, ball.H, Eigen::Matrix3d::Identity());
  CHECK(asked.nis == taken.nis);
  CHECK(asked.y == taken.y);
  CHECK(asked.S == taken.S);
}

}  // namespace stance::estimation
