// Time of a force QP on a made-up biped of the real one's size (tests/force_qp/problems.hpp), problem update included.
//
// A sequence is 400 ticks of the model in closed loop with the engine's own forces, with noise, and a push every 50
// ticks; the free minimiser leaves the constraints for some ticks after each. Every sequence runs several times from a
// fresh engine and each tick counts with its fastest run, so that p99 is the algorithm's tail and not the machine's.
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <random>
#include <string_view>
#include <vector>

#include "controller/force_qp/force_qp.hpp"
#include "tests/force_qp/problems.hpp"

namespace {

using namespace stance;
using namespace stance::force_qp;

constexpr int kTicks = 400;
constexpr int kRuns = 7;
constexpr int kTicksBetweenPushes = 50;
constexpr double kNoise = 0.1;
constexpr double kLost = 0.5;  // any state's deviation from which the model starts again at its reference
constexpr unsigned kSeed = 1;

struct Case {
  const char* name;
  int num_stages;
  bool walks;
  double push;
  double friction;
};

Problem undisturbed(const Case& with, int tick) {
  return with.walks ? test::walking(with.num_stages, tick, with.friction)
                    : test::standing(with.num_stages, 2, with.friction);
}

std::vector<Problem> record(const Case& with) {
  std::mt19937_64 random(kSeed);
  std::vector<Problem> problems;
  auto engine = make_force_qp({}, {with.num_stages, 2}, test::kWeight);
  Solution solution({with.num_stages, 2});
  StateVector deviation = StateVector::Zero();
  for (int tick = 0; tick < kTicks; ++tick) {
    Problem problem = undisturbed(with, tick);
    problem.x0 += deviation;
    if (tick % kTicksBetweenPushes == kTicksBetweenPushes / 2) test::disturb(problem, with.push, random);
    const StateVector x = problem.x0;
    test::disturb(problem, kNoise, random);
    if (engine->solve(problem, solution) != QpStatus::kSolved) std::printf("tick %d is not solved\n", tick);
    const Dynamics& model = problem.stages.front().dynamics;
    deviation = model.A * x + model.B * solution.forces.front() + model.g - undisturbed(with, tick + 1).x0;
    if (deviation.cwiseAbs().maxCoeff() > kLost) deviation.setZero();
    problems.push_back(problem);
  }
  return problems;
}

double percentile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(fraction * static_cast<double>(values.size())))];
}

void measure(const Case& with, const std::vector<Problem>& problems, Settings settings) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> time_us(problems.size(), std::numeric_limits<double>::infinity());
  std::vector<int> iterations(problems.size(), 0);
  Solution solution({with.num_stages, 2});
  double worst_residual = 0.0;
  int failures = 0;
  for (int run = 0; run < kRuns; ++run) {
    auto engine = make_force_qp(settings, {with.num_stages, 2}, test::kWeight);
    for (std::size_t i = 0; i < problems.size(); ++i) {
      const Clock::time_point start = Clock::now();
      const QpStatus status = engine->solve(problems[i], solution);
      time_us[i] = std::min(time_us[i], std::chrono::duration<double, std::micro>(Clock::now() - start).count());
      iterations[i] = solution.iterations;
      failures += status != QpStatus::kSolved;
      worst_residual = std::max({worst_residual, solution.primal_residual, solution.dual_residual});
    }
  }
  std::vector<double> active_us;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    if (iterations[i] > 0) active_us.push_back(time_us[i]);
  }
  std::printf("%-12s N=%-3d %-9s %8.1f %8.1f   %5.1f%% %8.1f %8.1f  %4d  %8.1e %d\n", with.name, with.num_stages,
              settings.engine == QpEngine::kOsqpSparse ? "sparse" : "condensed", percentile(time_us, 0.5),
              percentile(time_us, 0.99),
              100.0 * static_cast<double>(active_us.size()) / static_cast<double>(time_us.size()),
              percentile(active_us, 0.5), percentile(active_us, 0.99),
              *std::max_element(iterations.begin(), iterations.end()), worst_residual, failures);
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  if (argc == 2 && std::string_view(argv[1]) == "--osqp-only") {
    settings.try_free_minimiser = false;
    settings.correct_active_set = false;
  } else if (argc > 1) {
    std::printf("usage: bench_force_qp [--osqp-only]   OSQP to its full tolerance, with nothing before or after it\n");
    return 2;
  }
  const Case cases[] = {
      {"stand", 1, false, 15.0, 0.6},      {"stand", 10, false, 15.0, 0.6}, {"stand", 20, false, 15.0, 0.6},
      {"walk", 20, true, 5.0, 0.55},       {"walk", 50, true, 5.0, 0.55},   {"stand mu 0.2", 10, false, 10.0, 0.2},
      {"walk mu 0.2", 20, true, 5.0, 0.2},
  };
  std::printf("%-12s %-5s %-9s %8s %8s   %6s %8s %8s  %4s  %8s %s\n", "", "", "engine", "median", "p99 us", "active",
              "median", "p99 us", "iter", "resid N", "failures");
  for (const Case& with : cases) {
    const std::vector<Problem> problems = record(with);
    for (const QpEngine which : {QpEngine::kOsqpCondensed, QpEngine::kOsqpSparse}) {
      settings.engine = which;
      measure(with, problems, settings);
    }
  }
}
