#pragma once
// The centroidal model of document 000 (eqs 19-25), for n point contacts:
//
//   x = (theta = roll pitch yaw, p = p_WC, omega, v = pdot)  [rad, m, rad/s, m/s], all in W
//   f = (f_1 ... f_n)  [N], on the robot, in W
//   x(k+1) = A x(k) + B f(k) + g
//     theta += dt Rz(yaw)^T omega      omega += dt I^-1 sum_i r_i x f_i      I = Rz I_body Rz^T,  r_i = p_WFi - p_WC
//     p     += dt v                    v     += dt/m sum_i f_i + dt (0, 0, -9.81)
//
// It drops the gyroscopic term and holds for small roll and pitch. With `coupling`, r_i x f_i is linearised about a
// reference too:
//     omega += dt I^-1 [F_ref]x (p - p_ref),      F_ref the reference's total force, p_ref its centre of mass;
// without it x and pitch are two double integrators on one input (two point feet), i.e. uncontrollable.
#include <Eigen/Core>

#include "controller/interface/signals.hpp"

namespace stance::centroidal {

inline constexpr int kStates = 12;
inline constexpr int kMaxForces = 3 * kMaxContacts;
using StateVector = CentroidalState;
using StateMatrix = Eigen::Matrix<double, kStates, kStates>;
using InputMatrix = Eigen::Matrix<double, kStates, Eigen::Dynamic, 0, kStates, kMaxForces>;
using ForceVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxForces, 1>;

struct Parameters {
  double mass = 0.0;                       ///< kg
  Matrix3 inertia_body = Matrix3::Zero();  ///< kg m^2, about C, axes of H (yaw removed)
};

/// What one stage is linearised about.
struct Linearisation {
  double dt = kControlPeriod;  ///< s
  double yaw = 0.0;            ///< rad
  int num_contacts = 0;
  ContactVectors r{};  ///< m, from p_ref to each contact, in W
  bool coupling = false;
  Vector3 force_ref = Vector3::Zero();  ///< N, total, in W; used with coupling
  Vector3 p_ref = Vector3::Zero();      ///< m, in W; used with coupling
};

struct Dynamics {
  StateMatrix A = StateMatrix::Identity();
  InputMatrix B;
  StateVector g = StateVector::Zero();
};
/// A, B and g of one stage.
void dynamics(const Parameters& parameters, const Linearisation& at, Dynamics& out) noexcept;

/// ||f||_R = sqrt(f^T R f), R diagonal (eq 25).
double effort(const ForceVector& f, const ForceVector& R_diagonal) noexcept;

/// P of the discrete algebraic Riccati equation P = Q + A^T P A - A^T P B (R + B^T P B)^-1 B^T P A, by structured
/// doubling. Throws std::invalid_argument where it does not converge (the pair is not stabilisable). Set-up only.
StateMatrix riccati_terminal_cost(const Dynamics& dynamics, const StateVector& Q_diagonal,
                                  const ForceVector& R_diagonal);

}  // namespace stance::centroidal
