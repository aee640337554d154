#pragma once
// Collision shapes of a URDF, each on the body of the rigid_body::Model that carries it.
#include <string>
#include <vector>

#include "controller/rigid_body/model.hpp"

namespace stance::sim {

enum class ShapeKind { kBox, kSphere, kCylinder };

struct CollisionShape {
  int body = 0;  ///< body index of the model
  ShapeKind kind = ShapeKind::kSphere;
  Vector3 size = Vector3::Zero();      ///< m; box: edges; sphere: (radius, -, -); cylinder along z: (radius, length, -)
  Matrix3 R_LS = Matrix3::Identity();  ///< shape's axes in the body's link frame
  Vector3 p_LS = Vector3::Zero();      ///< m, shape's centre in the body's link frame
};

/// Every collision shape; those of links on fixed joints go to the moving body above them. Throws std::invalid_argument
/// naming the link for a shape other than box, sphere and cylinder.
std::vector<CollisionShape> collision_shapes_from_urdf(const std::string& urdf_text, const rigid_body::Model& model);

}  // namespace stance::sim
