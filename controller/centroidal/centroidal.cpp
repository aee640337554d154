#include "controller/centroidal/centroidal.hpp"

#include <Eigen/Eigenvalues>
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

/// Right side of the Riccati equation at P.
StateMatrix riccati_map(const Dynamics& dynamics, const StateVector& Q, const ForceVector& R, const StateMatrix& P) {
  const ForceMatrix Quu = ForceMatrix(R.asDiagonal()) + dynamics.B.transpose() * P * dynamics.B;
  const Eigen::MatrixXd Qux = dynamics.B.transpose() * P * dynamics.A;
  return StateMatrix(Q.asDiagonal()) + dynamics.A.transpose() * P * dynamics.A -
         Qux.transpose() * Quu.ldlt().solve(Qux);
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
  StateMatrix E = dynamics.A;
  StateMatrix G = dynamics.B * R_diagonal.cwiseInverse().asDiagonal() * dynamics.B.transpose();
  StateMatrix H = Q_diagonal.asDiagonal();
  double step = 0.0;
  for (int doubling = 0; doubling < kMaxDoublings; ++doubling) {
    const Eigen::PartialPivLU<StateMatrix> lu(StateMatrix::Identity() + G * H);
    const StateMatrix WE = lu.solve(E);
    const StateMatrix WG = lu.solve(G);
    const StateMatrix dH = E.transpose() * H * WE;
    G += E * WG * E.transpose();
    G = (0.5 * (G + G.transpose())).eval();
    H += 0.5 * (dH + dH.transpose());
    E = (E * WE).eval();
    step = dH.norm() / H.norm();
    if (!std::isfinite(step)) break;
    if (step <= kDoublingTolerance) {
      const double residual = (riccati_map(dynamics, Q_diagonal, R_diagonal, H) - H).norm() / H.norm();
      if (!(residual <= kResidualTolerance)) throw_unstabilisable("the relative residual of the equation", residual);
      return H;
    }
  }
  throw_unstabilisable("the relative step of the last doubling", step);
}

}  // namespace stance::centroidal
