#include "sim/shapes.hpp"

#include <urdf_parser/urdf_parser.h>

#include <stdexcept>

namespace stance::sim {
namespace {

struct Pose {
  Matrix3 R = Matrix3::Identity();
  Vector3 p = Vector3::Zero();
};

Pose from_urdf(const urdf::Pose& pose) {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  return {Quaternion(w, x, y, z).normalized().toRotationMatrix(), {pose.position.x, pose.position.y, pose.position.z}};
}

Pose operator*(const Pose& a, const Pose& b) { return {a.R * b.R, a.p + a.R * b.p}; }

/// Index of the body that bears this link's name, -1 where a fixed joint merged the link into another body.
int find_body(const rigid_body::Model& model, const std::string& link) {
  for (int i = 0; i < model.num_bodies(); ++i) {
    if (model.bodies[static_cast<std::size_t>(i)].name == link) return i;
  }
  return -1;
}

CollisionShape shape_of(const urdf::Geometry& geometry, const std::string& link) {
  CollisionShape shape;
  switch (geometry.type) {
    case urdf::Geometry::BOX: {
      const auto& box = static_cast<const urdf::Box&>(geometry);
      shape.kind = ShapeKind::kBox;
      shape.size = {box.dim.x, box.dim.y, box.dim.z};
      return shape;
    }
    case urdf::Geometry::SPHERE:
      shape.kind = ShapeKind::kSphere;
      shape.size.x() = static_cast<const urdf::Sphere&>(geometry).radius;
      return shape;
    case urdf::Geometry::CYLINDER: {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
      shape.kind = ShapeKind::kCylinder;
      shape.size = {cylinder.radius, cylinder.length, 0.0};
      return shape;
    }
    default:
      throw std::invalid_argument("link '" + link + "': its collision shape must be a box, a sphere or a cylinder");
  }
}

}  // namespace

std::vector<CollisionShape> collision_shapes_from_urdf(const std::string& urdf_text, const rigid_body::Model& model) {
  const auto tree = urdf::parseURDF(urdf_text);
  if (!tree) throw std::invalid_argument("the URDF is malformed");
  // Bodies in the model's order, so that the shapes' order depends on the robot alone and not on the parser's
  // containers.
  std::vector<CollisionShape> shapes;
  for (int body = 0; body < model.num_bodies(); ++body) {
    for (const auto& [name, link] : tree->links_) {
      Pose T_body_link;
      auto carrier = link;
      while (find_body(model, carrier->name) < 0 && carrier->parent_joint) {
        T_body_link = from_urdf(carrier->parent_joint->parent_to_joint_origin_transform) * T_body_link;
        carrier = std::const_pointer_cast<urdf::Link>(tree->getLink(carrier->parent_joint->parent_link_name));
      }
      if (find_body(model, carrier->name) != body) continue;
      for (const auto& collision : link->collision_array) {
        CollisionShape shape = shape_of(*collision->geometry, name);
        const Pose pose = T_body_link * from_urdf(collision->origin);
        shape.body = body;
        shape.R_LS = pose.R;
        shape.p_LS = pose.p;
        shapes.push_back(shape);
      }
    }
  }
  return shapes;
}

}  // namespace stance::sim
