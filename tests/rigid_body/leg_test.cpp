// The closed-form leg: reference vectors, finite differences, the rigid-body tree, its inverse and its mirror image.
#include <Eigen/Dense>
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/support/golden.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::kinematics;

namespace {

constexpr double kGolden = 1e-10;
constexpr double kExact = 1e-12;
constexpr double kInverse = 1e-9;   ///< m or rad, round trips away from the stretched leg
constexpr double kSingular = 1e-7;  ///< m or rad, at the stretched or folded leg: acos near +-1 loses half the digits
constexpr double kStep = 1e-6;      ///< rad, of central differences
constexpr double kDifference = 1e-9;
constexpr unsigned kSeed = 37;
constexpr int kCases = 200;

using Jacobian34 = Eigen::Matrix<double, 3, 4>;

LegVector random_angles(Random& random) {
  return {random.number(-0.8, 0.8), random.number(-1.9, 1.0), random.number(0.05, 2.6), random.number(-2.4, 0.6)};
}

LegKinematics kinematics_of_leg(const LegGeometry& leg, const LegVector& q) {
  LegKinematics out;
  leg_kinematics(leg, q, out);
  return out;
}

/// Links of four different lengths, so that no term can hide behind another.
LegGeometry uneven_leg() {
  LegGeometry leg;
  leg.length = {0.07, 0.31, 0.22, 0.15};
  leg.com_offset = {0.03, 0.13, 0.12, 0.05};
  leg.p_BL = {0.02, 0.09, -0.11};
  return leg;
}

}  // namespace

TEST_CASE("LegReproducesTheReferenceTransformsMassCentresAndJacobians") {
  const YAML::Node file = load_golden("leg000.json");
  for (const YAML::Node& c : golden_cases(file)) {
    LegGeometry leg;
    const Eigen::Vector4d length = golden_vector<4>(c, "L"), com_offset = golden_vector<4>(c, "l");
    for (int i = 0; i < 4; ++i) {
      leg.length[i] = length(i);
      leg.com_offset[i] = com_offset(i);
    }
    const LegKinematics k = kinematics_of_leg(leg, golden_vector<4>(c, "q"));
    const auto com = golden_matrix<4, 3>(c, "com");
    for (int i = 0; i < 4; ++i) {
      const std::string number = std::to_string(i);
      CHECK(max_difference(k.T_L[i], golden_matrix<4, 4>(c, "T_org_" + number)) < kGolden);
      CHECK(max_difference(k.com[i], com.row(i).transpose()) < kGolden);
      CHECK(max_difference(k.J_com[i], golden_matrix<6, 4>(c, "J_" + number)) < kGolden);
    }
    CHECK(max_difference(k.J_foot, golden_matrix<6, 4>(c, "J_EE")) < kGolden);
    CHECK(max_difference(k.foot, golden_matrix<4, 4>(c, "T_org_3").topRightCorner<3, 1>()) < kGolden);
  }
}

TEST_CASE("LegJacobiansAreTheDerivativesOfPositionsAndOrientations") {
  const LegGeometry leg = uneven_leg();
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const LegVector q = random_angles(random);
    const LegKinematics now = kinematics_of_leg(leg, q);
    for (int c = 0; c < 4; ++c) {
      const LegKinematics after = kinematics_of_leg(leg, q + kStep * LegVector::Unit(c));
      const LegKinematics before = kinematics_of_leg(leg, q - kStep * LegVector::Unit(c));
      const auto difference = [](const Vector3& a, const Vector3& b) -> Vector3 { return (a - b) / (2.0 * kStep); };
      for (int i = 0; i < 4; ++i) {
        const Matrix3 turn = after.T_L[i].topLeftCorner<3, 3>() * before.T_L[i].topLeftCorner<3, 3>().transpose();
        CHECK(max_difference(now.J_com[i].col(c).head<3>(), difference(after.com[i], before.com[i])) < kDifference);
        CHECK(max_difference(now.J_com[i].col(c).tail<3>(), math::log_so3(turn) / (2.0 * kStep)) < kDifference);
      }
      CHECK(max_difference(now.J_foot.col(c).head<3>(), difference(after.foot, before.foot)) < kDifference);
      Vector3 p_after, p_before, p_BF;
      Jacobian34 J_BF, unused;
      foot_in_base(leg, q, p_BF, J_BF);
      foot_in_base(leg, q + kStep * LegVector::Unit(c), p_after, unused);
      foot_in_base(leg, q - kStep * LegVector::Unit(c), p_before, unused);
      CHECK(max_difference(J_BF.col(c), difference(p_after, p_before)) < kDifference);
    }
  }
}

TEST_CASE("ClosedFormLegsAgreeWithTheRigidBodyTree") {
  const Biped biped;
  const Matrix3 R_BL = leg_rotation();
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    rigid_body::State state;  // B at W
    state.q << random_angles(random), random_angles(random);
    const rigid_body::Kinematics tree = kinematics_of(biped.model, state);
    for (int side = 0; side < 2; ++side) {
      const LegGeometry& leg = biped.legs[side];
      const LegVector q = state.q.segment<4>(4 * side);
      const LegKinematics closed = kinematics_of_leg(leg, q);
      const rigid_body::Foot& foot = biped.feet[side];
      const Vector3 p_foot = tree.p_W[foot.body] + tree.R_W[foot.body] * foot.tip;
      Vector3 p_BF;
      Jacobian34 J_BF;
      foot_in_base(leg, q, p_BF, J_BF);
      CHECK(max_difference(p_BF, p_foot) < kExact);
      CHECK(max_difference(leg.p_BL + R_BL * closed.foot, p_foot) < kExact);

      const auto check_jacobian = [&](int body, const Vector3& p, const LegJacobian& expected) {
        rigid_body::Jacobian J;
        rigid_body::geometric_jacobian(biped.model, state, tree, body, p, J);
        const Eigen::Matrix<double, 6, 4> own = J.middleCols<4>(6 + 4 * side);
        CHECK(max_difference(R_BL * expected.topRows<3>(), own.bottomRows<3>()) < kExact);
        CHECK(max_difference(R_BL * expected.bottomRows<3>(), own.topRows<3>()) < kExact);
      };
      check_jacobian(foot.body, p_foot, closed.J_foot);
      for (int i = 0; i < 4; ++i) {
        const int body = 4 * side + i + 1;
        CHECK(max_difference(leg.p_BL + R_BL * closed.com[i], tree.com_W[body]) < kExact);
        CHECK(max_difference(R_BL * closed.T_L[i].topLeftCorner<3, 3>(), tree.R_W[body]) < kExact);
        check_jacobian(body, tree.com_W[body], closed.J_com[i]);
      }
    }
  }
}

TEST_CASE("LegsAreMirrorImages") {
  const Biped biped;
  const Vector3 mirror(1.0, -1.0, 1.0);
  const LegVector mirror_joints(-1.0, 1.0, 1.0, 1.0);
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const LegVector q = random_angles(random);
    Vector3 p_left, p_right;
    Jacobian34 J_left, J_right;
    foot_in_base(biped.legs[0], q, p_left, J_left);
    foot_in_base(biped.legs[1], mirror_joints.cwiseProduct(q), p_right, J_right);
    CHECK(max_difference(p_right, mirror.cwiseProduct(p_left)) < kExact);
    CHECK(max_difference(J_right, mirror.asDiagonal() * J_left * mirror_joints.asDiagonal()) < kExact);
    // The inverse too: a foot mirrored in the leg's own plane.
    const Vector3 p_LF = kinematics_of_leg(biped.legs[0], q).foot;
    LegVector q_left, q_right;
    const double pitch_sum = q.tail<3>().sum();
    CHECK(leg_ik(biped.legs[0], p_LF, pitch_sum, q_left) ==
          leg_ik(biped.legs[1], {p_LF.x(), p_LF.y(), -p_LF.z()}, pitch_sum, q_right));
    CHECK(max_difference(q_right, mirror_joints.cwiseProduct(q_left)) < kExact);
  }
}

TEST_CASE("InverseKinematicsReturnsTheAnglesOfAReachableFoot") {
  const Biped biped;
  Random random(kSeed);
  int tried = 0;
  for (const LegGeometry& leg : {biped.legs[0], uneven_leg()}) {
    for (int k = 0; k < kCases; ++k) {
      const LegVector q = random_angles(random);
      const LegKinematics forward = kinematics_of_leg(leg, q);
      // With the foot above the roll axis in the leg's plane the other roll angle is meant.
      if (forward.foot.y() / std::cos(q(0)) < 0.05) continue;
      ++tried;
      LegVector inverse;
      CHECK(leg_ik(leg, forward.foot, q.tail<3>().sum(), inverse) == LegIkStatus::kOk);
      CHECK(max_difference(inverse, q) < kInverse);
    }
  }
  CHECK(tried > kCases);
}

TEST_CASE("InverseKinematicsPutsTheFootOnTheTargetWithTheKneeForward") {
  const Biped biped;
  const LegGeometry& leg = biped.legs[0];
  constexpr double kPitchSum = -0.25;
  Random random(kSeed);
  int reached = 0;
  for (int k = 0; k < kCases; ++k) {
    const Vector3 target(random.number(-0.4, 0.4), random.number(0.35, 0.85), random.number(-0.3, 0.3));
    LegVector q;
    if (leg_ik(leg, target, kPitchSum, q) != LegIkStatus::kOk) continue;
    ++reached;
    CHECK(max_difference(kinematics_of_leg(leg, q).foot, target) < kInverse);
    CHECK(q(2) >= 0.0);
    CHECK(std::abs(q.tail<3>().sum() - kPitchSum) < kExact);
  }
  CHECK(reached > kCases / 2);
}

TEST_CASE("FootTooFarIsSaidAndTheLegStretchesTowardsIt") {
  const LegGeometry leg = uneven_leg();
  constexpr double kPitchSum = 0.1;
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const Vector3 target = random.vector(1.0) + Vector3(0.0, 2.5, 0.0);
    LegVector q;
    REQUIRE(leg_ik(leg, target, kPitchSum, q) == LegIkStatus::kTooFar);
    CHECK(std::abs(q(2)) < kSingular);
    // The foot is in the target's plane, short of it on the line along which the hip's pitch axis sees the ankle.
    const Vector3 foot = kinematics_of_leg(leg, q).foot;
    const Vector3 missing = target - foot;
    const Vector3 pitch_axis = leg.length[0] * Vector3(0.0, std::cos(q(0)), std::sin(q(0)));
    const LegKinematics at = kinematics_of_leg(leg, q);
    const Vector3 thigh = at.T_L[2].topRightCorner<3, 1>() - pitch_axis;
    CHECK(missing.cross(thigh).norm() < kSingular);
    CHECK(missing.dot(thigh) > 0.0);
  }
}

TEST_CASE("FootTooNearIsSaidAndTheLegFolds") {
  const LegGeometry leg = uneven_leg();
  constexpr double kPitchSum = 0.0;
  // The ankle 1 cm below the hip's pitch axis, less than L1 - L2 = 9 cm.
  const Vector3 target(0.0, leg.length[0] + leg.length[3] + 0.01, 0.0);
  LegVector q;
  CHECK(leg_ik(leg, target, kPitchSum, q) == LegIkStatus::kTooNear);
  const Vector3 expected(0.0, leg.length[0] + leg.length[3] + (leg.length[1] - leg.length[2]), 0.0);
  CHECK(max_difference(kinematics_of_leg(leg, q).foot, expected) < kSingular);
}

TEST_CASE("InverseKinematicsStaysFiniteForEveryFiniteTarget") {
  const Biped biped;
  const LegGeometry& leg = biped.legs[0];
  const Vector3 pitch_axis(0.0, leg.length[0] + leg.length[3], 0.0);  // the ankle exactly on it
  for (const Vector3& target : {Vector3(0, 0, 0), pitch_axis, Vector3(0, -1, 0), Vector3(1e300, 1e300, 1e300),
                                Vector3(1e-300, 0, 0), Vector3(-1e308, 1.7e308, -1.7e308)}) {
    for (const LegGeometry& shape : {leg, uneven_leg()}) {
      LegVector q;
      (void)leg_ik(shape, target, 0.0, q);
      CAPTURE(target.transpose());
      CHECK(q.allFinite());
    }
  }
}

TEST_CASE("NullDirectionIsAUnitVectorThatLeavesTheFoot") {
  const Biped biped;
  Random random(kSeed);
  for (int k = 0; k < kCases; ++k) {
    const LegKinematics at = kinematics_of_leg(biped.legs[0], random_angles(random));
    const LegVector n = null_direction(at.J_foot);
    CHECK(std::abs(n.norm() - 1.0) < kExact);
    CHECK((at.J_foot.topRows<3>() * n).norm() < kExact);
    CHECK(n(2) >= 0.0);
  }
  // Stretched: the null space has more dimensions.
  const LegKinematics straight = kinematics_of_leg(biped.legs[0], LegVector::Zero());
  const LegVector n = null_direction(straight.J_foot);
  CHECK(std::abs(n.norm() - 1.0) < kExact);
  CHECK((straight.J_foot.topRows<3>() * n).norm() < kExact);
}
