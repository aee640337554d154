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

  /// Adds a body with its centre of mass at `r` (m), `R` taking its axes to this frame's; `body_inertia` (kg m^2) is
  /// about that centre, along its axes.
  void add_body(double body_mass, const Matrix3& body_inertia, const Matrix3& R, const Vector3& r) noexcept {
    mass += body_mass;
    moment += body_mass * r;
    inertia += R * body_inertia * R.transpose();
    inertia.diagonal().array() += body_mass * r.squaredNorm();
    inertia -= body_mass * r * r.transpose();
  }

  CompositeInertia& operator+=(const CompositeInertia& other) noexcept {
    mass += other.mass;
    moment += other.moment;
    inertia += other.inertia;
    return *this;
  }
};

}  // namespace stance::rigid_body
