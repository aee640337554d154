// What joins the closed-form leg to the rigid-body model.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "controller/kinematics/leg.hpp"

namespace stance::kinematics {
namespace {

constexpr int kLegJoints = 4;
constexpr double kAlignment = 1e-9;  ///< m and 1: what may differ from the document's leg, for decimals in a URDF

void require(bool fits, const std::string& element, const std::string& rule) {
  if (!fits) throw std::invalid_argument("leg: " + element + " " + rule);
}

bool near(const Matrix3& a, const Matrix3& b) { return (a - b).cwiseAbs().maxCoeff() < kAlignment; }
bool near(const Vector3& a, const Vector3& b) { return (a - b).cwiseAbs().maxCoeff() < kAlignment; }

/// How far down the link p lies. Throws where p is off the link's y axis.
double along_link(const Vector3& p, const std::string& element) {
  require(near(p, Vector3(0.0, p.y(), 0.0)), element, "must lie on the y axis of its link");
  return p.y();
}

LegGeometry leg_geometry(const rigid_body::Model& model, const rigid_body::Foot& foot, int first_joint) {
  LegGeometry leg;
  for (int i = 0; i < kLegJoints; ++i) {
    const int j = first_joint + i;
    const rigid_body::Joint& joint = model.joints[j];
    const std::string element = "joint '" + joint.name + "'";
    require(joint.parent == (i == 0 ? 0 : j), element,
            i == 0 ? "must hang on the base" : "must hang on the link of the joint before it");
    require(near(joint.axis, i == 0 ? Vector3::UnitX() : Vector3::UnitZ()), element,
            i == 0 ? "must roll about x" : "must pitch about z");
    require(near(joint.R_PJ, i == 0 ? leg_rotation() : Matrix3::Identity()), element,
            i == 0 ? "must be turned by -90 deg about the base's x" : "must not be turned in its parent");
    if (i == 0) {
      leg.p_BL = joint.p_PJ;
    } else {
      leg.length[i - 1] = along_link(joint.p_PJ, "the origin of " + element);
    }
    const rigid_body::Body& body = model.bodies[j + 1];
    leg.com_offset[i] = along_link(body.com, "the centre of mass of link '" + body.name + "'");
  }
  const int last_body = first_joint + kLegJoints;
  const std::string& last_name = model.bodies[last_body].name;
  require(foot.body == last_body, "the foot", "must be on link '" + last_name + "'");
  leg.length[kLegJoints - 1] = along_link(foot.tip, "the foot on link '" + last_name + "'");
  const double shortest = *std::min_element(leg.length.begin(), leg.length.end());
  require(shortest > 0.0, "the leg that ends in link '" + last_name + "'", "must have links that run down, along y");
  return leg;
}

/// The diagonal of biped_effective_inertia with the trunk upright.
Matrix3 upright_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet, const JointVector& q,
                        const std::array<bool, 2>& held) noexcept {
  rigid_body::State state;
  state.q = q;
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(model, state, kinematics);
  const Matrix3 inertia = biped_effective_inertia(model, feet, state, kinematics, held);
  return inertia.diagonal().asDiagonal();
}

}  // namespace

std::array<LegGeometry, 2> leg_geometries(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet) {
  require(model.num_joints == 2 * kLegJoints, "model '" + model.name + "'", "must have two legs of four joints");
  require(feet.size() == 2, "model '" + model.name + "'", "must have two feet");
  return {leg_geometry(model, feet[0], 0), leg_geometry(model, feet[1], kLegJoints)};
}

Matrix3 biped_effective_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet,
                                const rigid_body::State& state, const rigid_body::Kinematics& kinematics,
                                const std::array<bool, 2>& held) noexcept {
  const auto num_held = std::count(held.begin(), held.end(), true);
  rigid_body::ConstraintRows rows;
  rows.setZero(num_held + kLegJoints * (2 - num_held), 6 + 2 * kLegJoints);
  std::array<rigid_body::Foot, 2> held_feet;
  std::size_t num_feet = 0;
  int row = 0;
  for (int leg = 0; leg < 2; ++leg) {
    const int first = 6 + kLegJoints * leg;
    if (held[leg]) {
      held_feet[num_feet++] = feet[leg];
      const double q0 = state.q[kLegJoints * leg];
      const Vector3 pitch_axis_W = state.R_WB * Vector3(0.0, std::cos(q0), std::sin(q0));
      rows.row(row).head<3>() = pitch_axis_W.transpose();
      rows.row(row++).segment<kLegJoints - 1>(first + 1).setOnes();
    } else {
      rows.block<kLegJoints, kLegJoints>(row, first).setIdentity();
      row += kLegJoints;
    }
  }
  return rigid_body::effective_inertia(model, state, kinematics, std::span(held_feet).first(num_feet), rows);
}

Matrix3 standing_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet,
                         const JointVector& q) noexcept {
  return upright_inertia(model, feet, q, {true, true});
}

Matrix3 stepping_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet,
                         const JointVector& q) noexcept {
  return 0.5 * (upright_inertia(model, feet, q, {true, false}) + upright_inertia(model, feet, q, {false, true}));
}

}  // namespace stance::kinematics
