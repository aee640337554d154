#include "controller/kinematics/leg.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace stance::kinematics {
namespace {

/// The leg in the plane that q0 has turned: x and y of L at q0 = 0.
struct Plane {
  double sin_roll, cos_roll;
  std::array<double, 4> sin_pitch, cos_pitch;  ///< of link i's angle to the plane's y; link 0 does not pitch
  std::array<Eigen::Vector2d, 5> end;          ///< m, where link i begins; its tip is end[i + 1]

  /// A point of the plane, in L.
  Vector3 in_leg(const Eigen::Vector2d& p) const { return {p.x(), p.y() * cos_roll, p.y() * sin_roll}; }
};

Plane plane(const LegGeometry& leg, const LegVector& q) {
  Plane out;
  out.sin_roll = std::sin(q(0));
  out.cos_roll = std::cos(q(0));
  out.end[0].setZero();
  double pitch = 0.0;
  for (int i = 0; i < 4; ++i) {
    if (i > 0) pitch += q(i);
    out.sin_pitch[i] = std::sin(pitch);
    out.cos_pitch[i] = std::cos(pitch);
    out.end[i + 1] = out.end[i] + leg.length[i] * Eigen::Vector2d(-out.sin_pitch[i], out.cos_pitch[i]);
  }
  return out;
}

/// Jacobian of a point of link `link`, eqs 13-18.
LegJacobian jacobian(const Plane& plane, const Eigen::Vector2d& p, int link) {
  LegJacobian J = LegJacobian::Zero();
  J.col(0) << 0.0, -p.y() * plane.sin_roll, p.y() * plane.cos_roll, 1.0, 0.0, 0.0;
  for (int i = 1; i <= link; ++i) {
    const Eigen::Vector2d r = p - plane.end[i];
    J.col(i) << plane.in_leg({-r.y(), r.x()}), 0.0, -plane.sin_roll, plane.cos_roll;
  }
  return J;
}

}  // namespace

Matrix3 leg_rotation() noexcept {
  Matrix3 R_BL;
  R_BL << 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0;
  return R_BL;
}

void leg_kinematics(const LegGeometry& leg, const LegVector& q, LegKinematics& out) noexcept {
  const Plane p = plane(leg, q);
  for (int i = 0; i < 4; ++i) {
    const double s = p.sin_pitch[i], c = p.cos_pitch[i];
    out.T_L[i].setIdentity();
    out.T_L[i].col(0).head<3>() = p.in_leg({c, s});
    out.T_L[i].col(1).head<3>() = p.in_leg({-s, c});
    out.T_L[i].col(2).head<3>() << 0.0, -p.sin_roll, p.cos_roll;
    out.T_L[i].col(3).head<3>() = p.in_leg(p.end[i + 1]);
    const Eigen::Vector2d com = p.end[i] + leg.com_offset[i] * Eigen::Vector2d(-s, c);
    out.com[i] = p.in_leg(com);
    out.J_com[i] = jacobian(p, com, i);
  }
  out.foot = p.in_leg(p.end[4]);
  out.J_foot = jacobian(p, p.end[4], 3);
}

void foot_in_base(const LegGeometry& leg, const LegVector& q, Vector3& p_BF,
                  Eigen::Matrix<double, 3, 4>& J_BF) noexcept {
  const Plane p = plane(leg, q);
  const Matrix3 R_BL = leg_rotation();
  p_BF = leg.p_BL + R_BL * p.in_leg(p.end[4]);
  J_BF = R_BL * jacobian(p, p.end[4], 3).topRows<3>();
}

LegIkStatus leg_ik(const LegGeometry& leg, const Vector3& p_LF, double pitch_sum, LegVector& q) noexcept {
  const auto& [L0, L1, L2, L3] = leg.length;
  q(0) = std::atan2(p_LF.z(), p_LF.y());
  // The ankle in the leg's plane, from the hip's pitch axis.
  const double x = p_LF.x() + L3 * std::sin(pitch_sum);
  const double y = std::hypot(p_LF.y(), p_LF.z()) - L0 - L3 * std::cos(pitch_sum);
  const double distance = std::hypot(x, y);
  const double reach = std::clamp(distance, std::abs(L1 - L2), L1 + L2);
  const double cos_knee = std::clamp((reach * reach - L1 * L1 - L2 * L2) / (2.0 * L1 * L2), -1.0, 1.0);
  q(2) = std::acos(cos_knee);
  q(1) = std::atan2(-x, y) - std::atan2(L2 * std::sin(q(2)), L1 + L2 * cos_knee);
  q(3) = pitch_sum - q(1) - q(2);
  if (distance > L1 + L2) return LegIkStatus::kTooFar;
  return distance < std::abs(L1 - L2) ? LegIkStatus::kTooNear : LegIkStatus::kOk;
}

LegVector null_direction(const LegJacobian& J_foot) noexcept {
  // The last column of Q is normal to the rows of J, whatever their rank.
  const Eigen::Matrix<double, 4, 3> rows = J_foot.topRows<3>().transpose();
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, 4, 3>> qr(rows);
  const LegVector n = qr.householderQ() * LegVector::Unit(3);
  return n(2) < 0.0 ? LegVector(-n) : n;
}

}  // namespace stance::kinematics
