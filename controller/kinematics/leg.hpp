#pragma once
// The 4-joint leg of document 000 in closed form: eqs 1-18 and the inverse kinematics.
//
// Leg frame L: x forward, y down along the hanging leg, z = x cross y, i.e. left. Joint q0 rolls about x; q1..q3
// pitch about z.
//   T_L0 = Rx(q0) trans(0, L0, 0)        T_(i-1)i = Rz(q_i) trans(0, L_i, 0), i = 1..3            (eqs 1-4, 10-12)
//   com_0 = Rx(q0) (0, l0, 0) in L       com_i = Rz(q_i) (0, l_i, 0) in frame i-1                  (eqs 5-8)
//   foot  = T_L0 T_01 T_12 T_23 (0, 0, 0, 1)                                                      (eqs 9, 12)
// Jacobians (eqs 13-18): rows 1-3 linear, rows 4-6 geometric angular; the axis of q0 is (1, 0, 0), that of q1..q3 is
// (0, -sin q0, cos q0). Both legs are this one leg: only the hip's place in B differs.
#include <Eigen/Core>
#include <array>
#include <span>

#include "controller/math/so3.hpp"
#include "controller/rigid_body/dynamics.hpp"

namespace stance::kinematics {

using LegVector = Eigen::Matrix<double, 4, 1>;
using LegJacobian = Eigen::Matrix<double, 6, 4>;  ///< linear rows first, as the document has it
using Transform = Eigen::Matrix4d;

struct LegGeometry {
  std::array<double, 4> length{};      ///< m, L0..L3
  std::array<double, 4> com_offset{};  ///< m, l0..l3, along each link from its joint
  Vector3 p_BL = Vector3::Zero();      ///< m, hip's roll axis in B
};

/// The two legs of a biped from its model: joints 0-3 are the first foot's leg, 4-7 the second's. Throws
/// std::invalid_argument naming the joint, link or foot that is not as the document's leg has it.
std::array<LegGeometry, 2> leg_geometries(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet);

/// Rotation of L in B, the same for both legs: Rx(-90 deg).
Matrix3 leg_rotation() noexcept;

struct LegKinematics {
  std::array<Transform, 4> T_L;      ///< T_L0 .. T_L3: link ends in L
  std::array<Vector3, 4> com;        ///< m, in L
  Vector3 foot = Vector3::Zero();    ///< m, in L
  std::array<LegJacobian, 4> J_com;  ///< of com 0..3, in L
  LegJacobian J_foot;                ///< of the foot, in L
};
void leg_kinematics(const LegGeometry& leg, const LegVector& q, LegKinematics& out) noexcept;

/// Foot tip in B and its linear Jacobian in B (3 x 4).
void foot_in_base(const LegGeometry& leg, const LegVector& q, Vector3& p_BF,
                  Eigen::Matrix<double, 3, 4>& J_BF) noexcept;

/// kTooFar and kTooNear: the ankle (where the last link begins) is farther from the hip's pitch axis than L1 + L2, or
/// nearer than |L1 - L2|.
enum class LegIkStatus { kOk, kTooFar, kTooNear };

/// The closed-form inverse: q with the foot at `p_LF` (m, in L), knee forward (q2 >= 0), and the last link's angle
/// q1 + q2 + q3 = pitch_sum (rad). Of the two q0 that reach the foot's plane it takes the one with the leg on the
/// foot's side of the roll axis. Out of reach, q puts the ankle at the nearest place, along the line from the hip's
/// pitch axis, and the status says so. Gives a finite q for every finite target. Joint limits are the caller's.
[[nodiscard]] LegIkStatus leg_ik(const LegGeometry& leg, const Vector3& p_LF, double pitch_sum, LegVector& q) noexcept;

/// Unit null vector of the foot's linear Jacobian: the direction of joint motion that leaves the foot where it is. Its
/// knee entry is not negative. Where the leg is singular, one of the null vectors.
LegVector null_direction(const LegJacobian& J_foot) noexcept;

/// rigid_body::effective_inertia of a biped that stands on the `held` ones of its two feet: a held leg's last link does
/// not turn about its pitch axis in W, another leg keeps its joints.
Matrix3 biped_effective_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet,
                                const rigid_body::State& state, const rigid_body::Kinematics& kinematics,
                                const std::array<bool, 2>& held) noexcept;

/// What standing's centroidal model has for inertia [kg m^2, in B]: the diagonal of that on both feet, in posture `q`
/// with the trunk upright.
Matrix3 standing_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet,
                         const JointVector& q) noexcept;

/// What stepping's centroidal model has: the same, the mean of that on the one foot and on the other.
Matrix3 stepping_inertia(const rigid_body::Model& model, std::span<const rigid_body::Foot> feet,
                         const JointVector& q) noexcept;

}  // namespace stance::kinematics
