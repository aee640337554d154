// The 5-joint arm of document 001 against its reference vectors (mm), round trips and the rigid-body core.
#include "controller/kinematics/arm5.hpp"

#include <catch2/catch_test_macros.hpp>
#include <limits>
#include <set>
#include <vector>

#include "controller/rigid_body/chain.hpp"
#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/rigid_body/book_chain.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::kinematics;

namespace {

constexpr double kMillimetre = 1e-3;
constexpr double kPosition = 1e-12;  ///< m: 1e-9 mm
constexpr double kAngle = 1e-10;     ///< rad, and entries of rotations
/// rad, of a solution near a double root, where the angle moves with the root of its argument's rounding.
constexpr double kNearDoubleRoot = 1e-7;
constexpr double kPi = std::numbers::pi;
constexpr unsigned kSeed = 59;

Arm5Geometry document_arm() {
  const YAML::Node p = load_golden("arm5_fk_ik001.json")["params"];
  const auto length = [&](const char* key) { return golden_number(p, key) * kMillimetre; };
  return {length("a1"), length("a2"), length("a3"), length("d1"), length("d2"), length("d5")};
}

rigid_body::Model arm_model() {
  return rigid_body::model_from_urdf(golden_text("arm5.urdf"), {"j1", "j2", "j3", "j4", "j5"});
}

RigidTransform metres(const Eigen::Matrix4d& T_mm) {
  RigidTransform T = rigid_transform(T_mm);
  T.p *= kMillimetre;
  return T;
}

double angle_difference(const Arm5Vector& a, const Arm5Vector& b) {
  double most = 0.0;
  for (int i = 0; i < 5; ++i) most = std::max(most, std::abs(math::unwrap(a(i) - b(i), 0.0)));
  return most;
}

/// Do the two sets hold the same solutions?
bool same_set(const Arm5Solutions& found, const std::vector<Arm5Vector>& expected, double tolerance) {
  if (found.count != static_cast<int>(expected.size())) return false;
  std::set<std::size_t> used;
  for (int k = 0; k < found.count; ++k) {
    std::size_t nearest = 0;
    for (std::size_t e = 0; e < expected.size(); ++e) {
      if (angle_difference(found.t[k], expected[e]) < angle_difference(found.t[k], expected[nearest])) nearest = e;
    }
    if (angle_difference(found.t[k], expected[nearest]) > tolerance) return false;
    used.insert(nearest);
  }
  return used.size() == expected.size();
}

Arm5Vector random_angles(Random& random) {
  Arm5Vector t;
  for (int i = 0; i < 5; ++i) t(i) = random.number(-kPi, kPi);
  return t;
}

/// How far a solution puts the tool from T.
void check_reaches(const Arm5Geometry& arm, const Arm5Solutions& found, const RigidTransform& T) {
  for (int k = 0; k < found.count; ++k) {
    const RigidTransform back = arm5_forward(arm, found.t[k]);
    CHECK(max_difference(back.p, T.p) < kPosition);
    CHECK(max_difference(back.R, T.R) < kAngle);
    CHECK((found.t[k].array() >= -kPi).all());
    CHECK((found.t[k].array() < kPi).all());
  }
}

}  // namespace

TEST_CASE("ArmOfFiveGivesExactlyTheReferenceSolutions") {
  const Arm5Geometry arm = document_arm();
  std::set<std::string> kinds;
  for (const YAML::Node& c : golden_cases(load_golden("arm5_fk_ik001.json"))) {
    const auto kind = c["kind"].as<std::string>();
    CAPTURE(kind);
    kinds.insert(kind);
    std::vector<Arm5Vector> expected;
    for (const YAML::Node& solution : c["solutions"]) expected.push_back(as_vector<5>(solution));
    if (kind == "pos_pitch") {
      const Vector3 p = golden_vector<3>(c, "p") * kMillimetre;
      const Arm5Solutions found = arm5_ik(arm, p, golden_number(c, "phi"), golden_number(c, "t5"));
      CHECK(same_set(found, expected, kAngle));
      CHECK(found.status == (expected.empty() ? Arm5Status::kUnreachable : Arm5Status::kOk));
      continue;
    }
    const RigidTransform T = metres(golden_matrix<4, 4>(c, "T"));
    const Arm5Solutions found = arm5_ik(arm, T);
    CHECK(same_set(found, expected, kAngle));
    if (c["t"]) {
      const RigidTransform forward = arm5_forward(arm, golden_vector<5>(c, "t"));
      CHECK(max_difference(forward.p, T.p) < kPosition);
      CHECK(max_difference(forward.R, T.R) < kAngle);
    }
    if (kind == "inconsistent_orientation") CHECK(found.status == Arm5Status::kOrientation);
    if (kind == "unreachable") CHECK(found.status == Arm5Status::kUnreachable);
    if (!expected.empty()) CHECK(found.status == Arm5Status::kOk);
  }
  CHECK(kinds.size() == 5);
}

TEST_CASE("ArmOfFiveGoesThereAndBackOver100000Poses") {
  const Arm5Geometry arm = document_arm();
  Random random(kSeed);
  double position = 0.0, rotation = 0.0, missed = 0.0;
  int wrong_counts = 0;
  for (int k = 0; k < 100000; ++k) {
    const Arm5Vector t = random_angles(random);
    const RigidTransform T = arm5_forward(arm, t);
    const Arm5Solutions found = arm5_ik(arm, T);
    wrong_counts += found.count != 2;
    double nearest = kPi;
    for (int s = 0; s < found.count; ++s) {
      const RigidTransform back = arm5_forward(arm, found.t[s]);
      position = std::max(position, max_difference(back.p, T.p));
      rotation = std::max(rotation, max_difference(back.R, T.R));
      nearest = std::min(nearest, angle_difference(found.t[s], t));
    }
    missed = std::max(missed, nearest);
  }
  CHECK(position < kPosition);
  CHECK(rotation < kAngle);
  CHECK(missed < kNearDoubleRoot);
  CHECK(wrong_counts == 0);
}

TEST_CASE("ArmOfFiveGoesToAPositionAtAPitchAndBackOver100000Poses") {
  const Arm5Geometry arm = document_arm();
  Random random(kSeed + 1);
  double position = 0.0, pitch = 0.0, missed = 0.0;
  for (int k = 0; k < 100000; ++k) {
    const Arm5Vector t = random_angles(random);
    const double phi = t(1) + t(2) + t(3);
    const Vector3 p = arm5_forward(arm, t).p;
    const Arm5Solutions found = arm5_ik(arm, p, phi, t(4));
    double nearest = kPi;
    for (int s = 0; s < found.count; ++s) {
      const Arm5Vector& u = found.t[s];
      position = std::max(position, max_difference(arm5_forward(arm, u).p, p));
      pitch = std::max(pitch, std::abs(math::unwrap(u(1) + u(2) + u(3) - phi, 0.0)));
      nearest = std::min(nearest, angle_difference(u, t));
    }
    missed = std::max(missed, nearest);
  }
  CHECK(position < kPosition);
  CHECK(pitch < kAngle);
  CHECK(missed < kNearDoubleRoot);
}

TEST_CASE("CoincidentRootsCountOnce") {
  const Arm5Geometry arm = document_arm();
  Random random(kSeed);
  for (int k = 0; k < 1000; ++k) {
    Arm5Vector t = random_angles(random);
    t(2) = 0.0;  // stretched: the elbow's two ways are one
    RigidTransform T = arm5_forward(arm, t);
    Arm5Solutions found = arm5_ik(arm, T);
    CHECK(found.count == 1);
    check_reaches(arm, found, T);
    t(2) = kPi;  // folded
    T = arm5_forward(arm, t);
    found = arm5_ik(arm, T);
    CHECK(found.count == 1);
    check_reaches(arm, found, T);
  }
}

TEST_CASE("ArmOfFiveIsTheRigidBodyCoresChain") {
  const rigid_body::Model model = arm_model();
  const Arm5Geometry arm = arm5_geometry(model, 0.251);
  const rigid_body::ScrewTree tree = rigid_body::screw_tree(model);
  const rigid_body::Tip tip = rigid_body::tip_on_link(model, 5, {Matrix3::Identity(), {0.0, 0.0, 0.251}});
  Random random(kSeed);
  for (int k = 0; k < 100; ++k) {
    const Arm5Vector t = random_angles(random);
    JointVector theta = JointVector::Zero();
    theta.head<5>() = t;
    const RigidTransform T =
        RigidTransform{Matrix3::Identity(), model.bodies[0].com} * rigid_body::tip_pose(tree, tip, theta);
    CHECK(max_difference(homogeneous(arm5_forward(arm, t)), homogeneous(T)) < kPosition);
  }
}

TEST_CASE("ToolsPositionMovesAsItsJacobianSays") {
  const Arm5Geometry arm = document_arm();
  constexpr double step = 1e-6, tolerance = 1e-9;
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> angle(-kPi, kPi);
  for (int trial = 0; trial < 100; ++trial) {
    Arm5Vector t;
    for (int i = 0; i < 5; ++i) t(i) = angle(random);
    const Eigen::Matrix<double, 3, 5> J = arm5_position_jacobian(arm, t);
    for (int i = 0; i < 5; ++i) {
      const Arm5Vector d = step * Arm5Vector::Unit(i);
      const Vector3 slope = (arm5_forward(arm, t + d).p - arm5_forward(arm, t - d).p) / (2.0 * step);
      CHECK((J.col(i) - slope).norm() < tolerance);
    }
  }
}

TEST_CASE("CupOfTheReferenceArmIsItsTool") {
  const Arm5Geometry arm = arm5_geometry(arm_model(), 0.251);
  for (const YAML::Node& c : golden_cases(load_golden("rnea_arm5.json"))) {
    const RigidTransform T = arm5_forward(arm, golden_vector<5>(c, "q"));
    CHECK(max_difference(T.p, golden_vector<3>(c, "cup_p")) < kPosition);
    CHECK(max_difference(T.R.col(2), golden_vector<3>(c, "cup_z")) < kAngle);
  }
}

TEST_CASE("LimitsLeaveTheSolutionsWithinThemAndElseAreTheReason") {
  const rigid_body::Model model = arm_model();
  const Arm5Geometry arm = arm5_geometry(model, 0.251);
  const Arm5Limits limits = arm5_limits(model);
  const auto within = [&](const Arm5Vector& t) {
    // A limit may lie beyond half a turn, as joint 4's does.
    for (int i = 0; i < 5; ++i) {
      const double angle = math::unwrap(t(i), 0.5 * (limits.lower(i) + limits.upper(i)));
      if (angle < limits.lower(i) || angle > limits.upper(i)) return false;
    }
    return true;
  };
  Random random(kSeed);
  int some = 0, outside = 0;
  for (int k = 0; k < 10000; ++k) {
    const RigidTransform T = arm5_forward(arm, random_angles(random));
    const Arm5Solutions all = arm5_ik(arm, T), found = arm5_ik(arm, T, limits);
    int expected = 0;
    for (int s = 0; s < all.count; ++s) expected += within(all.t[s]);
    CHECK(found.count == expected);
    CHECK(found.status == (expected > 0 ? Arm5Status::kOk : Arm5Status::kOutsideLimits));
    for (int s = 0; s < found.count; ++s) {
      CHECK((found.t[s].array() >= limits.lower.array()).all());
      CHECK((found.t[s].array() <= limits.upper.array()).all());
    }
    some += expected > 0;
    outside += expected == 0;
  }
  CHECK(some > 100);
  CHECK(outside > 100);
}

TEST_CASE("WhatIsNoPoseIsInvalid") {
  const Arm5Geometry arm = document_arm();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  RigidTransform T = arm5_forward(arm, Arm5Vector::Constant(0.3));
  CHECK(arm5_ik(arm, T).status == Arm5Status::kOk);
  CHECK(arm5_ik(arm, {1.01 * T.R, T.p}).status == Arm5Status::kInvalid);
  CHECK(arm5_ik(arm, {-T.R, T.p}).status == Arm5Status::kInvalid);
  CHECK(arm5_ik(arm, {T.R, Vector3(kNan, 0.0, 0.0)}).status == Arm5Status::kInvalid);
  CHECK(arm5_ik(arm, Vector3(0.3, 0.2, 0.3), kNan, 0.0).status == Arm5Status::kInvalid);
}

TEST_CASE("UrdfThatIsNotTheDocumentsArmIsRefusedByTheJointsName") {
  rigid_body::Model model = arm_model();
  model.joints[2].p_PJ.y() = 0.01;
  try {
    (void)arm5_geometry(model, 0.251);
    FAIL("accepted");
  } catch (const std::invalid_argument& error) {
    CHECK(std::string(error.what()).find("'j3'") != std::string::npos);
  }
}
