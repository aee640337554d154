// `make fuzz`: many random force QPs and random bytes through the structured engine. What it calls solved must be so by
// a check of the fuzzer's own and by DAQP, or, where DAQP differs, by a solution certified in extended precision.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <tuple>

#include "tests/bench/force_qp/peers.hpp"
#include "tests/bench/force_qp/reference.hpp"
#include "tests/fuzz/cases.hpp"

namespace {

using namespace stance;
using namespace stance::force_qp;

constexpr double kAgreed = 1e-5;  // N, in any force
constexpr int kFallbackIterations = 50;

double largest_difference(const std::vector<ForceVector>& a, const std::vector<ForceVector>& b) {
  double worst = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double difference = (a[k] - b[k]).cwiseAbs().maxCoeff();
    worst = std::isfinite(difference) ? std::max(worst, difference) : std::numeric_limits<double>::infinity();
  }
  return worst;
}

Solution solve(test::Engines& engines, const Problem& problem) {
  Solution solution(problem.sizes);
  static_cast<void>(engines.of(problem.sizes).solve(problem, solution));
  return solution;
}

struct Count {
  std::map<QpStatus, int> status;
  int active = 0, agreed = 0, peer_wrong = 0, undecided = 0, faults = 0;
};

void say(const char* what, std::uint64_t number, const std::string& fault, Count& count) {
  ++count.faults;
  std::printf("%s %llu: %s\n", what, static_cast<unsigned long long>(number), fault.c_str());
}

/// Whether DAQP, or who decides where it differs, finds the same forces.
void compare(std::uint64_t number, const Problem& problem, const Solution& solution, Count& count) {
  bench::Sequence sequence;
  sequence.typical_force = test::kTypicalForce;
  sequence.ticks.push_back(problem);
  const auto peer = bench::daqp().make(sequence, problem.sizes.num_stages);
  std::vector<ForceVector> forces = solution.forces;
  if (peer->solve(problem, true)) {
    peer->forces(problem, forces);
    if (largest_difference(forces, solution.forces) <= kAgreed) {
      ++count.agreed;
      return;
    }
  }
  const std::vector<ForceVector> certified = bench::Reference().solve(problem, true, solution.forces);
  if (certified.empty()) {
    ++count.undecided;
  } else if (largest_difference(certified, solution.forces) <= kAgreed) {
    ++count.peer_wrong;
  } else {
    say("problem", number, "forces are off by " + std::to_string(largest_difference(certified, solution.forces)) + " N",
        count);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Random force QPs and random bytes: solved exactly or refused with a status that is true");
  std::uint64_t problems = 100000, bytes = 100000, first = 0;
  app.add_option("--problems", problems, "Random problems")->capture_default_str();
  app.add_option("--bytes", bytes, "Random byte strings, each a problem edited by it")->capture_default_str();
  app.add_option("--first", first, "Number of the first of each")->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  test::Engines alone(0);
  test::Engines with_osqp(kFallbackIterations);
  const auto report = [](const char* what, std::uint64_t total, const Count& count) {
    const auto of = [&](QpStatus status) { return count.status.contains(status) ? count.status.at(status) : 0; };
    std::printf(
        "%llu %s: %d solved, %d with steps; refused: %d invalid, %d infeasible, %d out of iterations, %d inaccurate; "
        "%d faults\n",
        static_cast<unsigned long long>(total), what, of(QpStatus::kSolved), count.active,
        of(QpStatus::kInvalidProblem), of(QpStatus::kInfeasible), of(QpStatus::kMaxIterations),
        of(QpStatus::kInaccurate), count.faults);
  };

  Count random;
  for (std::uint64_t number = first; number < first + problems; ++number) {
    const Problem problem = test::random_problem(number);
    const Solution solution = solve(alone, problem);
    ++random.status[solution.status];
    random.active += solution.iterations > 0;
    const std::string fault = test::fault_of(problem, solution, alone.max_iterations());
    if (!fault.empty()) say("problem", number, fault, random);
    if (solution.status == QpStatus::kSolved) compare(number, problem, solution, random);
  }
  report("random problems", problems, random);
  std::printf(
      "  of those solved: %d as by DAQP, %d where DAQP fails or is off as certified in extended precision, %d that "
      "neither decides\n",
      random.agreed, random.peer_wrong, random.undecided);

  Count edited;
  for (std::uint64_t number = first; number < first + bytes; ++number) {
    const Problem problem = test::problem_from_bytes(test::random_bytes(number));
    for (test::Engines* engines : {&alone, &with_osqp}) {
      const Solution solution = solve(*engines, problem);
      // What OSQP answers is within the settings' residuals, not exact.
      if (solution.engine != QpEngine::kStructured) continue;
      if (engines == &alone) {
        ++edited.status[solution.status];
        edited.active += solution.iterations > 0;
      }
      const std::string fault = test::fault_of(problem, solution, engines->max_iterations());
      if (!fault.empty()) say("bytes", number, fault, edited);
    }
  }
  report("byte strings", bytes, edited);
  return random.faults + edited.faults == 0 ? 0 : 1;
}
