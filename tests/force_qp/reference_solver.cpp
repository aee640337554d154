#include "tests/force_qp/reference_solver.hpp"

#include <algorithm>
#include <stdexcept>

namespace stance::force_qp::test {
namespace {

using Real = long double;
using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

constexpr int kMaxIterations = 200;
constexpr Real kUnit = 100.0L;      // N
constexpr Real kGap = 1e-16L;       // complementarity, in scaled units
constexpr Real kResidual = 1e-10L;  // of the equations, relative to the linear term of the cost
constexpr Real kToBoundary = 0.99L;

/// The largest step in (0, 1] that keeps v + step dv positive, shortened a little.
Real step_length(const Vector& v, const Vector& dv) {
  Real step = 1.0L;
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    if (dv(i) < 0.0L) step = std::min(step, -kToBoundary * v(i) / dv(i));
  }
  return step;
}

}  // namespace

std::vector<ForceVector> reference_forces(const Problem& problem) {
  const auto N = static_cast<Eigen::Index>(problem.stages.size());
  const Eigen::Index num_forces = 3 * problem.sizes.num_contacts;

  // x = X f + x_free, over the forces of the contacts in stance.
  struct Contact {
    Eigen::Index stage;
    Eigen::Index contact;
  };
  std::vector<Contact> stance;
  for (Eigen::Index k = 0; k < N; ++k) {
    for (Eigen::Index c = 0; c < problem.sizes.num_contacts; ++c) {
      if (problem.stages[static_cast<std::size_t>(k)].fz_max[static_cast<std::size_t>(c)] > 0.0)
        stance.push_back({k, c});
    }
  }
  const auto n = static_cast<Eigen::Index>(3 * stance.size());
  Matrix H = Matrix::Zero(n, n);
  Vector h = Vector::Zero(n);
  Matrix X = Matrix::Zero(12, n);
  Vector x = problem.x0.cast<Real>();
  for (Eigen::Index k = 0; k < N; ++k) {
    const StageData& stage = problem.stages[static_cast<std::size_t>(k)];
    const Matrix A = stage.dynamics.A.cast<Real>();
    X = (A * X).eval();
    x = (A * x).eval() + stage.dynamics.g.cast<Real>();
    for (std::size_t i = 0; i < stance.size(); ++i) {
      if (stance[i].stage != k) continue;
      const auto column = static_cast<Eigen::Index>(3 * i);
      X.middleCols(column, 3) += kUnit * stage.dynamics.B.middleCols(3 * stance[i].contact, 3).cast<Real>();
      for (Eigen::Index d = 0; d < 3; ++d) {
        const Real R = stage.R(3 * stance[i].contact + d);
        H(column + d, column + d) += kUnit * kUnit * R;
        h(column + d) -= kUnit * R * static_cast<Real>(stage.f_ref(3 * stance[i].contact + d));
      }
    }
    const bool terminal = k + 1 == N && problem.has_terminal_cost;
    const Matrix weight =
        terminal ? Matrix(problem.terminal_cost.cast<Real>()) : Matrix(stage.Q.cast<Real>().asDiagonal());
    H += X.transpose() * weight * X;
    h += X.transpose() * weight * (x - stage.x_ref.cast<Real>());
  }

  // G f <= b
  const auto m = static_cast<Eigen::Index>(6 * stance.size());
  Matrix G = Matrix::Zero(m, n);
  Vector b = Vector::Zero(m);
  const auto mu = static_cast<Real>(problem.friction);
  for (std::size_t i = 0; i < stance.size(); ++i) {
    const StageData& stage = problem.stages[static_cast<std::size_t>(stance[i].stage)];
    const auto row = static_cast<Eigen::Index>(6 * i);
    const auto column = static_cast<Eigen::Index>(3 * i);
    for (Eigen::Index face = 0; face < 4; ++face) {
      G(row + face, column + face / 2) = face % 2 == 0 ? 1.0L : -1.0L;
      G(row + face, column + 2) = -mu;
    }
    G(row + 4, column + 2) = 1.0L;
    b(row + 4) = stage.fz_max[static_cast<std::size_t>(stance[i].contact)] / kUnit;
    G(row + 5, column + 2) = -1.0L;
    b(row + 5) = -stage.fz_min[static_cast<std::size_t>(stance[i].contact)] / kUnit;
  }

  // Mehrotra's predictor and corrector on H f + h + G'z = 0, G f + s = b, s z = 0, with the cost scaled to a unit
  // diagonal.
  const Real scale = static_cast<Real>(n) / H.trace();
  H *= scale;
  h *= scale;
  Vector f = Vector::Zero(n);
  Vector s = Vector::Ones(m);
  Vector z = Vector::Ones(m);
  const Real residual = kResidual * (1.0L + h.cwiseAbs().maxCoeff());
  bool converged = false;
  for (int iteration = 0; iteration < kMaxIterations && !converged; ++iteration) {
    const Vector r_dual = H * f + h + G.transpose() * z;
    const Vector r_primal = G * f + s - b;
    const Real gap = s.dot(z) / static_cast<Real>(m);
    converged = gap < kGap && r_dual.cwiseAbs().maxCoeff() < residual && r_primal.cwiseAbs().maxCoeff() < residual;
    if (converged) break;
    const Vector weight = z.cwiseQuotient(s);
    const Eigen::LLT<Matrix> llt(H + G.transpose() * weight.asDiagonal() * G);
    const auto direction = [&](const Vector& complementarity, Vector& df, Vector& ds, Vector& dz) {
      // dz = (complementarity - z ds) / s,  ds = -r_primal - G df
      const Vector eliminated = (complementarity + z.cwiseProduct(r_primal)).cwiseQuotient(s);
      df = llt.solve(-r_dual - G.transpose() * eliminated);
      ds = -r_primal - G * df;
      dz = (complementarity - z.cwiseProduct(ds)).cwiseQuotient(s);
    };
    Vector df, ds, dz;
    direction(-s.cwiseProduct(z), df, ds, dz);
    const Real affine_primal = step_length(s, ds);
    const Real affine_dual = step_length(z, dz);
    const Real affine_gap = (s + affine_primal * ds).dot(z + affine_dual * dz) / static_cast<Real>(m);
    const Real ratio = affine_gap / gap;
    const Vector target = Vector::Constant(m, ratio * ratio * ratio * gap);
    direction(target - s.cwiseProduct(z) - ds.cwiseProduct(dz), df, ds, dz);
    const Real step = std::min(step_length(s, ds), step_length(z, dz));
    f += step * df;
    s += step * ds;
    z += step * dz;
  }
  if (!converged) throw std::runtime_error("the reference solver did not converge");

  std::vector<ForceVector> forces(problem.stages.size(), ForceVector::Zero(num_forces));
  for (std::size_t i = 0; i < stance.size(); ++i) {
    forces[static_cast<std::size_t>(stance[i].stage)].segment<3>(3 * stance[i].contact) =
        (kUnit * f.segment<3>(static_cast<Eigen::Index>(3 * i))).cast<double>();
  }
  return forces;
}

}  // namespace stance::force_qp::test
