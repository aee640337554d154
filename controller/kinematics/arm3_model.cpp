// What joins document 004's arm to the rigid-body model.
#include <stdexcept>
#include <string>

#include "controller/kinematics/arm3.hpp"

namespace stance::kinematics {
namespace {

constexpr int kJoints = 3;
constexpr double kAlignment = 1e-9;  ///< m and 1: what may differ from the document's arm, for decimals in a URDF

void require(bool fits, const std::string& element, const std::string& rule) {
  if (!fits) throw std::invalid_argument("arm of document 004: " + element + " " + rule);
}

template <typename Matrix>
bool near(const Matrix& a, const Matrix& b) {
  return (a - b).cwiseAbs().maxCoeff() < kAlignment;
}

/// How far up p lies. Throws where it is off the z axis.
double up(const Vector3& p, const std::string& element) {
  require(near(p, Vector3(0.0, 0.0, p.z())) && p.z() >= 0.0, element, "must stand on its parent's z axis, upward");
  return p.z();
}

}  // namespace

Arm3Geometry arm3_geometry(const rigid_body::Model& model, const rigid_body::LinkPose& tool) {
  require(model.num_joints == kJoints, "the robot", "must have 3 joints");
  double height[kJoints];
  for (int i = 0; i < kJoints; ++i) {
    const rigid_body::Joint& joint = model.joints[static_cast<std::size_t>(i)];
    const std::string element = "joint '" + joint.name + "'";
    require(joint.parent == i, element,
            i == 0 ? "must hang on the base" : "must hang on the link of the one before it");
    require(near(joint.R_PJ, Matrix3(Matrix3::Identity())), element, "must not be turned in its parent");
    require(near(joint.axis, Vector3(i == 0 ? Vector3::UnitZ() : Vector3::UnitX())), element,
            i == 0 ? "must turn about z" : "must turn about x");
    height[i] = up(joint.p_PJ, element);
  }
  require(tool.body == kJoints, "the tool", "must be on the last joint's link");
  const Arm3Geometry arm{height[0] + height[1], height[2], up(tool.T_BL.p, "the tool")};
  require(near(tool.T_BL.R, arm3_forward(arm, Vector3::Zero()).R), "the tool", "must be turned as A(0) has it");
  return arm;
}

}  // namespace stance::kinematics
