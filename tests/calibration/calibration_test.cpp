// Calibration against its reference vectors, its optimality and what it refuses.
#include "controller/calibration/calibration.hpp"

#include <Eigen/Geometry>
#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/golden.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::calibration;

namespace {

constexpr double kGolden = 1e-10;

std::vector<Vector3> points(const YAML::Node& c, const char* key) {
  const Eigen::MatrixXd columns = golden_matrix<3>(c, key);
  std::vector<Vector3> out;
  for (Eigen::Index i = 0; i < columns.cols(); ++i) out.push_back(columns.col(i));
  return out;
}

/// Pairs under a known transform, with noise (m) on the arm's.
struct Pairs {
  Matrix3 R = math::rotation_from_rpy({0.3, -0.7, 2.0});
  Vector3 t{1.5, -2.5, 1.2};
  std::vector<Vector3> p_K, p_A;

  Pairs(int n, double noise, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(-1.0, 1.0);
    std::normal_distribution<double> normal;
    for (int i = 0; i < n; ++i) {
      p_K.emplace_back(place(random), place(random), 2.0 + place(random));
      p_A.push_back(R * p_K.back() + t + noise * Vector3(normal(random), normal(random), normal(random)));
    }
  }
};

double rms(const Eigen::Matrix<double, 3, 4>& T, const Pairs& pairs) {
  double sum = 0.0;
  for (std::size_t i = 0; i < pairs.p_K.size(); ++i) {
    sum += (T.leftCols<3>() * pairs.p_K[i] + T.col(3) - pairs.p_A[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(pairs.p_K.size()));
}

}  // namespace

TEST_CASE("CalibrationMatchesItsReferenceVectors") {
  int planar = 0, affine = 0;
  for (const YAML::Node& c : golden_cases(load_golden("calib001.json"))) {
    const std::vector<Vector3> p_K = points(c, "P_cam"), p_A = points(c, "P_arm");
    CAPTURE(p_K.size());
    if (c["kind"].as<std::string>() == "planar_homogeneous") {
      ++planar;
      const Calibration found = calibrate(Kind::kPlanar, p_K, p_A);
      REQUIRE(found.status == Status::kOk);
      const auto T = golden_matrix<3, 3>(c, "T");
      CHECK(max_difference(found.T.topLeftCorner<2, 2>(), T.topLeftCorner<2, 2>()) < kGolden);
      CHECK(max_difference(found.T.topRightCorner<2, 1>(), T.topRightCorner<2, 1>()) < kGolden);
      CHECK(std::abs(found.rms - golden_number(c, "rms")) < kGolden);
      continue;
    }
    const Calibration rigid = calibrate(Kind::kRigid, p_K, p_A), linear = calibrate(Kind::kLinear, p_K, p_A);
    REQUIRE(rigid.status == Status::kOk);
    REQUIRE(linear.status == Status::kOk);
    CHECK(max_difference(rigid.T.leftCols<3>(), golden_matrix<3, 3>(c, "R_rigid")) < kGolden);
    CHECK(max_difference(rigid.T.col(3), golden_vector<3>(c, "t_rigid")) < kGolden);
    CHECK(std::abs(rigid.rms - golden_number(c, "rms_rigid")) < kGolden);
    CHECK(max_difference(linear.T.leftCols<3>(), golden_matrix<3, 3>(c, "T_linear3x3")) < kGolden);
    CHECK(max_difference(linear.T.col(3), Vector3(Vector3::Zero())) == 0.0);
    CHECK(std::abs(linear.rms - golden_number(c, "rms_linear")) < kGolden);
    if (!c["T_affine3x4"]) {
      CHECK(calibrate(Kind::kAffine, p_K, p_A).status == Status::kTooFew);
      continue;
    }
    ++affine;
    const Calibration found = calibrate(Kind::kAffine, p_K, p_A);
    REQUIRE(found.status == Status::kOk);
    CHECK(max_difference(found.T, golden_matrix<3, 4>(c, "T_affine3x4")) < kGolden);
    CHECK(std::abs(found.rms - golden_number(c, "rms_affine")) < kGolden);
  }
  CHECK(planar > 0);
  CHECK(affine > 0);
}

TEST_CASE("RigidFitFindsARotationWhateverTheNoise") {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    const Pairs pairs(20, 0.5, seed);
    const Calibration found = calibrate(Kind::kRigid, pairs.p_K, pairs.p_A);
    const Matrix3 R = found.T.leftCols<3>();
    CHECK(max_difference(R * R.transpose(), Matrix3(Matrix3::Identity())) < kGolden);
    CHECK(R.determinant() > 0.0);
  }
}

TEST_CASE("RigidFitOfPointsInAPlaneIsNoReflection") {
  for (unsigned seed = 1; seed <= 50; ++seed) {
    Pairs pairs(5, 0.0, seed);
    for (std::size_t i = 0; i < pairs.p_K.size(); ++i) {
      pairs.p_K[i].z() = 2.0;
      pairs.p_A[i] = pairs.R * pairs.p_K[i] + pairs.t;
    }
    const Calibration found = calibrate(Kind::kRigid, pairs.p_K, pairs.p_A);
    CHECK(max_difference(found.T.leftCols<3>(), pairs.R) < kGolden);
  }
}

TEST_CASE("NoNeighbouringRotationOrShiftFitsBetter") {
  const Pairs pairs(20, 0.002, 5);
  const Calibration found = calibrate(Kind::kRigid, pairs.p_K, pairs.p_A);
  CHECK(std::abs(found.rms - rms(found.T, pairs)) < kGolden);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double h : {-1e-4, 1e-4}) {
      Eigen::Matrix<double, 3, 4> turned = found.T, shifted = found.T;
      turned.leftCols<3>() = math::exp_so3(h * Vector3::Unit(axis)) * found.T.leftCols<3>();
      shifted(axis, 3) += h;
      CHECK(rms(turned, pairs) > found.rms);
      CHECK(rms(shifted, pairs) > found.rms);
    }
  }
}

TEST_CASE("DocumentsLinearFitCannotHoldATranslation") {
  const Pairs seen(20, 0.002, 7), held_out(20, 0.0, 8);
  const Calibration rigid = calibrate(Kind::kRigid, seen.p_K, seen.p_A);
  const Calibration linear = calibrate(Kind::kLinear, seen.p_K, seen.p_A);
  CHECK(rms(rigid.T, held_out) < 0.003);
  CHECK(rms(linear.T, held_out) > 0.3);
}

TEST_CASE("WorstPointIsNamed") {
  Pairs pairs(20, 0.001, 9);
  pairs.p_A[13].y() += 0.2;
  const Calibration found = calibrate(Kind::kRigid, pairs.p_K, pairs.p_A);
  CHECK(found.worst_point == 13);
  CHECK(std::abs(found.worst - (found * pairs.p_K[13] - pairs.p_A[13]).norm()) < kGolden);
}

TEST_CASE("PointsThatDoNotDetermineTheFitAreRefused") {
  const auto status = [](Kind kind, const Pairs& pairs) { return calibrate(kind, pairs.p_K, pairs.p_A).status; };
  Pairs line(10, 0.0, 1), plane(10, 0.0, 2), through_camera(10, 0.0, 3);
  for (int i = 0; i < 10; ++i) {
    line.p_K[i] = Vector3(0.1, 0.2, 2.0) + 0.1 * i * Vector3(1.0, -0.5, 0.3) + 1e-4 * plane.p_K[i];
    plane.p_K[i].z() = 2.0 + 1e-4 * i;
    through_camera.p_K[i].y() = 0.2 * through_camera.p_K[i].z();
  }
  CHECK(status(Kind::kRigid, line) == Status::kDegenerate);
  CHECK(status(Kind::kPlanar, line) == Status::kDegenerate);
  CHECK(status(Kind::kRigid, plane) == Status::kOk);
  CHECK(status(Kind::kPlanar, plane) == Status::kOk);
  CHECK(status(Kind::kAffine, plane) == Status::kDegenerate);
  CHECK(status(Kind::kLinear, plane) == Status::kOk);
  CHECK(status(Kind::kLinear, through_camera) == Status::kDegenerate);

  CHECK(status(Kind::kRigid, Pairs(2, 0.0, 1)) == Status::kTooFew);
  CHECK(status(Kind::kAffine, Pairs(3, 0.0, 1)) == Status::kTooFew);
  CHECK(status(Kind::kRigid, Pairs(kMaxPoints, 0.0, 1)) == Status::kOk);
  CHECK(status(Kind::kRigid, Pairs(kMaxPoints + 1, 0.0, 1)) == Status::kTooMany);
  Pairs unequal(5, 0.0, 1), no_number(5, 0.0, 1);
  unequal.p_A.pop_back();
  no_number.p_A[2].x() = std::numeric_limits<double>::quiet_NaN();
  CHECK(status(Kind::kRigid, unequal) == Status::kUnequal);
  CHECK(status(Kind::kRigid, no_number) == Status::kNotFinite);
}
