// Laws of rotations, rigid transforms, twists and wrenches.
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include "controller/math/se3.hpp"
#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;

namespace {

constexpr double kExact = 1e-13;
/// log near pi: the axis comes from a rotation that is known to 1e-16 only, at an angle where it is ill known.
constexpr double kNearPi = 1e-8;
/// Roll-pitch-yaw up to pitch 1.5 rad, where asin has lost a digit or two.
constexpr double kRollPitchYaw = 1e-11;
/// Of a tiny rotation, relative: its matrix holds it to the last bit.
constexpr double kTiny = 1e-12;
constexpr unsigned kSeed = 11;
constexpr int kCases = 200;

const double kAngles[] = {
    0.0, 1e-300, 1e-20, 1e-12, 1e-9, 1e-7, 1e-5, 0.9e-3, 1e-3, 1.1e-3, 0.01, 0.5, 1.5, 3.0, std::numbers::pi - 1e-3};
const double kAnglesNearPi[] = {std::numbers::pi - 1e-6, std::numbers::pi - 1e-10, std::numbers::pi - 1e-15};

Vector3 random_direction(Random& random) { return random.vector(1.0).normalized(); }

RigidTransform random_transform(Random& random) { return {math::exp_so3(random.vector(2.0)), random.vector(2.0)}; }

Vector6 random_six(Random& random) {
  Vector6 V;
  V << random.vector(2.0), random.vector(2.0);
  return V;
}

}  // namespace

TEST_CASE("RotationLogInvertsExpAtEveryAngle") {
  Random random(kSeed);
  for (const double angle : kAngles) {
    const Vector3 v = angle * random_direction(random);
    CAPTURE(angle);
    CHECK((math::log_so3(math::exp_so3(v)) - v).norm() <= kExact * std::max(1.0, 1.0 / (std::numbers::pi - angle)));
  }
}

TEST_CASE("RotationExpInvertsLogUpToHalfATurn") {
  Random random(kSeed);
  for (const double angle : kAnglesNearPi) {
    const Matrix3 R = math::exp_so3(angle * random_direction(random));
    CAPTURE(angle);
    const Vector3 v = math::log_so3(R);
    CHECK(max_difference(math::exp_so3(v), R) < kExact);
    CHECK(v.norm() <= std::numbers::pi + kExact);
    CHECK(std::abs(v.norm() - angle) < kNearPi);
  }
  for (const Vector3& axis : {Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(0, 0, 1), Vector3(0.6, 0, -0.8)}) {
    const Matrix3 half_turn = 2.0 * axis * axis.transpose() - Matrix3::Identity();
    CHECK(max_difference(math::exp_so3(math::log_so3(half_turn)), half_turn) < kExact);
  }
}

TEST_CASE("RotationExpIsARotationAndTheMatrixExponential") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const Vector3 v = random.vector(4.0);
    const Matrix3 R = math::exp_so3(v);
    CHECK(max_difference(R * R.transpose(), Matrix3::Identity()) < kExact);
    CHECK(max_difference(R, math::skew(v).exp()) < kExact);
  }
}

TEST_CASE("TinyRotationKeepsItsRelativePrecision") {
  const Vector3 v(3e-12, -4e-12, 1e-12);
  CHECK((math::log_so3(math::exp_so3(v)) - v).norm() < kTiny * v.norm());
}

TEST_CASE("RollPitchYawInvertsItsRotation") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const Vector3 rpy(random.number(-3.0, 3.0), random.number(-1.5, 1.5), random.number(-3.0, 3.0));
    const Matrix3 R = math::rotation_from_rpy(rpy);
    const Matrix3 expected =
        math::rotation_z(rpy.z()) * math::exp_so3({0, rpy.y(), 0}) * math::exp_so3({rpy.x(), 0, 0});
    CHECK(max_difference(R, expected) < kExact);
    CHECK(max_difference(math::rpy_from_rotation(R), rpy) < kRollPitchYaw);
  }
}

TEST_CASE("UnwrapFindsTheNearestTurn") {
  constexpr double turn = 2.0 * std::numbers::pi;
  CHECK(std::abs(math::unwrap(0.1, 3.0 * turn) - (0.1 + 3.0 * turn)) < kExact);
  CHECK(std::abs(math::unwrap(3.1, -3.1) - (3.1 - turn)) < kExact);
  CHECK(math::unwrap(0.3, 0.2) == 0.3);
}

TEST_CASE("TransformLogInvertsExpAtEveryAngle") {
  Random random(kSeed);
  for (const double angle : kAngles) {
    Vector6 V;
    V << angle * random_direction(random), random.vector(2.0);
    CAPTURE(angle);
    CHECK((math::log_se3(math::exp_se3(V)) - V).norm() <=
          4.0 * kExact * std::max(1.0, 1.0 / (std::numbers::pi - angle)));
  }
}

TEST_CASE("TransformExpInvertsLogUpToHalfATurn") {
  Random random(kSeed);
  for (const double angle : kAnglesNearPi) {
    Vector6 V;
    V << angle * random_direction(random), random.vector(2.0);
    const RigidTransform T = math::exp_se3(V);
    const RigidTransform back = math::exp_se3(math::log_se3(T));
    CAPTURE(angle);
    CHECK(max_difference(homogeneous(back), homogeneous(T)) < kExact);
  }
}

TEST_CASE("TransformExpIsTheMatrixExponential") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    // Down to tiny angles, across the change from series to quotients.
    const double size = std::pow(10.0, random.number(-6.0, 0.5));
    Vector6 V;
    V << random.vector(size), random.vector(2.0);
    Eigen::Matrix4d se3 = Eigen::Matrix4d::Zero();
    se3.topLeftCorner<3, 3>() = math::skew(V.head<3>());
    se3.topRightCorner<3, 1>() = V.tail<3>();
    CHECK(max_difference(homogeneous(math::exp_se3(V)), se3.exp()) < 10.0 * kExact);
  }
}

TEST_CASE("TransformComposesInvertsAndMovesPoints") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const RigidTransform T = random_transform(random), U = random_transform(random);
    CHECK(max_difference(homogeneous(T * U), homogeneous(T) * homogeneous(U)) < kExact);
    CHECK(max_difference(homogeneous(T * T.inverse()), Eigen::Matrix4d::Identity()) < kExact);
    const Vector3 p = random.vector(1.0);
    CHECK(max_difference((T * U) * p, T * (U * p)) < kExact);
  }
}

TEST_CASE("AdjointIsAHomomorphismThatConjugatesExp") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const RigidTransform T = random_transform(random), U = random_transform(random);
    const Vector6 V = random_six(random);
    CHECK(max_difference(math::adjoint(T * U), math::adjoint(T) * math::adjoint(U)) < 100.0 * kExact);
    const RigidTransform conjugate = T * math::exp_se3(V) * T.inverse();
    CHECK(max_difference(homogeneous(math::exp_se3(math::adjoint_times(T, V))), homogeneous(conjugate)) <
          100.0 * kExact);
  }
}

TEST_CASE("ProductsWithoutMatricesEqualThoseWithThem") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const RigidTransform T = random_transform(random);
    const Vector6 V = random_six(random), W = random_six(random);
    CHECK(max_difference(math::adjoint_times(T, V), math::adjoint(T) * V) < kExact);
    CHECK(max_difference(math::adjoint_inverse_times(T, V), math::adjoint(T.inverse()) * V) < kExact);
    CHECK(max_difference(math::adjoint_transpose_times(T, V), math::adjoint(T).transpose() * V) < kExact);
    CHECK(max_difference(math::lie_bracket_times(V, W), math::lie_bracket(V) * W) < kExact);
    CHECK(max_difference(math::lie_bracket_transpose_times(V, W), math::lie_bracket(V).transpose() * W) < kExact);
  }
}

TEST_CASE("LieBracketIsTheDerivativeOfTheAdjoint") {
  constexpr double kStep = 1e-6, kDifference = 1e-8;
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const Vector6 V = random_six(random);
    const Matrix6 derivative =
        (math::adjoint(math::exp_se3(V * kStep)) - math::adjoint(math::exp_se3(V * -kStep))) / (2.0 * kStep);
    CHECK(max_difference(derivative, math::lie_bracket(V)) < kDifference);
  }
}

TEST_CASE("LeftJacobianInverseIsTheDerivativeOfTheLogarithm") {
  constexpr double kStep = 1e-6, kDifference = 1e-8;
  Random random(kSeed);
  for (const double angle : {0.0, 1e-9, 1e-3, 0.00999, 0.01001, 0.5, 1.5, 3.0}) {
    const Vector3 v = angle * random_direction(random);
    CAPTURE(angle);
    const Matrix3 R = math::exp_so3(v);
    Matrix3 derivative;
    for (int c = 0; c < 3; ++c) {
      const Vector3 h = kStep * Vector3::Unit(c);
      derivative.col(c) = (math::log_so3(math::exp_so3(h) * R) - math::log_so3(math::exp_so3(-h) * R)) / (2.0 * kStep);
    }
    CHECK(max_difference(math::left_jacobian_inverse_so3(v), derivative) < kDifference);
  }
}

TEST_CASE("PowerIsTheSameInEveryFrame") {
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const RigidTransform T_ab = random_transform(random);
    const Vector6 V_b = random_six(random), F_a = random_six(random);
    const double power_a = F_a.dot(math::adjoint_times(T_ab, V_b));
    CHECK(std::abs(power_a - math::adjoint_transpose_times(T_ab, F_a).dot(V_b)) < 10.0 * kExact);
  }
}
