#include "controller/force_qp/inspect.hpp"

#include <cmath>
#include <cstring>

namespace stance::force_qp {
namespace {

constexpr double kSymmetryTolerance = 1e-9;  // relative to the largest entry

// Each as one sum, which is vectorised: a NaN or an infinity makes it a NaN, which equals nothing.
template <typename X>
bool all_finite(const Eigen::DenseBase<X>& x) noexcept {
  return (0.0 * x.derived().array()).sum() == 0.0;
}
template <typename X>
bool all_zero(const Eigen::MatrixBase<X>& x) noexcept {
  return x.cwiseAbs().sum() == 0.0;
}
/// To the bit, for which the C library has the machine's widest compare; 0 and -0 differ, at the price of a factor.
template <typename X>
bool same(const X& x, const X& y) noexcept {
  return x.size() == y.size() &&
         std::memcmp(x.data(), y.data(), sizeof(double) * static_cast<std::size_t>(x.size())) == 0;
}

/// One where A = [I 0 D 0; 0 I 0 E; 0 C I 0; 0 0 0 I] has an entry of the identity, zero in D, E and C.
const StateMatrix kFixed = [] {
  StateMatrix fixed = StateMatrix::Ones();
  fixed.block<3, 3>(0, 6).setZero();
  fixed.block<3, 3>(3, 9).setZero();
  fixed.block<3, 3>(6, 3).setZero();
  return fixed;
}();

const StateMatrix kIdentity = StateMatrix::Identity();  // as numbers, for Eigen to vectorise what it is part of

/// Times zero, what is not finite is a NaN: an A with this structure is finite, in D, E and C too.
bool has_structure(const StateMatrix& A) noexcept { return all_zero((A - kIdentity).cwiseProduct(kFixed)); }

bool is_valid(const StageData& stage, int num_contacts) noexcept {
  const Dynamics& dynamics = stage.dynamics;
  const int num_forces = 3 * num_contacts;
  if (dynamics.B.cols() != num_forces || stage.f_ref.size() != num_forces || stage.R.size() != num_forces) return false;
  if (!has_structure(dynamics.A) || !all_zero(dynamics.B.topRows<6>())) return false;
  if (!all_finite(dynamics.B.bottomRows<6>()) || !all_finite(dynamics.g) || !all_finite(stage.x_ref) ||
      !all_finite(stage.f_ref) || !all_finite(stage.Q) || !all_finite(stage.R)) {
    return false;
  }
  if (!(stage.R.minCoeff() > 0.0) || !(stage.Q.minCoeff() >= 0.0)) return false;
  for (std::size_t c = 0; c < static_cast<std::size_t>(num_contacts); ++c) {
    if (!std::isfinite(stage.fz_min[c]) || !std::isfinite(stage.fz_max[c]) || stage.fz_min[c] > stage.fz_max[c]) {
      return false;
    }
  }
  return true;
}

}  // namespace

QpStatus inspect(const Problem& problem, Sizes sizes) noexcept {
  if (problem.stages.size() != static_cast<std::size_t>(sizes.num_stages) ||
      problem.sizes.num_contacts != sizes.num_contacts) {
    return QpStatus::kInvalidProblem;
  }
  if (!problem.x0.allFinite() || !std::isfinite(problem.friction) || !(problem.friction > 0.0)) {
    return QpStatus::kInvalidProblem;
  }
  if (problem.has_terminal_cost) {
    const StateMatrix& P = problem.terminal_cost;
    if (!P.allFinite() || (P - P.transpose()).cwiseAbs().maxCoeff() > kSymmetryTolerance * P.cwiseAbs().maxCoeff()) {
      return QpStatus::kInvalidProblem;
    }
  }
  bool feasible = true;
  for (const StageData& stage : problem.stages) {
    if (!is_valid(stage, sizes.num_contacts)) return QpStatus::kInvalidProblem;
    for (std::size_t c = 0; c < static_cast<std::size_t>(sizes.num_contacts); ++c) {
      feasible = feasible && stage.fz_max[c] >= 0.0;
    }
  }
  return feasible ? QpStatus::kSolved : QpStatus::kInfeasible;
}

bool matrices_differ(const Problem& a, const Problem& b) noexcept {
  if (a.friction != b.friction || a.has_terminal_cost != b.has_terminal_cost) return true;
  if (a.has_terminal_cost && !same(a.terminal_cost, b.terminal_cost)) return true;
  for (std::size_t k = 0; k < a.stages.size(); ++k) {
    const StageData& now = a.stages[k];
    const StageData& before = b.stages[k];
    if (!same(now.dynamics.A, before.dynamics.A) || !same(now.dynamics.B, before.dynamics.B) ||
        !same(now.Q, before.Q) || !same(now.R, before.R) || now.fz_min != before.fz_min ||
        now.fz_max != before.fz_max) {
      return true;
    }
  }
  return false;
}

}  // namespace stance::force_qp
