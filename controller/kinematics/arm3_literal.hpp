#pragma once
// Document 004 to the letter, misprints and all: what its terminal's printout comes from, and nothing to control an arm
// with. arm3.hpp has the same put right.
#include "controller/kinematics/arm3.hpp"

namespace stance::kinematics::literal {

/// The rates (rad/s) that the program behind the printout played: not those that the document gives.
Vector3 arm3_rates(double t) noexcept;

/// xi = (v, omega), with s(t2 - t3) for s(t2 + t3) in the third row, and omega_z = thetad_3.
Vector6 arm3_velocity(const Arm3Geometry& arm, const Vector3& theta, const Vector3& thetad) noexcept;

/// J as it was printed: the third row as above, and the fourth and fifth (0, c1, c2) and (0, s2, s1).
Arm3Jacobian arm3_jacobian(const Arm3Geometry& arm, const Vector3& theta) noexcept;

/// T R A with R = 1 + [omega dt]x, in whose third row dphi_z stands for dphi_x. Shape 4 x 4; its rotation is none.
Eigen::Matrix4d updated_map(const Eigen::Matrix4d& A, const Vector6& xi, double dt) noexcept;

}  // namespace stance::kinematics::literal
