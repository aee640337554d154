#include "controller/planning/footholds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "controller/interface/require.hpp"

namespace stance::planning {
namespace {

constexpr double kTimeStep = 0.01, kSecondTimeStep = 0.02;  // s, of the grids
constexpr int kMaxSecondTimes = 16;
// Deviations that cost 1.
constexpr double kDeviation = 0.02;    // m, of the divergent component, of foot travel
constexpr double kDuration = 0.05;     // s
constexpr double kReach = 0.03;        // m
constexpr double kClearance = 0.01;    // m
constexpr double kFirstWeight = 0.25;  // of the first deviation, which the second step may mend
constexpr double kChangeWeight = 0.5;  // of a change of T1 since the last tick

double square(double x) noexcept { return x * x; }

Vector2 drawn(const Vector2& to, const Vector2& point, double reach) noexcept {
  const Vector2 from = point - to;
  const double distance = from.norm();
  return distance > reach ? Vector2(to + from * (reach / distance)) : point;
}

/// What a foothold wanted at `wanted` comes to, with the centre of mass at `com` at touchdown.
Vector2 clamped(const FootholdConfig& c, const Vector2& wanted, const Vector2& com, double side, double hip,
                int crossing) noexcept {
  Vector2 u;
  if (crossing == 0) {
    u.x() = std::clamp(wanted.x(), -c.max_forward, c.max_forward);
    u.y() = side * std::clamp(side * wanted.y(), c.min_lateral, c.max_lateral);
  } else {
    u.x() = crossing * std::clamp(crossing * wanted.x(), c.crossing_forward, c.max_forward);
    u.y() = side * std::clamp(side * wanted.y(), -c.crossing_lateral, c.max_lateral);
  }
  u = drawn(com + Vector2(0.0, side * hip), u, c.hip_reach);
  u = drawn(com, u, c.centre_reach);
  if (crossing == 0) {
    u.y() = side * std::max(side * u.y(), c.min_lateral);
  } else {
    u.x() = crossing * std::max(crossing * u.x(), c.crossing_forward);
  }
  return u;
}

/// Of the origin from the segment from `a` to `b`.
double distance_of_origin(const Vector2& a, const Vector2& b) noexcept {
  const Vector2 along = b - a;
  const double t = std::clamp(-a.dot(along) / std::max(along.squaredNorm(), 1e-9), 0.0, 1.0);
  return (a + t * along).norm();
}

struct Grown {
  double time = 0.0;    // s, T2
  double growth = 1.0;  // exp(omega (T2 + T_ds))
};

/// Costs of the reach of a stance leg whose hip lies at `hip` from the foot, and of a duration.
double reach_cost(const FootholdConfig& c, const Vector2& hip) noexcept {
  return square(std::max(0.0, hip.norm() - c.hip_reach) / kReach);
}
double duration_cost(const FootholdConfig& c, double time) noexcept {
  return square((time - c.swing_time) / kDuration);
}

struct Search {
  const FootholdConfig& c;
  const FootholdProblem& p;
  Vector2 b, b2;
  std::array<Grown, kMaxSecondTimes> seconds{};
  int num_seconds = 0;

  Search(const FootholdConfig& config, const FootholdProblem& problem) noexcept
      : c(config),
        p(problem),
        b(steady_offset(config, problem.omega, problem.velocity, problem.side)),
        b2(steady_offset(config, problem.omega, problem.velocity, -problem.side)) {
    const int steps = static_cast<int>(std::lround((c.max_second_time - c.min_second_time) / kSecondTimeStep));
    num_seconds = std::min(steps + 1, kMaxSecondTimes);
    for (int j = 0; j < num_seconds; ++j) {
      const double time = c.min_second_time + j * kSecondTimeStep;
      seconds[static_cast<std::size_t>(j)] = {time, std::exp(p.omega * (time + p.double_support))};
    }
  }

  void consider(double T1, int crossing, FootholdPlan& best) const noexcept {
    const double growth = std::exp(p.omega * (T1 - p.time + 0.5 * p.double_support));
    const Vector2 Xi = p.com.divergent(p.omega) * growth;
    const Vector2 X = 0.5 * (Xi + p.com.convergent(p.omega) / growth);
    const Vector2 U = clamped(c, Xi - b, X, p.side, p.hip_lateral, crossing);
    const double deviation = (Xi - U - b).norm();
    const double over = std::max(0.0, (U - p.swing_foot).norm() - c.foot_speed * std::max(T1 - p.time, kTimeStep));
    const double clearance = std::max(0.0, c.path_clearance - distance_of_origin(p.swing_foot, U));
    const double first = kFirstWeight * square(deviation / kDeviation) + square(over / kDeviation) +
                         duration_cost(c, T1) + kChangeWeight * square((T1 - p.swing_time) / kDuration) +
                         reach_cost(c, X - Vector2(0.0, p.side * p.hip_lateral)) + square(clearance / kClearance) +
                         (crossing != 0 ? c.crossing_cost : 0.0);
    if (first >= best.cost) return;
    const Vector2 b1 = Xi - U, q1 = 2.0 * X - Xi - U;
    for (int j = 0; j < num_seconds; ++j) {
      const Grown& second = seconds[static_cast<std::size_t>(j)];
      const Vector2 Xi2 = b1 * second.growth;
      const Vector2 X2 = 0.5 * (Xi2 + q1 / second.growth);
      const Vector2 U2 = clamped(c, Xi2 - b2, X2, -p.side, p.hip_lateral, 0);
      const double deviation2 = (Xi2 - U2 - b2).norm();
      const double over2 = std::max(0.0, (U2 + U).norm() - c.foot_speed * second.time);
      const double clearance2 = std::max(0.0, c.path_clearance - distance_of_origin(-U, U2));
      const double cost = first + square(deviation2 / kDeviation) + square(over2 / kDeviation) +
                          duration_cost(c, second.time) + reach_cost(c, X2 + Vector2(0.0, p.side * p.hip_lateral)) +
                          square(clearance2 / kClearance);
      if (cost < best.cost) best = {U, T1, second.time, deviation, deviation2, cost, crossing};
    }
  }

  void consider_all(int crossing, FootholdPlan& best) const noexcept {
    const double earliest = std::max(p.time + c.min_time_left, c.min_swing_time);
    const int steps = std::max(0, static_cast<int>(std::floor((c.max_swing_time - earliest) / kTimeStep + 1e-6)));
    for (int i = 0; i <= steps; ++i) consider(earliest + i * kTimeStep, crossing, best);
  }
};

constexpr Require require{"footholds."};

}  // namespace

void FootholdConfig::validate() const {
  require(step_width > 0.0, "step_width", step_width, "> 0 m");
  require(swing_time > 0.05 && swing_time < 1.0, "swing_time", swing_time, "in 0.05..1 s");
  require(double_support > 0.0 && double_support < 0.5, "double_support", double_support, "in 0..0.5 s");
  require(min_swing_time > 0.0, "min_swing_time", min_swing_time, "> 0 s");
  require(max_swing_time >= min_swing_time && max_swing_time < 1.0, "max_swing_time", max_swing_time,
          "at least min_swing_time and < 1 s");
  require(min_second_time > 0.0, "min_second_time", min_second_time, "> 0 s");
  require(max_second_time >= min_second_time &&
              max_second_time <= min_second_time + (kMaxSecondTimes - 1) * kSecondTimeStep,
          "max_second_time", max_second_time, "at least min_second_time, and at most 0.3 s more");
  require(min_time_left > 0.0, "min_time_left", min_time_left, "> 0 s");
  require(max_forward > 0.0, "max_forward", max_forward, "> 0 m");
  require(min_lateral > 0.0, "min_lateral", min_lateral, "> 0 m");
  require(max_lateral >= min_lateral, "max_lateral", max_lateral, "at least min_lateral");
  require(crossing_forward > 0.0 && crossing_forward <= max_forward, "crossing_forward", crossing_forward,
          "in 0..max_forward");
  require(crossing_lateral >= 0.0, "crossing_lateral", crossing_lateral, ">= 0 m");
  require(hip_reach > 0.0, "hip_reach", hip_reach, "> 0 m");
  require(centre_reach > 0.0, "centre_reach", centre_reach, "> 0 m");
  require(foot_speed > 0.0, "foot_speed", foot_speed, "> 0 m/s");
  require(path_clearance >= 0.0, "path_clearance", path_clearance, ">= 0 m");
  require(crossing_cost >= 0.0, "crossing_cost", crossing_cost, ">= 0");
  require(crossing_threshold >= 0.0, "crossing_threshold", crossing_threshold, ">= 0");
}

double steady_width(const FootholdConfig& config, const Vector2& velocity) noexcept {
  const double period = config.swing_time + config.double_support;
  return std::max(config.step_width, config.path_clearance + std::abs(velocity.y()) * period);
}

Vector2 steady_offset(const FootholdConfig& config, double omega, const Vector2& velocity, double side) noexcept {
  const double period = config.swing_time + config.double_support;
  const double growth = std::exp(omega * period);
  return velocity * (period / (growth - 1.0)) + Vector2(0.0, -side * steady_width(config, velocity) / (1.0 + growth));
}

FootholdPlan plan_footholds(const FootholdConfig& config, const FootholdProblem& problem) noexcept {
  const Search search(config, problem);
  FootholdPlan best;
  best.cost = std::numeric_limits<double>::infinity();
  search.consider_all(0, best);
  if (best.cost >= config.crossing_threshold) {
    search.consider_all(1, best);
    search.consider_all(-1, best);
  }
  return best;
}

Vector2 foothold_at(const FootholdConfig& config, const FootholdProblem& problem, double swing_time,
                    int crossing) noexcept {
  const double left = std::max(0.0, swing_time - problem.time) + 0.5 * problem.double_support;
  const double growth = std::exp(problem.omega * left);
  const Vector2 Xi = problem.com.divergent(problem.omega) * growth;
  const Vector2 X = 0.5 * (Xi + problem.com.convergent(problem.omega) / growth);
  return clamped(config, Xi - steady_offset(config, problem.omega, problem.velocity, problem.side), X, problem.side,
                 problem.hip_lateral, crossing);
}

}  // namespace stance::planning
