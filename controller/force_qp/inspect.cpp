#include "controller/force_qp/inspect.hpp"

#include <cmath>

namespace stance::force_qp {
namespace {

constexpr double kSymmetryTolerance = 1e-9;  // relative to the largest entry

bool has_structure(const StateMatrix& A) noexcept {
  // A = [I 0 D 0; 0 I 0 E; 0 C I 0; 0 0 0 I]
  return A.block<3, 3>(0, 0).isIdentity(0.0) && A.block<3, 3>(3, 3).isIdentity(0.0) &&
         A.block<3, 3>(6, 6).isIdentity(0.0) && A.block<3, 3>(9, 9).isIdentity(0.0) &&
         A.block<3, 3>(0, 3).isZero(0.0) && A.block<3, 3>(0, 9).isZero(0.0) && A.block<3, 3>(3, 0).isZero(0.0) &&
         A.block<3, 3>(3, 6).isZero(0.0) && A.block<3, 3>(6, 0).isZero(0.0) && A.block<3, 3>(6, 9).isZero(0.0) &&
         A.block<3, 9>(9, 0).isZero(0.0);
}

bool is_valid(const StageData& stage, int num_contacts) noexcept {
  const Dynamics& dynamics = stage.dynamics;
  const int num_forces = 3 * num_contacts;
  if (dynamics.B.cols() != num_forces || stage.f_ref.size() != num_forces || stage.R.size() != num_forces) return false;
  if (!dynamics.A.allFinite() || !dynamics.B.allFinite() || !dynamics.g.allFinite() || !stage.x_ref.allFinite() ||
      !stage.f_ref.allFinite() || !stage.Q.allFinite() || !stage.R.allFinite()) {
    return false;
  }
  if (!has_structure(dynamics.A) || !dynamics.B.topRows<6>().isZero(0.0)) return false;
  if (!(stage.R.array() > 0.0).all() || !(stage.Q.array() >= 0.0).all()) return false;
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
  if (a.has_terminal_cost && a.terminal_cost != b.terminal_cost) return true;
  for (std::size_t k = 0; k < a.stages.size(); ++k) {
    const StageData& now = a.stages[k];
    const StageData& before = b.stages[k];
    if (now.dynamics.A != before.dynamics.A || now.dynamics.B != before.dynamics.B || now.Q != before.Q ||
        now.R != before.R || now.fz_min != before.fz_min || now.fz_max != before.fz_max) {
      return true;
    }
  }
  return false;
}

}  // namespace stance::force_qp
