#pragma once
// The inertia of several bodies that move as one: what the mass matrices' recursions add up from the tips to the base.
#include "controller/math/se3.hpp"

namespace stance::rigid_body {

/// About the origin of some frame, along its axes.
struct CompositeInertia {
  double mass = 0.0;                  ///< kg
  Vector3 moment = Vector3::Zero();   ///< kg m, mass times centre of mass
  Matrix3 inertia = Matrix3::Zero();  ///< kg m^2

  /// The momentum (angular about the origin, linear) of all that moves with the twist (omega, v).
  Vector6 momentum(const Vector3& omega, const Vector3& v) const noexcept {
    Vector6 out;
    out << inertia * omega + moment.cross(v), mass * v + omega.cross(moment);
    return out;
  }

  CompositeInertia& operator+=(const CompositeInertia& other) noexcept {
    mass += other.mass;
    moment += other.moment;
    inertia += other.inertia;
    return *this;
  }
};

/// The same inertia in frame a, T_ba taking coordinates in a to those in its own frame b: Ad_T^T I Ad_T.
inline CompositeInertia carried_back(const RigidTransform& T_ba, const CompositeInertia& I_b) noexcept {
  const Vector3& p = T_ba.p;  // a's origin
  const Vector3& h = I_b.moment;
  Matrix3 about_p = I_b.inertia + h * p.transpose() + p * h.transpose() - (I_b.mass * p) * p.transpose();
  about_p.diagonal().array() += p.dot(I_b.mass * p - 2.0 * h);
  const Matrix3& R = T_ba.R;
  return {I_b.mass, R.transpose() * (h - I_b.mass * p), R.transpose() * about_p * R};
}

}  // namespace stance::rigid_body
