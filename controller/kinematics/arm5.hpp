#pragma once
// The 5-joint arm of document 001 in closed form. Metres, where the document has millimetres.
//
// Modified Denavit-Hartenberg rows (alpha, a, d, theta) of frames 1..5:
//   (0, 0, d1, t1)  (90 deg, a1, d2, t2)  (0, a2, 0, t3)  (0, a3, 0, t4)  (90 deg, 0, d5, t5)
// Frame 5 is the tool's: z along the approach. With s234, c234 of t2 + t3 + t4, the tool's pitch,
//   T_15 = [ c234 c5, -c234 s5,  s234, d5 s234 + a3 c23 + a2 c2 + a1
//            -s5,     -c5,       0,    -d2
//            s234 c5, -s234 s5, -c234, a3 s23 - d5 c234 + a2 s2 ]          T_A5 = trans(0, 0, d1) Rz(t1) T_15
//
// Inverse:  t1 = atan2(py, px) - atan2(-d2, +-sqrt(px^2 + py^2 - d2^2))      t5 = atan2(-T_15(2,1), -T_15(2,2))
//           K1 = T_15(1,4) - d5 s234 - a1     K2 = T_15(3,4) + d5 c234        t3 = +-acos((K1^2 + K2^2 - a2^2 - a3^2) /
//           (2 a2 a3)) t2 = atan2(K2, K1) - atan2(a3 sin t3, a2 + a3 cos t3)             t4 = atan2(s234, c234) - t2 -
//           t3
// Five joints reach a pose only where T_15(2,3) = 0: the approach lies in the arm's plane. The document's further sign
// in t2 is spurious: its root is |K1|, so that the sign is K1's.
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <numbers>

#include "controller/math/se3.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::kinematics {

using Arm5Vector = Eigen::Matrix<double, 5, 1>;  ///< rad, t1..t5

/// m; a2 and a3 positive.
struct Arm5Geometry {
  double a1 = 0.0, a2 = 0.0, a3 = 0.0;
  double d1 = 0.0, d2 = 0.0, d5 = 0.0;
};

/// rad. An angle counts as that turn of it within pi of its range's middle; by default all of [-pi, pi).
struct Arm5Limits {
  Arm5Vector lower = Arm5Vector::Constant(-std::numbers::pi);
  Arm5Vector upper = Arm5Vector::Constant(std::numbers::pi);
};

/// From a model of five joints whose frames are the document's (frame 5 at the wrist, `d5` [m] to the tool along its
/// z). Throws std::invalid_argument naming the joint that is not as the document's arm has it.
Arm5Geometry arm5_geometry(const rigid_body::Model& model, double d5);

/// The model's, of its five joints.
Arm5Limits arm5_limits(const rigid_body::Model& model) noexcept;

/// T_A5: the tool in the arm's base frame A.
RigidTransform arm5_forward(const Arm5Geometry& arm, const Arm5Vector& t) noexcept;

/// d p_A / d t: of the tool's position, in A [m/rad]. The last column is zero: the tool lies on that joint's axis.
Eigen::Matrix<double, 3, 5> arm5_position_jacobian(const Arm5Geometry& arm, const Arm5Vector& t) noexcept;

enum class Arm5Status : std::uint8_t {
  kOk,
  kUnreachable,    ///< the position is too near the first axis, or the wrist too far from the shoulder or too near it
  kOrientation,    ///< the approach does not lie in the arm's plane: not for five joints
  kOutsideLimits,  ///< every solution has an angle outside its limits
  kInvalid,        ///< a number that is not finite, or no rotation
};

/// Every solution, each once, in no particular order: 2 of a generic reachable pose, 4 where the tool is vertical,
/// fewer where roots coincide or limits forbid.
struct Arm5Solutions {
  Arm5Status status = Arm5Status::kInvalid;
  int count = 0;                  ///< 0 unless kOk
  std::array<Arm5Vector, 4> t{};  ///< rad, the first `count`; within limits
};

/// All t with arm5_forward(t) = T_A5, |T_15(2,3)| counting as 0 up to 1e-9.
[[nodiscard]] Arm5Solutions arm5_ik(const Arm5Geometry& arm, const RigidTransform& T_A5,
                                    const Arm5Limits& limits = {}) noexcept;

/// All t that put the tool at `p_A` (m) with the pitch t2 + t3 + t4 and the roll t5 (rad).
[[nodiscard]] Arm5Solutions arm5_ik(const Arm5Geometry& arm, const Vector3& p_A, double pitch, double roll,
                                    const Arm5Limits& limits = {}) noexcept;

}  // namespace stance::kinematics
