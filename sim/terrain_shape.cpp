#include "sim/terrain_shape.hpp"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>

#include <new>

namespace stance::sim {
namespace {

class SphereTerrainAlgorithm final : public btCollisionAlgorithm {
 public:
  SphereTerrainAlgorithm(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* sphere,
                         const btCollisionObjectWrapper* terrain)
      : btCollisionAlgorithm(info),
        manifold_(m_dispatcher->getNewManifold(sphere->getCollisionObject(), terrain->getCollisionObject())) {}
  ~SphereTerrainAlgorithm() override { m_dispatcher->releaseManifold(manifold_); }
  SphereTerrainAlgorithm(const SphereTerrainAlgorithm&) = delete;
  SphereTerrainAlgorithm& operator=(const SphereTerrainAlgorithm&) = delete;

  void processCollision(const btCollisionObjectWrapper* sphere, const btCollisionObjectWrapper* terrain,
                        const btDispatcherInfo& /*info*/, btManifoldResult* result) override {
    const auto* ball = static_cast<const btSphereShape*>(sphere->getCollisionShape());
    const auto* shape = static_cast<const TerrainShape*>(terrain->getCollisionShape());
    const Vector3 centre = from_bullet(sphere->getWorldTransform().getOrigin());
    result->setPersistentManifold(manifold_);
    shape->terrain().contacts(centre, ball->getRadius() + manifold_->getContactBreakingThreshold(), contacts_);
    for (const GroundContact& contact : contacts_) {
      result->addContactPoint(to_bullet(contact.normal), to_bullet(contact.point),
                              contact.distance - ball->getRadius());
    }
    result->refreshContactPoints();
  }
  btScalar calculateTimeOfImpact(btCollisionObject* /*body0*/, btCollisionObject* /*body1*/,
                                 const btDispatcherInfo& /*info*/, btManifoldResult* /*result*/) override {
    return 1.0;  // not asked: no body moves continuously
  }
  void getAllContactManifolds(btManifoldArray& manifolds) override { manifolds.push_back(manifold_); }

 private:
  btPersistentManifold* manifold_;
  std::vector<GroundContact> contacts_;
};

}  // namespace

TerrainShape::TerrainShape(const Terrain& terrain) : terrain_(terrain) { m_shapeType = TERRAIN_SHAPE_PROXYTYPE; }

void TerrainShape::processAllTriangles(btTriangleCallback* callback, const btVector3& low,
                                       const btVector3& high) const {
  const Eigen::Vector2d from(low.x(), low.y()), to(high.x(), high.y());
  if (low.z() > terrain_.highest(from, to)) return;
  int index = 0;
  terrain_.triangles(from, to, [&](const std::array<Vector3, 3>& corners) {
    std::array<btVector3, 3> triangle = {to_bullet(corners[0]), to_bullet(corners[1]), to_bullet(corners[2])};
    callback->processTriangle(triangle.data(), 0, index++);
  });
}

void TerrainShape::getAabb(const btTransform& /*pose*/, btVector3& low, btVector3& high) const {
  low.setValue(-BT_LARGE_FLOAT, -BT_LARGE_FLOAT, -BT_LARGE_FLOAT);
  high.setValue(BT_LARGE_FLOAT, BT_LARGE_FLOAT, BT_LARGE_FLOAT);
}

void TerrainShape::setLocalScaling(const btVector3& /*scaling*/) {}

void TerrainShape::calculateLocalInertia(btScalar /*mass*/, btVector3& inertia) const { inertia.setZero(); }

void SphereOnTerrain::register_with(btCollisionDispatcher& dispatcher) {
  dispatcher.registerCollisionCreateFunc(SPHERE_SHAPE_PROXYTYPE, TERRAIN_SHAPE_PROXYTYPE, this);
}

btCollisionAlgorithm* SphereOnTerrain::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                const btCollisionObjectWrapper* sphere,
                                                                const btCollisionObjectWrapper* terrain) {
  void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(SphereTerrainAlgorithm));
  return new (memory) SphereTerrainAlgorithm(info, sphere, terrain);
}

}  // namespace stance::sim
