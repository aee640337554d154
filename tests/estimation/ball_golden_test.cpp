// The ball of document 001 against ball_kf001.json: tests/golden holds its first run, the reference set all four.
#include <catch2/catch_test_macros.hpp>

#include "controller/estimation/kalman_filter.hpp"
#include "tests/support/golden.hpp"

namespace stance::estimation {

TEST_CASE("BallFilterEqualsTheReferenceVectors") {
  constexpr double kTolerance = 1e-10;
  const YAML::Node golden = test::load_golden("ball_kf001.json");
  for (const YAML::Node& run : test::golden_cases(golden)) {
    const double dt = test::golden_number(run, "dt");
    const Eigen::Vector3d g(0.0, test::golden_number(run, "g"), 0.0);
    KalmanFilter<6, 3> filter;
    filter.x = test::golden_vector<6>(run, "x0");
    filter.P = test::golden_matrix<6, 6>(run, "P0");
    const Eigen::Matrix<double, 6, 6> Q = test::golden_matrix<6, 6>(run, "Q");
    const Eigen::Matrix3d R = test::golden_matrix<3, 3>(run, "R");
    Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
    F.topRightCorner<3, 3>() = dt * Eigen::Matrix3d::Identity();
    Eigen::Matrix<double, 6, 1> Bu;
    Bu << 0.5 * dt * dt * g, dt * g;
    Eigen::Matrix<double, 3, 6> H = Eigen::Matrix<double, 3, 6>::Zero();
    H.leftCols<3>().setIdentity();
    const YAML::Node steps = run["steps"];
    const YAML::Node z = run["z"];
    REQUIRE(steps.size() > 0);
    for (std::size_t k = 0; k < steps.size(); ++k) {
      filter.predict(F, Bu, Q);
      CHECK(test::max_difference(filter.x, test::golden_vector<6>(steps[k], "x_prior")) < kTolerance);
      CHECK(test::max_difference(filter.P, test::golden_matrix<6, 6>(steps[k], "P_prior")) < kTolerance);
      const auto innovation = filter.update(test::as_vector<3>(z[k]), H, R);
      CHECK(test::max_difference(innovation.y, test::golden_vector<3>(steps[k], "innov")) < kTolerance);
      CHECK(test::max_difference(filter.x, test::golden_vector<6>(steps[k], "x")) < kTolerance);
      CHECK(test::max_difference(filter.P, test::golden_matrix<6, 6>(steps[k], "P")) < kTolerance);
    }
  }
}

}  // namespace stance::estimation
