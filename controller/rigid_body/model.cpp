#include "controller/rigid_body/model.hpp"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <stdexcept>

#include "controller/math/se3.hpp"

namespace stance::rigid_body {
namespace {

[[noreturn]] void fail(const std::string& element, const std::string& problem, const std::string& remedy) {
  throw std::invalid_argument("URDF: " + element + " " + problem + ": " + remedy);
}

std::string quoted(const std::string& kind, const std::string& name) { return kind + " '" + name + "'"; }

/// Collects what the URDF parser would print, for the exception's text; the handler before it returns at the end of the
/// scope.
class ParserMessages : public console_bridge::OutputHandler {
 public:
  ParserMessages() { console_bridge::useOutputHandler(this); }
  ~ParserMessages() override { console_bridge::restorePreviousOutputHandler(); }
  ParserMessages(const ParserMessages&) = delete;
  ParserMessages& operator=(const ParserMessages&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR) return;
    if (!text_.empty()) text_ += "; ";
    text_ += text;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

urdf::ModelInterfaceSharedPtr parse(const std::string& urdf_text) {
  ParserMessages messages;
  urdf::ModelInterfaceSharedPtr robot;
  std::string reason;
  try {
    robot = urdf::parseURDF(urdf_text);
  } catch (const std::exception& error) {
    reason = error.what();
  }
  // The parser goes on after some errors, with an element half read.
  reason += messages.text();
  if (!robot || !robot->getRoot() || !reason.empty()) {
    fail("document", "does not parse", (reason.empty() ? "no root link" : reason) + " (mend this element)");
  }
  return robot;
}

RigidTransform transform(const urdf::Pose& pose) {
  const Quaternion q(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  return {q.normalized().toRotationMatrix(), {pose.position.x, pose.position.y, pose.position.z}};
}

/// The link that carries `link` through fixed joints, and the pose of `link` in it.
struct Carrier {
  const urdf::Link* link;
  RigidTransform T;
};
Carrier carrier_of(const urdf::Link& link) {
  Carrier carrier{&link, {}};
  while (carrier.link->parent_joint && carrier.link->parent_joint->type == urdf::Joint::FIXED) {
    carrier.T = transform(carrier.link->parent_joint->parent_to_joint_origin_transform) * carrier.T;
    carrier.link = carrier.link->getParent().get();
  }
  return carrier;
}

bool positive_definite(const Matrix3& m) { return Eigen::LLT<Matrix3>(m).info() == Eigen::Success; }

/// Adds the link's inertial, with the link placed at T in the body's frame.
void add_inertial(const urdf::Link& link, const RigidTransform& T, Body& body) {
  if (!link.inertial) return;
  const urdf::Inertial& inertial = *link.inertial;
  if (!(inertial.mass > 0.0)) {
    fail(quoted("link", link.name), "has the mass " + std::to_string(inertial.mass),
         "give a positive <mass>, or no <inertial> to a link without mass on a fixed joint");
  }
  Matrix3 own;
  own << inertial.ixx, inertial.ixy, inertial.ixz,  //
      inertial.ixy, inertial.iyy, inertial.iyz,     //
      inertial.ixz, inertial.iyz, inertial.izz;
  if (!positive_definite(own)) {
    fail(quoted("link", link.name), "has an inertia that is not positive definite",
         "give <inertia> the moments about the centre of mass, all three principal ones positive");
  }
  const RigidTransform at = T * transform(inertial.origin);
  const double mass = body.mass + inertial.mass;
  const Vector3 com = (body.mass * body.com + inertial.mass * at.p) / mass;
  const auto about = [&](double m, const Vector3& r) -> Matrix3 {
    return m * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
  };
  body.inertia += about(body.mass, body.com - com) + at.R * own * at.R.transpose() + about(inertial.mass, at.p - com);
  body.mass = mass;
  body.com = com;
}

Joint read_joint(const urdf::Joint& from) {
  const std::string element = quoted("joint", from.name);
  if (from.type != urdf::Joint::REVOLUTE) {
    fail(element, "is neither revolute nor fixed", "make it revolute, with <limit>, or fixed");
  }
  if (!from.limits) fail(element, "has no limits", "give it <limit lower upper effort velocity>");
  if (from.mimic) fail(element, "mimics another joint", "remove <mimic>: every joint moves by itself");
  const urdf::JointLimits& limits = *from.limits;
  if (!(limits.lower < limits.upper) || !(limits.effort > 0.0) || !(limits.velocity > 0.0)) {
    fail(element, "has limits that leave it no motion", "give <limit> lower < upper, effort > 0 and velocity > 0");
  }
  const Vector3 axis(from.axis.x, from.axis.y, from.axis.z);
  if (!(axis.norm() > 0.0)) fail(element, "has a zero axis", "give <axis> a direction");

  Joint joint;
  joint.name = from.name;
  joint.axis = axis.normalized();
  joint.lower = limits.lower;
  joint.upper = limits.upper;
  joint.max_velocity = limits.velocity;
  joint.max_torque = limits.effort;
  return joint;
}

/// `at`: the pose of the link in the body that carries it.
CollisionShape read_shape(const urdf::Link& link, const urdf::Collision& collision, int body,
                          const RigidTransform& at) {
  CollisionShape shape;
  shape.body = body;
  const urdf::Geometry* geometry = collision.geometry.get();
  if (const auto* box = dynamic_cast<const urdf::Box*>(geometry)) {
    shape.kind = ShapeKind::kBox;
    shape.size = {box->dim.x, box->dim.y, box->dim.z};
  } else if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(geometry)) {
    shape.kind = ShapeKind::kSphere;
    shape.size.x() = sphere->radius;
  } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(geometry)) {
    shape.kind = ShapeKind::kCylinder;
    shape.size = {cylinder->radius, cylinder->length, 0.0};
  } else {
    fail(quoted("link", link.name), "has a collision shape of another kind",
         "make it a <box>, a <sphere> or a <cylinder>");
  }
  const RigidTransform T = at * transform(collision.origin);
  shape.R_LS = T.R;
  shape.p_LS = T.p;
  return shape;
}

int index_or_minus_one(const Model& model, const std::string& link) {
  for (int b = 0; b < model.num_bodies(); ++b) {
    if (model.bodies[b].name == link) return b;
  }
  return -1;
}

}  // namespace

int Model::body_index(const std::string& link) const {
  const int index = index_or_minus_one(*this, link);
  if (index < 0) {
    throw std::invalid_argument("model '" + name + "' has no body '" + link +
                                "': name a link that is the root or that a moving joint carries");
  }
  return index;
}

Model model_from_urdf(const std::string& urdf_text, const std::vector<std::string>& joint_order) {
  const urdf::ModelInterfaceSharedPtr robot = parse(urdf_text);
  if (joint_order.size() > kMaxJoints) {
    fail("joint order", "names " + std::to_string(joint_order.size()) + " joints",
         "at most " + std::to_string(kMaxJoints) + " can move; make the others fixed");
  }
  for (const auto& [name, joint] : robot->joints_) {
    const auto times = std::count(joint_order.begin(), joint_order.end(), name);
    if (joint->type != urdf::Joint::FIXED && times != 1) {
      fail(quoted("joint", name), "stands " + std::to_string(times) + " times in the joint order",
           "name every moving joint once");
    }
  }

  Model model;
  model.name = robot->getName();
  model.num_joints = static_cast<int>(joint_order.size());
  model.bodies[0].name = robot->getRoot()->name;
  for (int i = 0; i < model.num_joints; ++i) {
    const urdf::JointConstSharedPtr from = robot->getJoint(joint_order[i]);
    if (!from) {
      fail(quoted("joint", joint_order[i]), "stands in the joint order but not in the document",
           "correct the name, or take it out of the order");
    }
    if (from->type == urdf::Joint::FIXED) {
      fail(quoted("joint", from->name), "stands in the joint order but is fixed", "take it out of the order");
    }
    Joint joint = read_joint(*from);
    const Carrier parent = carrier_of(*robot->getLink(from->parent_link_name));
    // Only bodies of the joints before this one have their names yet.
    joint.parent = index_or_minus_one(model, parent.link->name);
    if (joint.parent < 0) {
      fail(quoted("joint", from->name),
           "stands before its parent '" + parent.link->parent_joint->name + "' in the joint order",
           "name parents before their children");
    }
    const RigidTransform T_PJ = parent.T * transform(from->parent_to_joint_origin_transform);
    joint.R_PJ = T_PJ.R;
    joint.p_PJ = T_PJ.p;
    model.joints[i] = joint;
    model.bodies[i + 1].name = from->child_link_name;
  }

  for (const auto& [name, link] : robot->links_) {
    const Carrier carrier = carrier_of(*link);
    add_inertial(*link, carrier.T, model.bodies[model.body_index(carrier.link->name)]);
  }
  for (int b = 0; b < model.num_bodies(); ++b) {
    if (!(model.bodies[b].mass > 0.0)) {
      fail(quoted("link", model.bodies[b].name), "has no mass", "give it an <inertial>, or put it on a fixed joint");
    }
    model.total_mass += model.bodies[b].mass;
  }
  return model;
}

std::vector<Foot> feet_from_urdf(const std::string& urdf_text, const Model& model,
                                 const std::vector<std::string>& links) {
  const urdf::ModelInterfaceSharedPtr robot = parse(urdf_text);
  std::vector<Foot> feet;
  for (const std::string& name : links) {
    const urdf::LinkConstSharedPtr link = robot->getLink(name);
    if (!link) fail(quoted("link", name), "is named as a foot but not in the document", "correct the name");
    const auto sphere = std::find_if(link->collision_array.begin(), link->collision_array.end(), [](const auto& shape) {
      return shape->geometry && shape->geometry->type == urdf::Geometry::SPHERE;
    });
    if (sphere == link->collision_array.end()) {
      fail(quoted("link", name), "has no sphere among its collision shapes",
           "give the foot a <collision> with <sphere>: contacts are points");
    }
    const Carrier carrier = carrier_of(*link);
    feet.push_back({model.body_index(carrier.link->name), (carrier.T * transform((*sphere)->origin)).p,
                    std::static_pointer_cast<urdf::Sphere>((*sphere)->geometry)->radius});
  }
  return feet;
}

LinkPose link_pose_from_urdf(const std::string& urdf_text, const Model& model, const std::string& name) {
  const urdf::ModelInterfaceSharedPtr robot = parse(urdf_text);
  const urdf::LinkConstSharedPtr link = robot->getLink(name);
  if (!link) fail(quoted("link", name), "is not in the document", "correct the name");
  const Carrier carrier = carrier_of(*link);
  return {model.body_index(carrier.link->name), carrier.T};
}

std::vector<CollisionShape> collision_shapes_from_urdf(const std::string& urdf_text, const Model& model) {
  const urdf::ModelInterfaceSharedPtr robot = parse(urdf_text);
  std::vector<CollisionShape> shapes;
  for (const auto& [name, link] : robot->links_) {
    const Carrier carrier = carrier_of(*link);
    const int body = model.body_index(carrier.link->name);
    for (const auto& collision : link->collision_array) {
      shapes.push_back(read_shape(*link, *collision, body, carrier.T));
    }
  }
  std::stable_sort(shapes.begin(), shapes.end(), [](const auto& a, const auto& b) { return a.body < b.body; });
  return shapes;
}

}  // namespace stance::rigid_body
