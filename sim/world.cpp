#include "sim/world.hpp"

#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointLimitConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletDynamicsCommon.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "sim/bullet_conversion.hpp"
#include "sim/terrain_shape.hpp"

namespace stance::sim {
namespace {

using rigid_body::Body;

constexpr double kMaxCoordinateVelocity = 1e4;  // rad/s, m/s: Bullet's own clamp of 100 would be felt
constexpr double kSolvedResidual = 1e-24;       // m^2/s^2: contacts to 1e-12 m/s, mostly in 20 of the 50 iterations
constexpr double kMaxImpulse = 1e10;            // N s, N m s: likewise
// N/m, N s/m. A fast ball is millimetres deep in what it hits when Bullet sees it: pushed out as feet are, in a few
// steps, it would leave with 1 m/s that no restitution gave it. This takes fifty steps, and is otherwise as hard.
constexpr double kBallStiffness = 2e4, kBallDamping = 1e3;

/// Principal axes of a body's inertia: Bullet takes a diagonal one, in a frame at the centre of mass.
struct PrincipalAxes {
  Matrix3 R_LI = Matrix3::Identity();  // inertial frame I in the link frame L
  Vector3 moments = Vector3::Zero();   // kg m^2
};

PrincipalAxes principal_axes(const Body& body) {
  const Matrix3 off_diagonal = body.inertia - Matrix3(body.inertia.diagonal().asDiagonal());
  if (off_diagonal.isZero(0.0)) return {Matrix3::Identity(), body.inertia.diagonal()};
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(body.inertia);
  Matrix3 axes = solver.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  return {axes, solver.eigenvalues()};
}

std::unique_ptr<btCollisionShape> make_shape(const rigid_body::CollisionShape& shape) {
  switch (shape.kind) {
    case rigid_body::ShapeKind::kBox:
      return std::make_unique<btBoxShape>(to_bullet(0.5 * shape.size));
    case rigid_body::ShapeKind::kCylinder:
      return std::make_unique<btCylinderShapeZ>(btVector3(shape.size.x(), shape.size.x(), 0.5 * shape.size.y()));
    case rigid_body::ShapeKind::kSphere:
      break;
  }
  return std::make_unique<btSphereShape>(shape.size.x());
}

std::unique_ptr<btConcaveShape> make_ground(const Terrain& terrain) {
  if (terrain.model().has_tiles()) return std::make_unique<TerrainShape>(terrain);
  return std::make_unique<btStaticPlaneShape>(to_bullet(terrain.normal()), 0.0);
}

}  // namespace

// Declared in an order in which each part outlives those that use it: the world goes first.
struct World::Bullet {
  Bullet(const rigid_body::Model& model, const Terrain& terrain, const Vector3& base_moments, bool floating)
      : ground_shape(make_ground(terrain)),
        body(model.num_joints, model.bodies[0].mass, to_bullet(base_moments), !floating, /*canSleep=*/false) {}

  SphereOnTerrain sphere_on_terrain;
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btMultiBodyConstraintSolver solver;
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::unique_ptr<btConcaveShape> ground_shape;
  btRigidBody ground{btRigidBody::btRigidBodyConstructionInfo(0.0, nullptr, ground_shape.get())};
  btMultiBody body;
  std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders;
  std::vector<std::unique_ptr<btMultiBodyJointLimitConstraint>> stops;
  std::unique_ptr<btSphereShape> ball_shape;
  std::unique_ptr<btRigidBody> ball;
  btMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
};

World::World(const WorldSetup& setup)
    : model_(setup.model), feet_(setup.feet), state_(setup.initial), ball_model_(setup.ball) {
  std::array<PrincipalAxes, rigid_body::kMaxBodies> axes;
  std::transform(model_.bodies.begin(), model_.bodies.begin() + model_.num_bodies(), axes.begin(), principal_axes);
  R_BI_ = axes[0].R_LI;
  bullet_ = std::make_unique<Bullet>(model_, setup.terrain, axes[0].moments, setup.floating);
  bullet_->sphere_on_terrain.register_with(bullet_->dispatcher);

  btMultiBodyDynamicsWorld& world = bullet_->world;
  world.setGravity(btVector3(0.0, 0.0, -kGravity));
  btContactSolverInfo& solver = world.getSolverInfo();
  solver.m_numIterations = 50;
  solver.m_leastSquaresResidualThreshold = kSolvedResidual;
  solver.m_globalCfm = 0.0;
  solver.m_frictionCFM = 0.0;
  solver.m_erp = 0.2;
  solver.m_erp2 = 0.2;
  solver.m_frictionERP = 0.2;
  solver.m_linearSlop = 1e-5;
  solver.m_splitImpulse = 0;

  // Bullet multiplies what two bodies have: with a ball each has the square root of the pair's.
  const double restitution = ball_model_ ? std::sqrt(ball_model_->restitution) : 0.0;
  const double friction = ball_model_ ? std::sqrt(ball_model_->friction) : setup.friction;
  bullet_->ground.setFriction(ball_model_ ? friction : 1.0);
  bullet_->ground.setRestitution(restitution);
  world.addRigidBody(&bullet_->ground);

  btMultiBody& body = bullet_->body;
  for (int i = 0; i < model_.num_joints; ++i) {
    const auto& joint = model_.joints[static_cast<std::size_t>(i)];
    const auto& child = model_.bodies[static_cast<std::size_t>(i + 1)];
    const auto& parent = model_.bodies[static_cast<std::size_t>(joint.parent)];
    const Matrix3& R_parent = axes[static_cast<std::size_t>(joint.parent)].R_LI;
    const Matrix3& R_child = axes[static_cast<std::size_t>(i + 1)].R_LI;
    const Matrix3 R_parent_child = R_parent.transpose() * joint.R_PJ * R_child;
    body.setupRevolute(i, child.mass, to_bullet(axes[static_cast<std::size_t>(i + 1)].moments), joint.parent - 1,
                       to_bullet(Quaternion(R_parent_child).conjugate()), to_bullet(R_child.transpose() * joint.axis),
                       to_bullet(R_parent.transpose() * (joint.p_PJ - parent.com)),
                       to_bullet(R_child.transpose() * child.com),
                       /*disableParentCollision=*/true);
  }
  body.finalizeMultiDof();
  body.setLinearDamping(0.0);
  body.setAngularDamping(0.0);
  body.setUseGyroTerm(true);
  body.setCanSleep(false);
  body.setHasSelfCollision(true);
  body.setMaxCoordinateVelocity(kMaxCoordinateVelocity);
  body.setMaxAppliedImpulse(kMaxImpulse);

  foot_shape_.fill(-1);
  for (int i = 0; i < model_.num_bodies(); ++i) {
    const Matrix3 R_IL = axes[static_cast<std::size_t>(i)].R_LI.transpose();
    auto compound = std::make_unique<btCompoundShape>();
    for (const rigid_body::CollisionShape& shape : setup.shapes) {
      if (shape.body != i) continue;
      bullet_->shapes.push_back(make_shape(shape));
      for (std::size_t foot = 0; foot < feet_.size(); ++foot) {
        if (feet_[foot].body == i && shape.kind == rigid_body::ShapeKind::kSphere && shape.p_LS == feet_[foot].tip) {
          foot_shape_[foot] = compound->getNumChildShapes();
        }
      }
      const Vector3 p_IS = R_IL * (shape.p_LS - model_.bodies[static_cast<std::size_t>(i)].com);
      compound->addChildShape(btTransform(to_bullet(Quaternion(Matrix3(R_IL * shape.R_LS))), to_bullet(p_IS)),
                              bullet_->shapes.back().get());
    }
    // Bodies without a shape have a collider that meets nothing: Bullet looks there for the island of a joint's stop.
    const bool bare = compound->getNumChildShapes() == 0;
    auto collider = std::make_unique<btMultiBodyLinkCollider>(&body, i - 1);
    collider->setCollisionShape(compound.get());
    collider->setFriction(friction);
    collider->setRestitution(restitution);
    if (i == 0) {
      body.setBaseCollider(collider.get());
    } else {
      body.getLink(i - 1).m_collider = collider.get();
    }
    world.addCollisionObject(collider.get(), btBroadphaseProxy::DefaultFilter,
                             bare ? 0 : static_cast<int>(btBroadphaseProxy::AllFilter));
    bullet_->shapes.push_back(std::move(compound));
    bullet_->colliders.push_back(std::move(collider));
  }
  world.addMultiBody(&body);
  for (int i = 0; i < model_.num_joints; ++i) {
    const auto& joint = model_.joints[static_cast<std::size_t>(i)];
    auto stop = std::make_unique<btMultiBodyJointLimitConstraint>(&body, i, joint.lower, joint.upper);
    stop->setMaxAppliedImpulse(kMaxImpulse);
    stop->finalizeMultiDof();
    world.addMultiBodyConstraint(stop.get());
    bullet_->stops.push_back(std::move(stop));
  }

  if (ball_model_) {
    btVector3 moments;
    bullet_->ball_shape = std::make_unique<btSphereShape>(ball_model_->radius);
    bullet_->ball_shape->calculateLocalInertia(ball_model_->mass, moments);
    bullet_->ball = std::make_unique<btRigidBody>(
        btRigidBody::btRigidBodyConstructionInfo(ball_model_->mass, nullptr, bullet_->ball_shape.get(), moments));
    bullet_->ball->setFriction(friction);
    bullet_->ball->setRestitution(restitution);
    bullet_->ball->setContactStiffnessAndDamping(kBallStiffness, kBallDamping);
    bullet_->ball->setActivationState(DISABLE_DEACTIVATION);
  }

  // Bullet's base stands at its centre of mass, along its principal axes, and keeps the inverse rotation.
  const Vector3 com_W = state_.R_WB * model_.bodies[0].com;
  body.setBasePos(to_bullet(state_.p_WB + com_W));
  body.setWorldToBaseRot(to_bullet(Quaternion(Matrix3(state_.R_WB * R_BI_)).normalized().conjugate()));
  body.setBaseVel(to_bullet(state_.v_WB + state_.w_WB_W.cross(com_W)));
  body.setBaseOmega(to_bullet(state_.w_WB_W));
  for (int i = 0; i < model_.num_joints; ++i) {
    body.setJointPos(i, state_.q[i]);
    body.setJointVel(i, state_.qd[i]);
  }
  btAlignedObjectArray<btQuaternion> rotations;
  btAlignedObjectArray<btVector3> positions;
  body.forwardKinematics(rotations, positions);
  body.updateCollisionObjectWorldTransforms(rotations, positions);
  read_state();
}

World::~World() = default;

void World::step(const JointVector& torque, const Wrench& push) {
  btMultiBody& body = bullet_->body;
  const Vector3 p_com_B_W = -(state_.R_WB * model_.bodies[0].com);
  body.addBaseForce(to_bullet(push.force));
  body.addBaseTorque(to_bullet(push.moment + p_com_B_W.cross(push.force)));
  for (int i = 0; i < model_.num_joints; ++i) body.addJointTorque(i, torque[i]);
  if (ball_) {
    const Vector3 drag = flight_acceleration(*ball_model_, ball_->v_W) - Vector3(0.0, 0.0, -kGravity);
    bullet_->ball->applyCentralForce(to_bullet(ball_model_->mass * drag));
  }
  bullet_->world.stepSimulation(kPhysicsStep, 0);
  read_state();
  if (ball_) read_ball();
  read_contacts();
}

void World::throw_ball(const Vector3& p_W, const Vector3& v_W) {
  take_ball();
  btRigidBody& ball = *bullet_->ball;
  ball.setWorldTransform(btTransform(btQuaternion::getIdentity(), to_bullet(p_W)));
  ball.setInterpolationWorldTransform(ball.getWorldTransform());
  ball.setLinearVelocity(to_bullet(v_W));
  ball.setAngularVelocity(btVector3(0.0, 0.0, 0.0));
  ball.clearForces();
  bullet_->world.addRigidBody(&ball);
  read_ball();
}

void World::take_ball() {
  if (!ball_) return;
  bullet_->world.removeRigidBody(bullet_->ball.get());
  ball_.reset();
}

void World::read_ball() {
  const btRigidBody& ball = *bullet_->ball;
  ball_ = {from_bullet(ball.getWorldTransform().getOrigin()), from_bullet(ball.getLinearVelocity())};
}

void World::read_state() {
  const btMultiBody& body = bullet_->body;
  const Matrix3 R_WI = from_bullet(body.getWorldToBaseRot()).conjugate().toRotationMatrix();
  state_.R_WB = R_WI * R_BI_.transpose();
  const Vector3 com_W = state_.R_WB * model_.bodies[0].com;
  state_.p_WB = from_bullet(body.getBasePos()) - com_W;
  state_.w_WB_W = from_bullet(body.getBaseOmega());
  state_.v_WB = from_bullet(body.getBaseVel()) - state_.w_WB_W.cross(com_W);
  for (int i = 0; i < model_.num_joints; ++i) {
    state_.q[i] = body.getJointPos(i);
    state_.qd[i] = body.getJointVel(i);
  }
}

void World::read_contacts() {
  foot_force_W_.fill(Vector3::Zero());
  body_on_ground_ = -1;
  const btCollisionObject* ground = &bullet_->ground;
  for (int m = 0; m < bullet_->dispatcher.getNumManifolds(); ++m) {
    const btPersistentManifold* manifold = bullet_->dispatcher.getManifoldByIndexInternal(m);
    const bool ground_is_second = manifold->getBody1() == ground;
    if (!ground_is_second && manifold->getBody0() != ground) continue;
    const auto* collider =
        btMultiBodyLinkCollider::upcast(ground_is_second ? manifold->getBody0() : manifold->getBody1());
    if (collider == nullptr) continue;
    for (int i = 0; i < manifold->getNumContacts(); ++i) {
      const btManifoldPoint& point = manifold->getContactPoint(i);
      if (point.m_appliedImpulse <= 0.0) continue;
      const int foot = foot_of(collider->m_link + 1, ground_is_second ? point.m_index0 : point.m_index1);
      if (foot < 0) {
        body_on_ground_ = collider->m_link + 1;
        continue;
      }
      // Impulses act on the first body along the normal that leaves the second.
      const Vector3 impulse = from_bullet(point.m_normalWorldOnB * point.m_appliedImpulse +
                                          point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                                          point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2);
      foot_force_W_[static_cast<std::size_t>(foot)] += (ground_is_second ? impulse : Vector3(-impulse)) / kPhysicsStep;
    }
  }
}

int World::foot_of(int body, int shape) const noexcept {
  for (std::size_t foot = 0; foot < feet_.size(); ++foot) {
    if (feet_[foot].body == body && foot_shape_[foot] == shape) return static_cast<int>(foot);
  }
  return -1;
}

Mechanics mechanics(const rigid_body::Model& model, const rigid_body::State& state) noexcept {
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(model, state, kinematics);
  rigid_body::Centroidal whole;
  rigid_body::centroidal(model, kinematics, whole);
  Mechanics out;
  out.p_WC = whole.p_WC;
  out.v_WC = whole.v_WC;
  out.L_C_W = whole.L_C_W;
  for (std::size_t i = 0; i < static_cast<std::size_t>(model.num_bodies()); ++i) {
    const Body& body = model.bodies[i];
    const Vector3 w_L = kinematics.R_W[i].transpose() * kinematics.w_W[i];
    out.energy += 0.5 * body.mass * kinematics.v_com_W[i].squaredNorm() + 0.5 * w_L.dot(body.inertia * w_L) +
                  body.mass * kGravity * kinematics.com_W[i].z();
  }
  return out;
}

ContactVectors foot_tips(const rigid_body::Model& model, const std::vector<rigid_body::Foot>& feet,
                         const rigid_body::State& state) noexcept {
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(model, state, kinematics);
  ContactVectors tips;
  tips.fill(Vector3::Zero());
  for (std::size_t i = 0; i < feet.size(); ++i) {
    const auto body = static_cast<std::size_t>(feet[i].body);
    tips[i] = kinematics.p_W[body] + kinematics.R_W[body] * feet[i].tip;
  }
  return tips;
}

}  // namespace stance::sim
