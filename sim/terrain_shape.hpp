#pragma once
// Tiles as a shape of Bullet. Spheres, the feet, meet them as Terrain::contacts says; Bullet's own way, triangle by
// triangle, would trip them over edges in level ground. Other shapes meet the triangles that are near.
#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include "sim/bullet_conversion.hpp"
#include "sim/terrain.hpp"

namespace stance::sim {

class TerrainShape final : public btConcaveShape {
 public:
  explicit TerrainShape(const Terrain& terrain);

  const Terrain& terrain() const { return terrain_; }

  void processAllTriangles(btTriangleCallback* callback, const btVector3& low, const btVector3& high) const override;
  void getAabb(const btTransform& pose, btVector3& low, btVector3& high) const override;
  void setLocalScaling(const btVector3& scaling) override;
  const btVector3& getLocalScaling() const override { return scaling_; }
  void calculateLocalInertia(btScalar mass, btVector3& inertia) const override;
  const char* getName() const override { return "tiles"; }

 private:
  Terrain terrain_;
  btVector3 scaling_{1.0, 1.0, 1.0};
};

/// Makes what lets spheres meet a TerrainShape. Outlives the dispatcher that it is registered with.
class SphereOnTerrain final : public btCollisionAlgorithmCreateFunc {
 public:
  void register_with(btCollisionDispatcher& dispatcher);
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* sphere,
                                                 const btCollisionObjectWrapper* terrain) override;
};

}  // namespace stance::sim
