#pragma once
// Kinematics and dynamics of a rigid_body::Model, floating or fixed base. Nothing here allocates or throws.
//
// Generalised velocity nu = (w_WB_W, v_WB, qd): angular and linear velocity of B's origin in W, then the joints' rates.
// The base twist columns come first, so a matrix over nu is (6 + n) wide. Fixed base: leave the base state at its
// default.
//
// References: Lynch and Park, Modern Robotics (2017), ch. 8 (eqs 8.50-8.54);
//             Orin, Goswami and Lee, Centroidal dynamics of a humanoid robot, Auton. Robots 35 (2013).
#include <Eigen/Core>
#include <array>
#include <span>

#include "controller/math/se3.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::rigid_body {

/// Bounded matrices over nu: no allocation.
using MatrixNu = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6 + kMaxJoints, 6 + kMaxJoints>;
using VectorNu = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6 + kMaxJoints, 1>;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6 + kMaxJoints>;
using Matrix6Nu = Jacobian;

/// Position-level and velocity-level state of the tree.
struct State {
  Vector3 p_WB = Vector3::Zero();  ///< m
  Matrix3 R_WB = Matrix3::Identity();
  Vector3 v_WB = Vector3::Zero();        ///< m/s, of B's origin
  Vector3 w_WB_W = Vector3::Zero();      ///< rad/s
  JointVector q = JointVector::Zero();   ///< rad
  JointVector qd = JointVector::Zero();  ///< rad/s
};

/// Poses and velocities of every link frame and centre of mass, in W. Entries past the model's bodies and joints are
/// not set.
struct Kinematics {
  std::array<Matrix3, kMaxBodies> R_W;      ///< link frame to W
  std::array<Vector3, kMaxBodies> p_W;      ///< m, link frame's origin
  std::array<Vector3, kMaxBodies> com_W;    ///< m, body's centre of mass
  std::array<Vector3, kMaxBodies> w_W;      ///< rad/s
  std::array<Vector3, kMaxBodies> v_com_W;  ///< m/s, of the body's centre of mass
  std::array<Vector3, kMaxJoints> axis_W;   ///< joints' axes, unit vectors
};
void forward_kinematics(const Model& model, const State& state, Kinematics& kinematics) noexcept;

/// Geometric Jacobian (angular rows first) over nu of the point `p_W` fixed to `body`: (omega, v) = J nu.
/// Shape 6 x (6 + n).
void geometric_jacobian(const Model& model, const State& state, const Kinematics& kinematics, int body,
                        const Vector3& p_W, Jacobian& J) noexcept;

/// Joint-space and base inverse dynamics by the recursive Newton-Euler algorithm: M(q) nud + h(q, nu) = generalised
/// force. `nud` = (angular, linear acceleration of B in W, qdd). Returns the 6 + n generalised forces (moment and force
/// on the base about B's origin in W, then joint torques) that produce it, gravity (0, 0, -9.81) included.
void inverse_dynamics(const Model& model, const State& state, const VectorNu& nud, VectorNu& tau) noexcept;

/// Mass matrix over nu (6 + n square, symmetric to the bit), by composite rigid bodies: nu^T M nu / 2 is the kinetic
/// energy.
void mass_matrix(const Model& model, const State& state, MatrixNu& M) noexcept;

/// Generalised gravity forces: inverse_dynamics at nu = 0, nud = 0. The last n are the torques that hold the joints
/// against gravity.
void gravity_torques(const Model& model, const State& state, VectorNu& tau) noexcept;

/// Whole-body quantities about the centre of mass.
struct Centroidal {
  double mass = 0.0;                    ///< kg
  Vector3 p_WC = Vector3::Zero();       ///< m
  Vector3 v_WC = Vector3::Zero();       ///< m/s
  Vector3 L_C_W = Vector3::Zero();      ///< kg m^2/s
  Matrix3 inertia_W = Matrix3::Zero();  ///< kg m^2, composite (joints locked) about C, axes of W
};
void centroidal(const Model& model, const Kinematics& kinematics, Centroidal& out) noexcept;

/// Centroidal momentum matrix: (L_C_W, m v_WC) = A_G nu. Shape 6 x (6 + n).
void centroidal_momentum_matrix(const Model& model, const Kinematics& kinematics, Matrix6Nu& A_G) noexcept;

/// Rows of linear constraints on nu.
inline constexpr int kMaxConstraintRows = 6 + kMaxJoints;
using ConstraintRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxConstraintRows, 6 + kMaxJoints>;

/// How the robot's angular momentum answers to its trunk when it stands on its feet: d L_C_W / d w_WB_W, axes of W (kg
/// m^2), over the motions that hold the tips of the `held` feet and the centre of mass still and fulfil `constraints`
/// nu = 0. `constraints`, rows x (6 + n) and empty where there are none, says how the joints follow. Given w_WB_W, all
/// these must determine (v_WB, qd): where they leave freedom the least-norm motion is taken, where they contradict each
/// other the least-squares one. At most kMaxContacts feet.
Matrix3 effective_inertia(const Model& model, const State& state, const Kinematics& kinematics,
                          std::span<const Foot> held, const ConstraintRows& constraints) noexcept;

}  // namespace stance::rigid_body
