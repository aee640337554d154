#pragma once
// A robot as a tree of rigid bodies, read from URDF. Body 0 is the base; body i (i >= 1) hangs on joint i-1, and joints
// stand in the order that the caller names, which must put a parent before its children.
#include <array>
#include <string>
#include <vector>

#include "controller/interface/signals.hpp"
#include "controller/math/se3.hpp"

namespace stance::rigid_body {

inline constexpr int kMaxBodies = kMaxJoints + 1;

/// One rigid body, in its own link frame (URDF's: at the joint, for the base B).
struct Body {
  std::string name;
  double mass = 0.0;                  ///< kg
  Vector3 com = Vector3::Zero();      ///< m, centre of mass in the link frame
  Matrix3 inertia = Matrix3::Zero();  ///< kg m^2, about the centre of mass, axes of the link frame
};

/// A revolute joint: T_parent_child(q) = (R_PJ exp([axis] q), p_PJ).
struct Joint {
  std::string name;
  int parent = 0;                      ///< body index
  Matrix3 R_PJ = Matrix3::Identity();  ///< child's link frame at q = 0 in the parent's link frame
  Vector3 p_PJ = Vector3::Zero();      ///< m
  Vector3 axis = Vector3::UnitZ();     ///< unit vector in the child's link frame
  double lower = 0.0;                  ///< rad
  double upper = 0.0;                  ///< rad
  double max_velocity = 0.0;           ///< rad/s
  double max_torque = 0.0;             ///< N m
};

/// A spherical contact (point foot): the first sphere collision shape of a leaf body.
struct Foot {
  int body = 0;                   ///< body index
  Vector3 tip = Vector3::Zero();  ///< m, the sphere's centre in the link frame
  double radius = 0.0;            ///< m
};

/// A link's frame where it is fixed to a body, such as a tool's.
struct LinkPose {
  int body = 0;         ///< body index
  RigidTransform T_BL;  ///< coordinates in the link's frame to those in the body's link frame
};

enum class ShapeKind { kBox, kSphere, kCylinder };

/// What of a body can touch.
struct CollisionShape {
  int body = 0;  ///< body index
  ShapeKind kind = ShapeKind::kSphere;
  Vector3 size = Vector3::Zero();      ///< m; box: edges; sphere: (radius, -, -); cylinder along z: (radius, length, -)
  Matrix3 R_LS = Matrix3::Identity();  ///< shape's axes in the body's link frame
  Vector3 p_LS = Vector3::Zero();      ///< m, shape's centre in the body's link frame
};

struct Model {
  std::string name;
  int num_joints = 0;
  std::array<Body, kMaxBodies> bodies;   ///< num_joints + 1 in use
  std::array<Joint, kMaxJoints> joints;  ///< joint i carries body i + 1
  double total_mass = 0.0;               ///< kg

  int num_bodies() const { return num_joints + 1; }
  int body_index(const std::string& link) const;  ///< throws std::invalid_argument that names the link
};

/// Reads URDF text. Fixed joints are merged into their parents. `joint_order` names every moving joint once. The base
/// needs its mass too, also where nothing will move it. Not for two threads at once: the parser's message handler is
/// global. Throws std::invalid_argument, naming the element and the remedy, for: malformed XML, a joint that is missing
/// from or unknown to the order, a child before its parent, a joint type other than revolute and fixed, a non-positive
/// mass, an inertia that is not positive definite, missing or empty limits, a zero axis, <mimic>, more than kMaxJoints
/// joints.
Model model_from_urdf(const std::string& urdf_text, const std::vector<std::string>& joint_order);

/// The point feet named by `links`, in that order; a link on fixed joints is found in the body that carries it. Throws
/// std::invalid_argument where a link is unknown or has no sphere collision shape.
std::vector<Foot> feet_from_urdf(const std::string& urdf_text, const Model& model,
                                 const std::vector<std::string>& links);

/// Of the link `name`, by the fixed joints that carry it. Throws std::invalid_argument where it is unknown.
LinkPose link_pose_from_urdf(const std::string& urdf_text, const Model& model, const std::string& name);

/// Every collision shape, in the order of the bodies that carry them. Throws std::invalid_argument naming the link for
/// a shape other than box, sphere and cylinder.
std::vector<CollisionShape> collision_shapes_from_urdf(const std::string& urdf_text, const Model& model);

}  // namespace stance::rigid_body
