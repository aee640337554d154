#include "tests/fuzz/cases.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "tests/force_qp/problems.hpp"

namespace stance::force_qp::test {
namespace {

using Real = long double;
using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

constexpr Real kExact = 1e-6L;      // N
constexpr Real kRounding = 1e-13L;  // of the magnitudes in a sum that a double holds

/// Calls `visit` with every number of `problem` that may be any, and with one of each kind that the structure fixes.
template <typename Visit>
void for_each_number(Problem& problem, const Visit& visit) {
  const auto all = [&](auto& matrix) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i) visit(matrix.data()[i]);
  };
  all(problem.x0);
  visit(problem.friction);
  for (auto& stage : problem.stages) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(problem.sizes.num_contacts); ++c) {
      visit(stage.fz_min[c]);
      visit(stage.fz_max[c]);
    }
    all(stage.x_ref);
    all(stage.f_ref);
    all(stage.Q);
    all(stage.R);
    all(stage.dynamics.g);
    const auto block = [&](auto matrix) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
        for (Eigen::Index i = 0; i < matrix.rows(); ++i) visit(matrix(i, j));
      }
    };
    block(stage.dynamics.B.template bottomRows<6>());
    block(stage.dynamics.A.template block<3, 3>(0, 6));
    block(stage.dynamics.A.template block<3, 3>(3, 9));
    block(stage.dynamics.A.template block<3, 3>(6, 3));
    visit(stage.dynamics.A(2, 2));  // of what the structure fixes, one each
    visit(stage.dynamics.A(4, 3));
    visit(stage.dynamics.B(5, 2));
  }
  if (problem.has_terminal_cost) all(problem.terminal_cost);
}

bool all_finite(const Problem& problem) {
  bool finite = true;
  Problem copy = problem;
  for_each_number(copy, [&](double& x) { finite = finite && std::isfinite(x); });
  return finite;
}

/// Of the structure, with weights that make it convex and bounds in order: by the header's words, not by inspect()'s
/// code.
bool is_valid(const Problem& problem) {
  if (!all_finite(problem) || problem.friction <= 0.0) return false;
  for (const StageData& stage : problem.stages) {
    StateMatrix rest = stage.dynamics.A - StateMatrix::Identity();
    rest.block<3, 3>(0, 6).setZero();
    rest.block<3, 3>(3, 9).setZero();
    rest.block<3, 3>(6, 3).setZero();
    if ((rest.array() != 0.0).any() || (stage.dynamics.B.topRows<6>().array() != 0.0).any()) return false;
    if ((stage.R.array() <= 0.0).any() || (stage.Q.array() < 0.0).any()) return false;
    for (std::size_t c = 0; c < static_cast<std::size_t>(problem.sizes.num_contacts); ++c) {
      if (stage.fz_min[c] > stage.fz_max[c]) return false;
    }
  }
  return true;
}
bool is_feasible(const Problem& problem) {
  for (const StageData& stage : problem.stages) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(problem.sizes.num_contacts); ++c) {
      if (stage.fz_max[c] < 0.0) return false;
    }
  }
  return true;
}

/// The nearest point of a contact's pyramid along which fz is searched: convex in fz once fx and fy are clamped.
std::array<Real, 3> nearest(const std::array<Real, 3>& f, Real mu, Real low, Real high) {
  const auto slope = [&](Real z) {  // of half the squared distance
    Real d = z - f[2];
    for (std::size_t i = 0; i < 2; ++i) {
      const Real over = std::abs(f[i]) - mu * z;
      if (over > 0.0L) d -= mu * over;
    }
    return d;
  };
  Real z = high;
  if (slope(low) >= 0.0L) {
    z = low;
  } else if (slope(high) > 0.0L) {
    Real a = low, b = high;
    for (z = 0.5L * (a + b); a < z && z < b; z = 0.5L * (a + b)) (slope(z) > 0.0L ? b : a) = z;
  }
  return {std::clamp(f[0], -mu * z, mu * z), std::clamp(f[1], -mu * z, mu * z), z};
}

std::string not_solved(const Problem& problem, const std::vector<ForceVector>& forces) {
  const auto N = static_cast<int>(problem.stages.size());
  // Beside each sum the same of magnitudes: what rounding each term may cost.
  std::vector<Vector> error, error_size;
  Vector x = problem.x0.cast<Real>();
  Vector x_size = x.cwiseAbs();
  for (int k = 0; k < N; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const StageData& stage = problem.stages[at];
    const Matrix A = stage.dynamics.A.cast<Real>(), B = stage.dynamics.B.cast<Real>();
    const Vector f = forces[at].cast<Real>(), g = stage.dynamics.g.cast<Real>(), x_ref = stage.x_ref.cast<Real>();
    x = (A * x + B * f + g).eval();
    x_size = (A.cwiseAbs() * x_size + B.cwiseAbs() * f.cwiseAbs() + g.cwiseAbs()).eval();
    error.push_back(x - x_ref);
    error_size.push_back(x_size + x_ref.cwiseAbs());
  }
  Vector costate = Vector::Zero(12), costate_size = Vector::Zero(12);
  for (int k = N - 1; k >= 0; --k) {
    const auto at = static_cast<std::size_t>(k);
    const StageData& stage = problem.stages[at];
    if (k + 1 < N) {
      const Matrix A = problem.stages[at + 1].dynamics.A.cast<Real>();
      costate = (A.transpose() * costate).eval();
      costate_size = (A.cwiseAbs().transpose() * costate_size).eval();
    }
    const bool terminal = k + 1 == N && problem.has_terminal_cost;
    const Matrix weight =
        terminal ? Matrix(problem.terminal_cost.cast<Real>()) : Matrix(stage.Q.cast<Real>().asDiagonal());
    costate += weight * error[at];
    costate_size += weight.cwiseAbs() * error_size[at];
    const Matrix B = stage.dynamics.B.cast<Real>();
    const Vector R_all = stage.R.cast<Real>(), f_all = forces[at].cast<Real>(), f_ref = stage.f_ref.cast<Real>();
    const Vector gradient = R_all.cwiseProduct(f_all - f_ref) + B.transpose() * costate;
    const Vector gradient_size =
        R_all.cwiseProduct(f_all.cwiseAbs() + f_ref.cwiseAbs()) + B.cwiseAbs().transpose() * costate_size;
    for (int c = 0; c < problem.sizes.num_contacts; ++c) {
      const Vector R = stage.R.segment<3>(3 * c).cast<Real>();
      std::array<Real, 3> f, moved;
      for (int i = 0; i < 3; ++i) {
        f[static_cast<std::size_t>(i)] = forces[at](3 * c + i);
        moved[static_cast<std::size_t>(i)] = f[static_cast<std::size_t>(i)] - gradient(3 * c + i) / R.minCoeff();
      }
      const auto bounds = static_cast<std::size_t>(c);
      const Real low = std::max(stage.fz_min[bounds], 0.0);
      const Real high = stage.fz_max[bounds];
      const Real face = static_cast<Real>(problem.friction) * f[2];
      const Real outside = std::max({std::abs(f[0]) - face, std::abs(f[1]) - face, low - f[2], f[2] - high});
      if (!(outside <= kExact + kRounding * (std::abs(f[2]) + std::abs(face)))) {
        return "a force is " + std::to_string(outside) + " N outside its bounds";
      }
      const std::array<Real, 3> near = nearest(moved, problem.friction, low, high);
      const Real rounding = kRounding * gradient_size.segment(3 * c, 3).maxCoeff() / R.minCoeff();
      for (std::size_t i = 0; i < 3; ++i) {
        const Real residual = std::abs(f[i] - near[i]);
        if (!(residual <= kExact + rounding)) {
          return "a force is " + std::to_string(residual) + " N short of stationary";
        }
      }
    }
  }
  return {};
}

}  // namespace

Problem random_problem(std::uint64_t number) {
  std::mt19937_64 random(number);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto log_uniform = [&](double low, double high) { return low * std::pow(high / low, uniform(random)); };
  const Sizes sizes{1 + static_cast<int>(random() % 12), 1 + static_cast<int>(random() % 4)};
  Problem problem = uniform(random) < 0.3 ? any_problem(sizes, random) : standing(sizes.num_stages, sizes.num_contacts);
  problem.friction = log_uniform(0.05, 1.5);
  disturb(problem, log_uniform(0.1, 300.0), random);
  const double R_scale = log_uniform(1e-3, 1e2);
  const double Q_scale = log_uniform(1e-2, 1e2);
  const double kind = uniform(random);
  for (StageData& stage : problem.stages) {
    stage.R *= R_scale;
    stage.Q *= Q_scale;
    if (kind < 0.2) stage.dynamics.B.block(6, 0, 2, 3 * sizes.num_contacts).setZero();  // no arm about x and y
    if (kind > 0.8 && sizes.num_contacts > 1) stage.dynamics.B.middleCols(3, 3) = stage.dynamics.B.leftCols(3);
  }
  return problem;
}

std::vector<std::uint8_t> random_bytes(std::uint64_t number) {
  std::mt19937_64 random(number);
  std::vector<std::uint8_t> bytes(random() % 25);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

Problem problem_from_bytes(std::span<const std::uint8_t> bytes) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto next = [&]() -> std::uint8_t {
    if (bytes.empty()) return 0;
    const std::uint8_t byte = bytes.front();
    bytes = bytes.subspan(1);
    return byte;
  };
  const std::uint8_t begin = next();
  Problem problem = begin % 2 == 0 ? standing(1 + begin / 2 % 12, 1 + begin / 32 % 4) : random_problem(next());
  std::vector<double*> numbers;
  for_each_number(problem, [&](double& x) { numbers.push_back(&x); });
  while (bytes.size() >= 3) {
    const auto high = static_cast<std::size_t>(next());
    const std::size_t at = (256 * high + next()) % numbers.size();
    double& x = *numbers[at];
    static constexpr std::array kValues = {0.0,   -0.0,   1.0,   -1.0,   1e-6, 1e6,   1e-12,     1e12,
                                           1e-90, -1e100, 1e300, 5e-324, kNan, -kNan, kInfinity, -kInfinity};
    const std::uint8_t what = next() % 32;
    if (what < kValues.size()) {
      x = kValues[what];
    } else if (what == 16) {
      std::array<std::uint8_t, 8> raw{};
      for (std::uint8_t& byte : raw) byte = next();
      std::memcpy(&x, raw.data(), sizeof x);
    } else if (what < 24) {
      x *= std::pow(10.0, what - 20);
    } else if (what < 28) {
      x = -x;
    } else if (what < 31) {
      x += what - 29;
    } else {  // both bounds of a contact, if it is those
      x = *numbers[(at + 1) % numbers.size()] = -1.0;
    }
  }
  return problem;
}

Engines::Engines(int fallback_iterations) {
  settings_.engine = QpEngine::kStructured;
  settings_.fallback_iterations = fallback_iterations;
}

ForceQp& Engines::of(const Sizes& sizes) {
  auto& engine = engines_[{sizes.num_stages, sizes.num_contacts}];
  if (engine == nullptr) engine = make_force_qp(settings_, sizes, kTypicalForce);
  return *engine;
}

std::string fault_of(const Problem& problem, const Solution& solution, int max_iterations) {
  const bool valid = is_valid(problem);
  if (solution.iterations < 0 || solution.iterations > max_iterations) {
    return "it took " + std::to_string(solution.iterations) + " iterations of " + std::to_string(max_iterations);
  }
  switch (solution.status) {
    case QpStatus::kNotRun:
      return "it says that it was not run";
    case QpStatus::kSolved:
      if (!valid || !is_feasible(problem)) return "a problem that is none is called solved";
      return not_solved(problem, solution.forces);
    case QpStatus::kInfeasible:
      return valid && is_feasible(problem) ? "a feasible problem is called infeasible" : "";
    case QpStatus::kInvalidProblem: {
      // Of a valid one only where numbers are beyond what can be computed with, or P is not symmetric or not convex.
      double largest = 0.0;
      double smallest_R = 1.0;
      Problem copy = problem;
      for_each_number(copy, [&](double& x) { largest = std::max(largest, std::abs(x)); });
      for (const StageData& stage : problem.stages) smallest_R = std::min(smallest_R, stage.R.minCoeff());
      const bool beyond = largest > 1e5 || smallest_R < 1e-90 || problem.has_terminal_cost;
      return valid && is_feasible(problem) && !beyond ? "a valid problem is called invalid" : "";
    }
    case QpStatus::kMaxIterations:
    case QpStatus::kInaccurate:
      return valid && is_feasible(problem) ? "" : "a problem that is none is said to have been tried";
  }
  return "its status is none";
}

}  // namespace stance::force_qp::test
