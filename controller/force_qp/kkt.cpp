#include "controller/force_qp/kkt.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stance::force_qp {
namespace {

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
    const Dynamics& dynamics = problem.stages[k].dynamics;
    states[k].noalias() = dynamics.A.lazyProduct(*x);
    states[k].noalias() += dynamics.B.lazyProduct(forces[k]);
    states[k] += dynamics.g;
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
        costates_[k].noalias() += problem.stages[k + 1].dynamics.A.transpose().lazyProduct(costates_[k + 1]);
      }
    }
    gradient_[k] = stage.R.cwiseProduct(forces[k] - stage.f_ref);
    gradient_[k].noalias() += stage.dynamics.B.transpose().lazyProduct(costates_[k]);
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
