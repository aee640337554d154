#include "controller/centroidal/centroidal.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace stance::centroidal {
namespace {

// Rows of the state.
constexpr int kTheta = 0;
constexpr int kPosition = 3;
constexpr int kOmega = 6;
constexpr int kVelocity = 9;

constexpr int kMaxDoublings = 50;             // 2^50 stages
constexpr double kDoublingTolerance = 1e-14;  // of the last step, relative to P
constexpr double kResidualTolerance = 1e-8;   // of the equation, relative to P

// Set-up only: dynamic sizes are compiled once, where fixed ones are unrolled everywhere.
using Eigen::MatrixXd;

/// Right side of the Riccati equation at P.
MatrixXd riccati_map(const MatrixXd& A, const MatrixXd& B, const MatrixXd& Q, const MatrixXd& R, const MatrixXd& P) {
  const MatrixXd Quu = R + B.transpose() * P * B;
  const MatrixXd Qux = B.transpose() * P * A;
  return Q + A.transpose() * P * A - Qux.transpose() * Quu.llt().solve(Qux);
}

[[noreturn]] void throw_unstabilisable(const char* what, double value) {
  std::ostringstream message;
  message << "riccati_terminal_cost: " << what << " is " << value
          << ": the forces cannot stabilise this model (two point feet need the coupling term)";
  throw std::invalid_argument(message.str());
}

}  // namespace

void dynamics(const Parameters& parameters, const Linearisation& at, Dynamics& out) noexcept {
  const Matrix3 Rz = math::rotation_z(at.yaw);
  const Matrix3 inertia_inverse = Rz * parameters.inertia_body.inverse() * Rz.transpose();  // in W

  out.A.setIdentity();
  out.A.block<3, 3>(kTheta, kOmega) = at.dt * Rz.transpose();
  out.A.block<3, 3>(kPosition, kVelocity) = at.dt * Matrix3::Identity();
  out.g.setZero();
  out.g(kVelocity + 2) = -at.dt * kGravity;
  if (at.coupling) {
    const Matrix3 C = at.dt * inertia_inverse * math::skew(at.force_ref);
    out.A.block<3, 3>(kOmega, kPosition) = C;
    out.g.segment<3>(kOmega) = -C * at.p_ref;
  }

  out.B.setZero(kStates, 3 * at.num_contacts);
  for (int i = 0; i < at.num_contacts; ++i) {
    out.B.block<3, 3>(kOmega, 3 * i) = at.dt * inertia_inverse * math::skew(at.r[static_cast<std::size_t>(i)]);
    out.B.block<3, 3>(kVelocity, 3 * i) = (at.dt / parameters.mass) * Matrix3::Identity();
  }
}

double effort(const ForceVector& f, const ForceVector& R_diagonal) noexcept {
  return std::sqrt((f.array().square() * R_diagonal.array()).sum());
}

StateMatrix riccati_terminal_cost(const Dynamics& dynamics, const StateVector& Q_diagonal,
                                  const ForceVector& R_diagonal) {
  // Each doubling of (E, G, H) squares the number of stages that H accounts for:
  //   W = (I + G H)^-1,   E <- E W E,   G <- G + E W G E^T,   H <- H + E^T H W E,   H -> P
  const MatrixXd A = dynamics.A;
  const MatrixXd B = dynamics.B;
  const MatrixXd Q = Q_diagonal.asDiagonal();
  const MatrixXd R = R_diagonal.asDiagonal();
  const MatrixXd I = MatrixXd::Identity(kStates, kStates);
  MatrixXd E = A;
  MatrixXd G = B * R.llt().solve(B.transpose());
  MatrixXd H = Q;
  double step = 0.0;
  for (int doubling = 0; doubling < kMaxDoublings; ++doubling) {
    const Eigen::PartialPivLU<MatrixXd> W(I + G * H);
    const MatrixXd WE = W.solve(E);
    const MatrixXd dG = E * W.solve(G) * E.transpose();
    const MatrixXd dH = E.transpose() * H * WE;
    G += 0.5 * (dG + dG.transpose());
    H += 0.5 * (dH + dH.transpose());
    E = (E * WE).eval();
    step = dH.norm() / H.norm();
    if (!std::isfinite(step)) break;
    if (step <= kDoublingTolerance) {
      const double residual = (riccati_map(A, B, Q, R, H) - H).norm() / H.norm();
      if (!(residual <= kResidualTolerance)) throw_unstabilisable("the relative residual of the equation", residual);
      return 0.5 * (H + H.transpose());
    }
  }
  throw_unstabilisable("the relative step of the last doubling", step);
}

}  // namespace stance::centroidal
