// Reading URDF: what a good document gives, and that each fault is named with its remedy.
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <functional>
#include <initializer_list>
#include <numbers>
#include <string_view>

#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/support/golden.hpp"

using namespace stance;
using namespace stance::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;
using rigid_body::Model;
using rigid_body::ShapeKind;

namespace {

constexpr double kExact = 1e-12;

const std::string kInertial =
    R"(<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>)";
const std::string kLimit = R"(<limit lower="-1" upper="1" effort="10" velocity="5"/>)";

// Joined by appending: GCC 12 warns wrongly of `literal + string`.
std::string joined(std::initializer_list<std::string_view> parts) {
  std::string out;
  for (const std::string_view part : parts) out += part;
  return out;
}

std::string link_xml(std::string_view name, std::string_view content = kInertial) {
  return joined({"<link name='", name, "'>", content, "</link>"});
}

std::string joint_xml(std::string_view name, std::string_view parent, std::string_view child,
                      std::string_view content = kLimit, std::string_view type = "revolute") {
  return joined({"<joint name='", name, "' type='", type, "'><parent link='", parent, "'/><child link='", child, "'/>",
                 content, "</joint>"});
}

std::string robot_xml(std::string_view content) { return joined({"<robot name='r'>", content, "</robot>"}); }

std::string inertial_xml(std::string_view mass, std::string_view moments) {
  return joined({"<inertial><mass value='", mass, "'/><inertia ", moments, "/></inertial>"});
}

/// model_from_urdf must refuse it with a message that names the element and holds the word of the remedy.
void check_refused(const std::string& urdf, const std::vector<std::string>& order, const std::string& element,
                   const std::string& remedy) {
  CHECK_THROWS_MATCHES(rigid_body::model_from_urdf(urdf, order), std::invalid_argument,
                       MessageMatches(ContainsSubstring(element) && ContainsSubstring(remedy)));
}

const std::string kTwoLinks = link_xml("base") + link_xml("arm");
const std::string kTwoJoints = link_xml("base") + link_xml("arm") + link_xml("hand") +
                               joint_xml("shoulder", "base", "arm") + joint_xml("wrist", "arm", "hand");

}  // namespace

TEST_CASE("BipedHasTheSheetsMassesTreeAndLimits") {
  const Biped biped;
  const Model& model = biped.model;
  CHECK(model.name == "biped");
  CHECK(model.num_joints == 8);
  CHECK(std::abs(model.total_mass - 13.2) < kExact);
  CHECK(model.bodies[0].name == "trunk");
  CHECK(model.body_index("shank_r") == 7);
  for (int leg = 0; leg < 2; ++leg) {
    for (int i = 0; i < 4; ++i) CHECK(model.joints[4 * leg + i].parent == (i == 0 ? 0 : 4 * leg + i));
  }
  CHECK(model.joints[2].lower == 0.05);
  CHECK(model.joints[2].upper == 2.6);
  CHECK(model.joints[2].max_torque == 60.0);
  CHECK(model.joints[2].max_velocity == 30.0);
  CHECK(max_difference(model.joints[0].R_PJ, kinematics::leg_rotation()) < kExact);
}

TEST_CASE("FeetAreTheSpheresOfTheNamedLinksInTheirOrder") {
  const Biped biped;
  REQUIRE(biped.feet.size() == 2);
  CHECK(biped.feet[0].body == 4);
  CHECK(biped.feet[1].body == 8);
  CHECK(max_difference(biped.feet[0].tip, Vector3(0.0, 0.24, 0.0)) < kExact);
  CHECK(biped.feet[0].radius == 0.02);
  const auto swapped = rigid_body::feet_from_urdf(biped.urdf, biped.model, {"tarsus_r", "tarsus_l"});
  CHECK(swapped[0].body == 8);
}

TEST_CASE("FixedJointsMergeIntoTheirParents") {
  // The same robot with the hand's mass and foot written into the arm, and on a fixed link.
  const std::string merged =
      robot_xml(link_xml("base") + link_xml("arm", R"(<inertial><origin xyz="0 0.5 0"/><mass value="2"/>
                     <inertia ixx="2.5" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/></inertial>)") +
                joint_xml("shoulder", "base", "arm"));
  const std::string fixed = robot_xml(
      link_xml("base") + link_xml("arm") +
      link_xml(
          "hand",
          kInertial + R"(<collision><origin xyz="0 0 0.3"/><geometry><sphere radius="0.1"/></geometry></collision>)") +
      link_xml("finger", "") + link_xml("nail") + joint_xml("shoulder", "base", "arm") +
      joint_xml("grip", "arm", "hand", R"(<origin xyz="0 1 0" rpy="1.5707963267948966 0 0"/>)", "fixed") +
      joint_xml("tip", "hand", "finger", R"(<origin xyz="0 0 1"/>)", "fixed") +
      joint_xml("last", "finger", "nail", R"(<origin xyz="0 0 1"/><axis xyz="0 0 2"/>)" + kLimit));
  const Model expected = rigid_body::model_from_urdf(merged, {"shoulder"});
  const Model model = rigid_body::model_from_urdf(fixed, {"shoulder", "last"});
  CHECK(std::abs(model.bodies[1].mass - expected.bodies[1].mass) < kExact);
  CHECK(max_difference(model.bodies[1].com, expected.bodies[1].com) < kExact);
  CHECK(max_difference(model.bodies[1].inertia, expected.bodies[1].inertia) < kExact);
  // Rx(90 deg) turns the hand's z to the arm's -y.
  CHECK(model.joints[1].parent == 1);
  CHECK(max_difference(model.joints[1].p_PJ, Vector3(0.0, -1.0, 0.0)) < kExact);
  CHECK(max_difference(model.joints[1].R_PJ, math::exp_so3({0.5 * std::numbers::pi, 0.0, 0.0})) < kExact);
  CHECK(max_difference(model.joints[1].axis, Vector3(0.0, 0.0, 1.0)) < kExact);
  const auto feet = rigid_body::feet_from_urdf(fixed, model, {"hand"});
  CHECK(feet[0].body == 1);
  CHECK(max_difference(feet[0].tip, Vector3(0.0, 0.7, 0.0)) < kExact);
  const rigid_body::LinkPose finger = rigid_body::link_pose_from_urdf(fixed, model, "finger");
  CHECK(finger.body == 1);
  CHECK(max_difference(finger.T_BL.p, Vector3(0.0, 0.0, 0.0)) < kExact);
  CHECK(max_difference(finger.T_BL.R, math::exp_so3({0.5 * std::numbers::pi, 0.0, 0.0})) < kExact);
  const rigid_body::LinkPose nail = rigid_body::link_pose_from_urdf(fixed, model, "nail");
  CHECK(nail.body == 2);
  CHECK(nail.T_BL.p.isZero());
  CHECK_THROWS_MATCHES(rigid_body::link_pose_from_urdf(fixed, model, "thumb"), std::invalid_argument,
                       MessageMatches(ContainsSubstring("link 'thumb'")));
}

TEST_CASE("CollisionShapesStandInTheirBodiesOrderAndFrame") {
  const std::string shapes =
      robot_xml(link_xml("base", kInertial + R"(<collision><geometry><sphere radius="0.3"/></geometry></collision>)") +
                link_xml("arm", kInertial + R"(<collision><geometry><box size="1 2 3"/></geometry></collision>)") +
                link_xml("a_hand", R"(<collision><origin xyz="0 0 0.3" rpy="0 0 1.5707963267948966"/>
                            <geometry><cylinder radius="0.1" length="0.4"/></geometry></collision>)") +
                joint_xml("shoulder", "base", "arm") +
                joint_xml("grip", "arm", "a_hand", R"(<origin xyz="0 1 0" rpy="1.5707963267948966 0 0"/>)", "fixed"));
  const Model model = rigid_body::model_from_urdf(shapes, {"shoulder"});
  const auto read = rigid_body::collision_shapes_from_urdf(shapes, model);
  REQUIRE(read.size() == 3);
  CHECK(read[0].body == 0);
  CHECK(read[0].kind == ShapeKind::kSphere);
  CHECK(read[0].size.x() == 0.3);
  // The links of a body in the order of their names.
  CHECK(read[1].body == 1);
  CHECK(read[1].kind == ShapeKind::kCylinder);
  CHECK(read[1].size == Vector3(0.1, 0.4, 0.0));
  CHECK(max_difference(read[1].p_LS, Vector3(0.0, 0.7, 0.0)) < kExact);
  const double quarter = 0.5 * std::numbers::pi;
  CHECK(max_difference(read[1].R_LS, math::exp_so3({quarter, 0.0, 0.0}) * math::exp_so3({0.0, 0.0, quarter})) < kExact);
  CHECK(read[2].body == 1);
  CHECK(read[2].kind == ShapeKind::kBox);
  CHECK(read[2].size == Vector3(1.0, 2.0, 3.0));
  CHECK(read[2].p_LS == Vector3::Zero());
}

TEST_CASE("CollisionShapesOfAnotherKindAreRefusedByTheirLink") {
  const std::string urdf = robot_xml(
      link_xml("base", kInertial + R"(<collision><geometry><mesh filename="hand.stl"/></geometry></collision>)"));
  const Model model = rigid_body::model_from_urdf(urdf, {});
  CHECK_THROWS_MATCHES(rigid_body::collision_shapes_from_urdf(urdf, model), std::invalid_argument,
                       MessageMatches(ContainsSubstring("link 'base'") && ContainsSubstring("<box>")));
}

TEST_CASE("InertiaIsTurnedIntoTheLinkFrame") {
  const std::string turned = R"(<inertial><origin rpy="0 0 1.5707963267948966"/><mass value="1"/>
      <inertia ixx="1" iyy="2" izz="2.5" ixy="0" ixz="0" iyz="0"/></inertial>)";
  const Model model = rigid_body::model_from_urdf(robot_xml(link_xml("base", turned)), {});
  CHECK(max_difference(model.bodies[0].inertia, Vector3(2.0, 1.0, 2.5).asDiagonal().toDenseMatrix()) < kExact);
}

TEST_CASE("MalformedXmlIsRefused") {
  check_refused("<robot name=\"r\"><link", {}, "document", "does not parse");
  check_refused("", {}, "document", "does not parse");
  check_refused(robot_xml(""), {}, "document", "does not parse");
  check_refused(robot_xml(link_xml("base") + link_xml("arm")), {}, "document", "does not parse");
  check_refused(robot_xml(link_xml("base") + joint_xml("shoulder", "base", "nowhere")), {"shoulder"}, "document",
                "nowhere");
  check_refused(robot_xml(link_xml("base", "<inertial><mass value='heavy'/></inertial>")), {}, "document", "heavy");
}

TEST_CASE("NumbersThatAreNotFiniteAreRefused") {
  for (const std::string_view mass : {"nan", "inf", "1e999"}) {
    const std::string inertial = inertial_xml(mass, "ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'");
    check_refused(robot_xml(link_xml("base", inertial)), {}, "Link [base]", "mass");
  }
}

TEST_CASE("JointMissingFromTheOrderIsNamed") {
  check_refused(robot_xml(kTwoJoints), {"shoulder"}, "joint 'wrist'", "name every moving joint once");
  check_refused(robot_xml(kTwoJoints), {"shoulder", "wrist", "wrist"}, "joint 'wrist'", "name every moving joint once");
}

TEST_CASE("JointUnknownToTheDocumentIsNamed") {
  check_refused(robot_xml(kTwoJoints), {"shoulder", "wrist", "elbow"}, "joint 'elbow'", "correct the name");
}

TEST_CASE("FixedJointInTheOrderIsNamed") {
  check_refused(robot_xml(kTwoLinks + joint_xml("weld", "base", "arm", "", "fixed")), {"weld"}, "joint 'weld'",
                "take it out");
}

TEST_CASE("ChildBeforeItsParentIsNamed") {
  check_refused(robot_xml(kTwoJoints), {"wrist", "shoulder"}, "joint 'wrist'", "parents before their children");
}

TEST_CASE("JointTypesOtherThanRevoluteAndFixedAreRefused") {
  for (const std::string type : {"continuous", "prismatic", "floating", "planar"}) {
    check_refused(robot_xml(kTwoLinks + joint_xml("slide", "base", "arm", kLimit, type)), {"slide"}, "joint 'slide'",
                  "make it revolute");
  }
}

TEST_CASE("NonPositiveMassIsRefused") {
  for (const std::string_view mass : {"0", "-1"}) {
    const std::string inertial = inertial_xml(mass, "ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'");
    check_refused(robot_xml(link_xml("base", inertial)), {}, "link 'base'", "positive <mass>");
  }
  check_refused(robot_xml(link_xml("base") + link_xml("arm", "") + joint_xml("shoulder", "base", "arm")), {"shoulder"},
                "link 'arm'", "give it an <inertial>");
}

TEST_CASE("InertiaThatIsNotPositiveDefiniteIsRefused") {
  for (const std::string_view moments :
       {"ixx='0' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'", "ixx='1' iyy='-1' izz='1' ixy='0' ixz='0' iyz='0'",
        "ixx='1' iyy='1' izz='1' ixy='2' ixz='0' iyz='0'"}) {
    check_refused(robot_xml(link_xml("base", inertial_xml("1", moments))), {}, "link 'base'", "principal");
  }
}

TEST_CASE("MissingOrEmptyLimitsAreRefused") {
  check_refused(robot_xml(kTwoLinks + joint_xml("shoulder", "base", "arm", "")), {"shoulder"}, "shoulder", "limits");
  check_refused(robot_xml(kTwoLinks + joint_xml("shoulder", "base", "arm",
                                                R"(<limit lower="1" upper="1" effort="1" velocity="1"/>)")),
                {"shoulder"}, "joint 'shoulder'", "lower < upper");
  check_refused(robot_xml(kTwoLinks + joint_xml("shoulder", "base", "arm",
                                                R"(<limit lower="0" upper="1" effort="0" velocity="1"/>)")),
                {"shoulder"}, "joint 'shoulder'", "effort > 0");
}

TEST_CASE("JointWithoutAxisOrWithMimicIsRefused") {
  check_refused(robot_xml(kTwoLinks + joint_xml("shoulder", "base", "arm", R"(<axis xyz="0 0 0"/>)" + kLimit)),
                {"shoulder"}, "joint 'shoulder'", "<axis>");
  check_refused(robot_xml(kTwoJoints.substr(0, kTwoJoints.rfind("</joint>")) + R"(<mimic joint="shoulder"/></joint>)"),
                {"shoulder", "wrist"}, "joint 'wrist'", "<mimic>");
}

TEST_CASE("MoreJointsThanFitAreRefused") {
  std::string content = link_xml("l0");
  std::vector<std::string> order;
  for (int i = 0; i <= kMaxJoints; ++i) {
    const std::string parent = joined({"l", std::to_string(i)}), child = joined({"l", std::to_string(i + 1)});
    order.push_back(joined({"j", std::to_string(i)}));
    content += link_xml(child) + joint_xml(order.back(), parent, child);
  }
  check_refused(robot_xml(content), order, "joint order", joined({"at most ", std::to_string(kMaxJoints)}));
}

TEST_CASE("UnknownBodiesAndFeetAreNamed") {
  const Biped biped;
  const auto feet_of = [&](const std::string& name) {
    return rigid_body::feet_from_urdf(biped.urdf, biped.model, {name});
  };
  CHECK_THROWS_MATCHES(biped.model.body_index("tail"), std::invalid_argument,
                       MessageMatches(ContainsSubstring("'tail'")));
  CHECK_THROWS_MATCHES(feet_of("tail"), std::invalid_argument, MessageMatches(ContainsSubstring("link 'tail'")));
  CHECK_THROWS_MATCHES(feet_of("trunk"), std::invalid_argument,
                       MessageMatches(ContainsSubstring("link 'trunk'") && ContainsSubstring("<sphere>")));
}

TEST_CASE("LegGeometryComesFromTheModel") {
  const Biped biped;
  const std::array<double, 4> lengths{0.08, 0.26, 0.26, 0.24}, offsets{0.04, 0.104, 0.104, 0.108};
  for (int leg = 0; leg < 2; ++leg) {
    for (int i = 0; i < 4; ++i) {
      CHECK(std::abs(biped.legs[leg].length[i] - lengths[i]) < kExact);
      CHECK(std::abs(biped.legs[leg].com_offset[i] - offsets[i]) < kExact);
    }
    CHECK(max_difference(biped.legs[leg].p_BL, Vector3(0.0, leg == 0 ? 0.1 : -0.1, -0.1)) < kExact);
  }
}

TEST_CASE("ModelThatIsNotTwoLegsIsRefusedByName") {
  const Biped biped;
  const auto refused = [&](const std::function<void(Biped&)>& spoil, const std::string& text) {
    Biped spoiled = biped;
    spoil(spoiled);
    CAPTURE(text);
    CHECK_THROWS_MATCHES(kinematics::leg_geometries(spoiled.model, spoiled.feet), std::invalid_argument,
                         MessageMatches(ContainsSubstring(text)));
  };
  refused([](Biped& b) { b.model.num_joints = 7; }, "two legs of four joints");
  refused([](Biped& b) { b.feet.pop_back(); }, "two feet");
  refused([](Biped& b) { b.feet[1].body = 4; }, "link 'tarsus_r'");
  refused([](Biped& b) { b.feet[0].tip.x() = 0.01; }, "the foot on link 'tarsus_l'");
  refused([](Biped& b) { b.feet[0].tip.y() = -0.1; }, "links that run down");
  refused([](Biped& b) { b.model.joints[5].parent = 0; }, "joint 'q1_r' must hang");
  refused([](Biped& b) { b.model.joints[4].parent = 4; }, "joint 'q0_r' must hang");
  refused([](Biped& b) { b.model.joints[0].axis = Vector3::UnitZ(); }, "joint 'q0_l' must roll");
  refused([](Biped& b) { b.model.joints[3].axis = -Vector3::UnitZ(); }, "joint 'q3_l' must pitch");
  refused([](Biped& b) { b.model.joints[0].R_PJ.setIdentity(); }, "joint 'q0_l' must be turned");
  refused([](Biped& b) { b.model.joints[6].R_PJ = kinematics::leg_rotation(); }, "joint 'q2_r' must not be turned");
  refused([](Biped& b) { b.model.joints[2].p_PJ.z() = 0.1; }, "the origin of joint 'q2_l'");
  refused([](Biped& b) { b.model.bodies[2].com.x() = 0.1; }, "link 'thigh_l'");
}
