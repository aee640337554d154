#pragma once
// Eigen to Bullet and back.
#include <LinearMath/btMatrix3x3.h>
#include <LinearMath/btTransform.h>

#include "controller/math/so3.hpp"

namespace stance::sim {

static_assert(sizeof(btScalar) == 8, "Bullet must be the double-precision build: pkg-config bullet-float64");

inline btVector3 to_bullet(const Vector3& v) { return {v.x(), v.y(), v.z()}; }
inline btQuaternion to_bullet(const Quaternion& q) { return {q.x(), q.y(), q.z(), q.w()}; }
inline Vector3 from_bullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
inline Quaternion from_bullet(const btQuaternion& q) { return {q.w(), q.x(), q.y(), q.z()}; }

}  // namespace stance::sim
