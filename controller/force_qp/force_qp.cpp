#include "controller/force_qp/force_qp.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "controller/force_qp/osqp_engine.hpp"
#include "controller/force_qp/structured_engine.hpp"

namespace stance::force_qp {
namespace {

constexpr int kMaxStages = 200;

template <typename T>
void require(bool holds, const char* field, T value, const char* range) {
  if (holds) return;
  std::ostringstream message;
  message << "force_qp: " << field << " = " << value << " is outside " << range;
  throw std::invalid_argument(message.str());
}

Sizes validated(Sizes sizes) {
  require(sizes.num_stages >= 1 && sizes.num_stages <= kMaxStages, "num_stages", sizes.num_stages, "[1, 200]");
  require(sizes.num_contacts >= 1 && sizes.num_contacts <= kMaxContacts, "num_contacts", sizes.num_contacts, "[1, 4]");
  return sizes;
}

}  // namespace

Problem::Problem(Sizes with) : sizes(validated(with)), stages(static_cast<std::size_t>(with.num_stages)) {
  for (StageData& stage : stages) {
    stage.dynamics.B.setZero(centroidal::kStates, 3 * sizes.num_contacts);
    stage.f_ref.setZero(3 * sizes.num_contacts);
    stage.R.setOnes(3 * sizes.num_contacts);
  }
}

Solution::Solution(Sizes sizes)
    : forces(static_cast<std::size_t>(validated(sizes).num_stages), ForceVector::Zero(3 * sizes.num_contacts)),
      states(static_cast<std::size_t>(sizes.num_stages), StateVector::Zero()) {}

void Settings::validate() const {
  require(tolerance >= 1e-12 && tolerance <= 1e-2, "tolerance", tolerance, "[1e-12, 1e-2]");
  require(max_iterations >= 1 && max_iterations <= 1000000, "max_iterations", max_iterations, "[1, 1000000]");
  require(fallback_iterations >= 0 && fallback_iterations <= 1000000, "fallback_iterations", fallback_iterations,
          "[0, 1000000]");
  require(check_interval >= 1 && check_interval <= 1000, "check_interval", check_interval, "[1, 1000]");
  require(rho >= 1e-6 && rho <= 1e6, "rho", rho, "[1e-6, 1e6]");
  require(max_primal_residual > 0.0 && std::isfinite(max_primal_residual), "max_primal_residual", max_primal_residual,
          "(0, inf)");
  require(max_dual_residual > 0.0 && std::isfinite(max_dual_residual), "max_dual_residual", max_dual_residual,
          "(0, inf)");
}

std::unique_ptr<ForceQp> make_force_qp(const Settings& settings, Sizes sizes, double typical_force) {
  settings.validate();
  validated(sizes);
  require(typical_force > 0.0 && std::isfinite(typical_force), "typical_force", typical_force, "(0, inf)");
  switch (settings.engine) {
    case QpEngine::kOsqpCondensed:
    case QpEngine::kOsqpSparse:
      return make_osqp_engine(settings, sizes, typical_force);
    case QpEngine::kStructured:
      return make_structured_engine(settings, sizes, typical_force);
  }
  throw std::invalid_argument("force_qp: engine is none of QpEngine");
}

}  // namespace stance::force_qp
