#pragma once
// When a legged robot has fallen: one rule for controller and simulator.
#include <algorithm>
#include <span>

#include "controller/math/so3.hpp"

namespace stance::kinematics {

struct FallLimits {
  double min_upright = 0.0;  ///< z component of B's z axis in W
  double min_height = 0.0;   ///< m, of B over the lowest foot's ground point
};

/// Why a robot has fallen; the last is for the simulator alone to see.
enum class Fall { kNone, kTilt, kHeight, kBodyOnGround };

/// By its pose. `p_WF` [m]: tips of the feet, spheres of `foot_radius`; at least one. A pose that is not a number has
/// fallen.
inline Fall fall_of(const FallLimits& limits, const Matrix3& R_WB, const Vector3& p_WB, std::span<const Vector3> p_WF,
                    double foot_radius) noexcept {
  double ground = p_WF.front().z();
  for (const Vector3& tip : p_WF) ground = std::min(ground, tip.z());
  ground -= foot_radius;
  if (!(R_WB(2, 2) >= limits.min_upright)) return Fall::kTilt;
  return p_WB.z() - ground >= limits.min_height ? Fall::kNone : Fall::kHeight;
}

}  // namespace stance::kinematics
