#include "controller/force_qp/kkt.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stance::force_qp {
namespace {

// With the structure of A = [I 0 D 0; 0 I 0 E; 0 C I 0; 0 0 0 I] and B = [0; Bv] that inspect() asks for.

/// A x + B f + g
void step(const Dynamics& dynamics, int num_contacts, const StateVector& x, const ForceVector& f,
          StateVector& next) noexcept {
  next = x + dynamics.g;
  next.segment<3>(0).noalias() += dynamics.A.block<3, 3>(0, 6).lazyProduct(x.segment<3>(6));
  next.segment<3>(3).noalias() += dynamics.A.block<3, 3>(3, 9).lazyProduct(x.segment<3>(9));
  next.segment<3>(6).noalias() += dynamics.A.block<3, 3>(6, 3).lazyProduct(x.segment<3>(3));
  for (int c = 0; c < num_contacts; ++c) {
    next.tail<6>().noalias() += dynamics.B.block<6, 3>(6, 3 * c).lazyProduct(f.segment<3>(3 * c));
  }
}

/// to += A' lambda
void add_A_transposed_times(const StateMatrix& A, const StateVector& lambda, StateVector& to) noexcept {
  to += lambda;
  to.segment<3>(3).noalias() += A.block<3, 3>(6, 3).transpose().lazyProduct(lambda.segment<3>(6));
  to.segment<3>(6).noalias() += A.block<3, 3>(0, 6).transpose().lazyProduct(lambda.segment<3>(0));
  to.segment<3>(9).noalias() += A.block<3, 3>(3, 9).transpose().lazyProduct(lambda.segment<3>(3));
}

Residuals contact_residuals(const Vector3& f, const Vector3& gradient, double R_min, double friction, double fz_min,
                            double fz_max) noexcept {
  const double face = friction * f.z();
  Residuals residuals;
  residuals.primal = std::max({std::abs(f.x()) - face, std::abs(f.y()) - face, fz_min - f.z(), f.z() - fz_max, 0.0});
  const Vector3 step = f - project_on_pyramid(f - gradient / R_min, friction, fz_min, fz_max);
  residuals.dual = step.cwiseAbs().maxCoeff();
  return residuals;
}

}  // namespace

Vector3 project_on_pyramid(const Vector3& f, double friction, double fz_min, double fz_max) noexcept {
  // The distance is convex in fz once fx and fy are clamped to the faces; its stationary point is one of three, by how
  // many of the two faces it pushes against.
  const double larger = std::max(std::abs(f.x()), std::abs(f.y()));
  const double smaller = std::min(std::abs(f.x()), std::abs(f.y()));
  const double mu = friction;
  double fz = f.z();
  if (mu * fz < larger) {
    fz = (f.z() + mu * larger) / (1.0 + mu * mu);
    if (mu * fz < smaller) fz = (f.z() + mu * (larger + smaller)) / (1.0 + 2.0 * mu * mu);
  }
  fz = std::clamp(fz, std::max(fz_min, 0.0), fz_max);
  return {std::clamp(f.x(), -mu * fz, mu * fz), std::clamp(f.y(), -mu * fz, mu * fz), fz};
}

int count_active(const Problem& problem, int stage, const ForceVector& f, double tolerance) noexcept {
  const StageData& data = problem.stages[static_cast<std::size_t>(stage)];
  int active = 0;
  for (int c = 0; c < problem.sizes.num_contacts; ++c) {
    const double fz_min = data.fz_min[static_cast<std::size_t>(c)];
    const double fz_max = data.fz_max[static_cast<std::size_t>(c)];
    if (fz_max <= 0.0) continue;
    const Vector3 force = f.segment<3>(3 * c);
    const double face = problem.friction * force.z() - tolerance;
    active += std::abs(force.x()) >= face;
    active += std::abs(force.y()) >= face;
    active += force.z() <= fz_min + tolerance || force.z() >= fz_max - tolerance;
  }
  return active;
}

KktCheck::KktCheck(Sizes sizes)
    : costates_(static_cast<std::size_t>(sizes.num_stages), StateVector::Zero()),
      gradient_(static_cast<std::size_t>(sizes.num_stages), ForceVector::Zero(3 * sizes.num_contacts)) {}

Residuals KktCheck::evaluate(const Problem& problem, const std::vector<ForceVector>& forces,
                             std::vector<StateVector>& states) noexcept {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::size_t N = problem.stages.size();
  const StateVector* x = &problem.x0;
  for (std::size_t k = 0; k < N; ++k) {
    step(problem.stages[k].dynamics, problem.sizes.num_contacts, *x, forces[k], states[k]);
    x = &states[k];
  }

  Residuals worst;
  for (std::size_t k = N; k-- > 0;) {
    const StageData& stage = problem.stages[k];
    const StateVector error = states[k] - stage.x_ref;
    if (k + 1 == N && problem.has_terminal_cost) {
      costates_[k].noalias() = problem.terminal_cost.lazyProduct(error);
    } else {
      costates_[k] = stage.Q.cwiseProduct(error);
      if (k + 1 < N) {
        add_A_transposed_times(problem.stages[k + 1].dynamics.A, costates_[k + 1], costates_[k]);
      }
    }
    gradient_[k] = stage.R.cwiseProduct(forces[k] - stage.f_ref);
    for (int c = 0; c < problem.sizes.num_contacts; ++c) {
      gradient_[k].segment<3>(3 * c).noalias() +=
          stage.dynamics.B.block<6, 3>(6, 3 * c).transpose().lazyProduct(costates_[k].tail<6>());
    }
    if (!forces[k].allFinite() || !gradient_[k].allFinite()) return {kInfinity, kInfinity};
    for (int c = 0; c < problem.sizes.num_contacts; ++c) {
      const auto contact = static_cast<std::size_t>(c);
      const Residuals here = contact_residuals(forces[k].segment<3>(3 * c), gradient_[k].segment<3>(3 * c),
                                               stage.R.segment<3>(3 * c).minCoeff(), problem.friction,
                                               stage.fz_min[contact], stage.fz_max[contact]);
      worst.primal = std::max(worst.primal, here.primal);
      worst.dual = std::max(worst.dual, here.dual);
    }
  }
  return worst;
}

}  // namespace stance::force_qp
