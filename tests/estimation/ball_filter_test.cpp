// The ball filter on simulated throws: exactness, honesty (NIS, NEES), prediction ahead, and the document's tuning.
#include "controller/estimation/ball_filter.hpp"

#include <algorithm>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace stance::estimation {
namespace {

constexpr double kFrame = 0.01;  ///< s
constexpr double kSigma = 0.01;  ///< m, of the nominal camera
constexpr int kThrows = 200;
constexpr int kSeen = 50;       ///< frames: 0.5 s of a throw of 0.8 s
constexpr double kAhead = 0.3;  ///< s
const Vector3 kG(0.0, 0.0, -kGravity);

BallFilterConfig tuned() {
  BallFilterConfig config;
  config.measurement_sigma = kSigma;
  config.acceleration_density = 1e-4;
  config.velocity_sigma = 4.0;
  config.velocity = {-4.0, 0.0, 2.0};
  return config;
}

BallFilterConfig tuned_for_drag() {
  BallFilterConfig config = tuned();
  config.drag = 0.02;
  config.drag_sigma = 0.015;
  return config;
}

struct Motion {
  Vector3 p, v;
};

/// By Heun's method at a hundredth of a frame: another rule and a finer step than the filter's.
Motion flown(Motion ball, double drag, double time) {
  constexpr double kStep = 1e-4;
  const auto steps = static_cast<int>(std::lround(time / kStep));
  const auto acceleration = [&](const Vector3& v) -> Vector3 { return kG - drag * v.norm() * v; };
  for (int i = 0; i < steps; ++i) {
    const Vector3 a = acceleration(ball.v), end = ball.v + kStep * a;
    ball.p += 0.5 * kStep * (ball.v + end);
    ball.v += 0.5 * kStep * (a + acceleration(end));
  }
  return ball;
}

class Throws {
 public:
  explicit Throws(unsigned seed) : random_(seed) {}

  /// From 2.5 to 4.5 m away, to be in reach after 0.8 s.
  Motion next() {
    constexpr double kFlight = 0.8;
    const double azimuth = uniform(-0.5, 0.5), distance = uniform(2.5, 4.5);
    const Vector3 from(distance * std::cos(azimuth), distance * std::sin(azimuth), uniform(0.9, 1.6));
    const Vector3 aim = Vector3(0.55, 0.0, 0.8) + 0.15 * noise();
    return {from, (aim - from) / kFlight - 0.5 * kG * kFlight};
  }
  Vector3 noise() { return {normal_(random_), normal_(random_), normal_(random_)}; }

 private:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct Record {
  double mean_nis = 0.0;      ///< per degree of freedom
  double mean_nees = 0.0;     ///< per degree of freedom, of (p, v) at the last frame
  double median_error = 0.0;  ///< m, of the position predicted 0.3 s ahead
  double median_sigma = 0.0;  ///< m, what the filter makes of that error
};

template <int n>
Record over_throws(const BallFilterConfig& config, double drag, double sigma = kSigma) {
  Throws throws(71);
  Record out;
  int compared = 0;
  std::vector<double> errors, sigmas;
  for (int k = 0; k < kThrows; ++k) {
    Motion ball = throws.next();
    BallFilter<n> filter(config);
    for (int frame = 0; frame < kSeen; ++frame) {
      if (frame > 0) ball = flown(ball, drag, kFrame);
      const double nis = filter.step(kFrame, ball.p + sigma * throws.noise());
      if (std::isnan(nis)) continue;
      out.mean_nis += nis;
      ++compared;
    }
    const auto now = filter.estimate();
    Eigen::Matrix<double, 6, 1> error;
    error << ball.p - now.p(), ball.v - now.v();
    const Eigen::Matrix<double, 6, 6> P = now.P.template topLeftCorner<6, 6>();
    out.mean_nees += error.dot(P.llt().solve(error)) / 6.0;
    const auto then = filter.predict(kAhead);
    errors.push_back((flown(ball, drag, kAhead).p - then.p()).norm());
    sigmas.push_back(std::sqrt(then.P.template topLeftCorner<3, 3>().trace()));
  }
  out.mean_nis /= compared;
  out.mean_nees /= kThrows;
  out.median_error = median(errors);
  out.median_sigma = median(sigmas);
  return out;
}

/// Five standard deviations of the mean of chi^2 / d over `freedom` degrees of freedom.
double chi2_bound(double freedom) { return 5.0 * std::sqrt(2.0 / freedom); }

}  // namespace

TEST_CASE("BallWithoutNoiseIsPredictedExactly") {
  Throws throws(73);
  BallFilterConfig config = tuned();
  config.measurement_sigma = 1e-6;
  for (int k = 0; k < 20; ++k) {
    Motion ball = throws.next();
    BallFilter<6> filter(config);
    const auto at = [&](double t) -> Vector3 { return ball.p + ball.v * t + 0.5 * kG * t * t; };
    for (int frame = 0; frame < kSeen; ++frame) filter.step(kFrame, at(frame * kFrame));
    const double t = (kSeen - 1) * kFrame + kAhead;
    CHECK((filter.predict(kAhead).p() - at(t)).norm() < 1e-6);
  }
}

TEST_CASE("TunedBallFilterIsHonest") {
  const Record record = over_throws<6>(tuned(), 0.0);
  CHECK(std::abs(record.mean_nis - 1.0) < chi2_bound(3.0 * kThrows * (kSeen - 1)));
  CHECK(std::abs(record.mean_nees - 1.0) < chi2_bound(6.0 * kThrows));
}

TEST_CASE("TunedBallFilterPredictsWithinItsCovarianceAndACentimetre") {
  const Record record = over_throws<6>(tuned(), 0.0);
  CHECK(record.median_error < 0.010);
  CHECK(record.median_error < record.median_sigma);
}

TEST_CASE("DocumentsProcessNoiseIsCalledTooLargeByItsInnovationsAndPredictsBadly") {
  // Q = 0.1 1 a step and R = 0.01 1, on the document's noise of 0.1 m.
  constexpr double kNoise = 0.1;
  Throws throws(71);
  double nis = 0.0;
  std::vector<double> errors;
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
  F.topRightCorner<3, 3>() = kFrame * Matrix3::Identity();
  Eigen::Matrix<double, 6, 1> Bu;
  Bu << 0.5 * kFrame * kFrame * kG, kFrame * kG;
  Eigen::Matrix<double, 3, 6> H = Eigen::Matrix<double, 3, 6>::Zero();
  H.leftCols<3>().setIdentity();
  for (int k = 0; k < kThrows; ++k) {
    Motion ball = throws.next();
    KalmanFilter<6, 3> filter;
    filter.x << ball.p, ball.v;
    for (int frame = 1; frame < kSeen; ++frame) {
      ball = flown(ball, 0.0, kFrame);
      filter.predict(F, Bu, 0.1 * Eigen::Matrix<double, 6, 6>::Identity());
      nis += filter.update(ball.p + kNoise * throws.noise(), H, kNoise * kNoise * Matrix3::Identity()).nis / 3.0;
    }
    const Vector3 predicted = filter.x.head<3>() + kAhead * filter.x.tail<3>() + 0.5 * kAhead * kAhead * kG;
    errors.push_back((flown(ball, 0.0, kAhead).p - predicted).norm());
  }
  CHECK(nis / (kThrows * (kSeen - 1)) < 0.5);
  BallFilterConfig config = tuned();
  config.measurement_sigma = kNoise;
  CHECK(median(errors) > 1.5 * over_throws<6>(config, 0.0, kNoise).median_error);
}

TEST_CASE("BallisticFilterMissesABallWithDragThatTheFilterWithDragFollows") {
  const Record ballistic = over_throws<6>(tuned(), 0.02);
  const Record with_drag = over_throws<7>(tuned_for_drag(), 0.02);
  CHECK(ballistic.mean_nees > 5.0);
  CHECK(with_drag.median_error < 0.02);
  CHECK(with_drag.median_error < 0.4 * ballistic.median_error);
  CHECK(std::abs(with_drag.mean_nis - 1.0) < chi2_bound(3.0 * kThrows * (kSeen - 1)));
  CHECK(std::abs(with_drag.mean_nees - 1.0) < chi2_bound(6.0 * kThrows));
}

TEST_CASE("KnownDragIsAsGoodAsAnExactModel") {
  BallFilterConfig config = tuned();
  config.drag = 0.02;
  const Record record = over_throws<6>(config, 0.02);
  CHECK(record.median_error < 0.010);
  CHECK(std::abs(record.mean_nees - 1.0) < chi2_bound(6.0 * kThrows));
}

TEST_CASE("CovarianceFollowsTheDerivativeOfTheMotion") {
  // A tiny covariance, carried ahead, is F P F^T with F by differences of the motion.
  BallFilterConfig config = tuned_for_drag();
  config.acceleration_density = 0.0;
  config.velocity_sigma = 1e-3;
  config.drag_sigma = 1e-4;
  config.measurement_sigma = 1e-3;
  const Vector3 p(3.0, 0.5, 1.0);
  const auto end = [&](const Eigen::Matrix<double, 7, 1>& x) {
    BallFilterConfig other = config;
    other.velocity = x.segment<3>(3);
    other.drag = x(6);
    BallFilter<7> filter(other);
    filter.step(kFrame, Vector3(x.head<3>()));
    return filter.predict(kAhead).x;
  };
  Eigen::Matrix<double, 7, 1> x;
  x << p, config.velocity, config.drag;
  Eigen::Matrix<double, 7, 7> F;
  for (int i = 0; i < 7; ++i) {
    constexpr double kStep = 1e-6;
    const Eigen::Matrix<double, 7, 1> h = kStep * Eigen::Matrix<double, 7, 1>::Unit(i);
    F.col(i) = (end(x + h) - end(x - h)) / (2.0 * kStep);
  }
  BallFilter<7> filter(config);
  filter.step(kFrame, p);
  const auto start = filter.estimate();
  CHECK((filter.predict(kAhead).P - F * start.P * F.transpose()).cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("MissingFramesAreBridgedAndTheFirstBallStarts") {
  BallFilter<6> filter(tuned());
  CHECK(std::isnan(filter.step(kFrame, std::nullopt)));
  CHECK(!filter.has_started());
  CHECK(std::isnan(filter.step(kFrame, Vector3(1.0, std::numeric_limits<double>::quiet_NaN(), 0.0))));
  CHECK(!filter.has_started());
  CHECK(std::isnan(filter.step(kFrame, Vector3(3.0, 0.0, 1.0))));
  CHECK(filter.has_started());
  const auto ahead = filter.predict(0.05);
  for (int k = 0; k < 5; ++k) filter.step(kFrame, std::nullopt);
  CHECK((filter.estimate().x - ahead.x).norm() < 1e-12);
  CHECK((filter.estimate().P - ahead.P).norm() < 1e-12);
  filter.reset();
  CHECK(!filter.has_started());
}

TEST_CASE("BallFilterConfigNamesWhatIsWrong") {
  const auto message = [](auto change) -> std::string {
    BallFilterConfig config = tuned();
    change(config);
    try {
      const BallFilter<6> filter(config);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  CHECK(message([](auto&) {}).empty());
  CHECK(message([](auto& c) { c.measurement_sigma = 0.0; }).find("measurement_sigma") != std::string::npos);
  CHECK(message([](auto& c) { c.velocity_sigma = -1.0; }).find("velocity_sigma") != std::string::npos);
  CHECK(message([](auto& c) { c.drag_sigma = 0.1; }).find("drag_sigma") != std::string::npos);
  CHECK(message([](auto& c) { c.gravity.y() = NAN; }).find("gravity") != std::string::npos);
}

TEST_CASE("SevenStatesWithADragThatIsKnownAreTheSixStatesFilter") {
  BallFilterConfig config = tuned();
  config.drag = 0.02;
  BallFilter<6> six(config);
  BallFilter<7> seven(config);
  for (int k = 0; k < 30; ++k) {
    const Vector3 z(3.0 - 0.05 * k + 0.01 * std::sin(7.0 * k), 0.01 * std::cos(5.0 * k), 1.0 + 0.02 * k);
    if (k > 0) CHECK(std::abs(seven.nis(0.01, z) - six.nis(0.01, z)) < 1e-9);
    const double foreseen = six.nis(0.01, z), nis = six.step(0.01, z);
    CHECK((std::isnan(nis) || nis == foreseen));
    static_cast<void>(seven.step(0.01, z));
    CHECK((seven.estimate().x.head<6>() - six.estimate().x).norm() < 1e-12);
    CHECK((seven.estimate().P.topLeftCorner<6, 6>() - six.estimate().P).norm() < 1e-12);
    CHECK(seven.estimate().x(6) == config.drag);
  }
}

}  // namespace stance::estimation
