// The force QP's engines and their peers side by side, on the same ticks, one core: README, "The force QP".
//
// A tick's time is assembly, update and solve. Every sequence runs several times from a fresh engine and each tick
// counts with its fastest run, so that p99 is the algorithm's tail and not the machine's; the first tick, with the
// set-up, is left out. Runs of the engines take turns, so that all of them see the same machine.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>

#include "controller/force_qp/kkt.hpp"
#include "tests/bench/force_qp/engine.hpp"
#include "tests/bench/force_qp/reference.hpp"
#include "tests/bench/force_qp/sequence.hpp"

namespace {

using namespace stance;
using namespace stance::bench;
using force_qp::Sizes;
using force_qp::Solution;

constexpr double kActive = 1e-6;  // N, distance from a constraint that counts as active
constexpr double kTooSlow = 1.0;  // s a tick: an engine that takes longer leaves the case

struct Record {
  std::string engine, sequence;
  int num_stages = 0;
  double median_us = 0.0, p99_us = 0.0;
  double active_share = 0.0, active_median_us = 0.0;  ///< of the ticks where a constraint is active
  double max_force_error = 0.0;                       ///< N, in any stage, against the reference
  double max_violation = 0.0;                         ///< N
  int max_iterations = 0;
  int failures = 0;
};

double percentile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(fraction * static_cast<double>(values.size())))];
}

double violation(const Problem& problem, const std::vector<ForceVector>& forces) {
  double worst = 0.0;
  for (std::size_t k = 0; k < forces.size(); ++k) {
    for (int c = 0; c < problem.sizes.num_contacts; ++c) {
      const auto f = forces[k].segment<3>(3 * c);
      const auto bounds = static_cast<std::size_t>(c);
      worst = std::max({worst, std::abs(f.x()) - problem.friction * f.z(), std::abs(f.y()) - problem.friction * f.z(),
                        problem.stages[k].fz_min[bounds] - f.z(), f.z() - problem.stages[k].fz_max[bounds]});
    }
  }
  return worst;
}

struct Truth {
  std::vector<std::vector<ForceVector>> forces;  ///< empty where none could be certified
  std::vector<bool> active;
};

Truth truth_of(const Sequence& sequence, int num_stages) {
  const int contacts = sequence.ticks.front().sizes.num_contacts;
  Problem problem({num_stages, contacts});
  Solution guess(problem.sizes);
  force_qp::Settings settings;
  settings.engine = QpEngine::kStructured;
  auto engine = force_qp::make_force_qp(settings, problem.sizes, sequence.typical_force);
  Reference reference;
  Truth truth;
  int missing = 0;
  for (std::size_t tick = 0; tick < sequence.ticks.size(); ++tick) {
    sequence.cut(tick, num_stages, problem);
    [[maybe_unused]] const QpStatus status = engine->solve(problem, guess);
    truth.forces.push_back(reference.solve(problem, tick == 0 || !sequence.time_invariant, guess.forces));
    missing += truth.forces.back().empty();
    bool active = false;
    for (int k = 0; k < num_stages && !truth.forces.back().empty(); ++k) {
      active =
          active || force_qp::count_active(problem, k, truth.forces.back()[static_cast<std::size_t>(k)], kActive) > 0;
    }
    truth.active.push_back(active);
  }
  if (missing > 0)
    std::printf("%s N=%d: %d ticks without a certified reference\n", sequence.name.c_str(), num_stages, missing);
  return truth;
}

/// One engine on one sequence.
class Trial {
 public:
  Trial(const EngineKind& kind, const Sequence& sequence, int num_stages, const Truth& truth)
      : kind_(&kind), sequence_(&sequence), truth_(&truth), num_stages_(num_stages) {
    time_us_.assign(sequence.ticks.size(), std::numeric_limits<double>::infinity());
  }

  void run(bool judge) {
    if (gave_up_) return;
    using Clock = std::chrono::steady_clock;
    Problem problem({num_stages_, sequence_->ticks.front().sizes.num_contacts});
    sequence_->cut(0, num_stages_, problem);
    const auto engine = kind_->make(*sequence_, num_stages_);
    std::vector<ForceVector> forces(static_cast<std::size_t>(num_stages_),
                                    ForceVector::Zero(3 * problem.sizes.num_contacts));
    for (std::size_t tick = 0; tick < sequence_->ticks.size(); ++tick) {
      sequence_->cut(tick, num_stages_, problem);
      const Clock::time_point start = Clock::now();
      const bool solved = engine->solve(problem, tick == 0 || !sequence_->time_invariant);
      const double us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
      time_us_[tick] = std::min(time_us_[tick], us);
      if (us > kTooSlow * 1e6 && tick > 0) {
        gave_up_ = true;
        return;
      }
      if (!judge) continue;
      engine->forces(problem, forces);
      record_.failures += !solved;
      record_.max_iterations = std::max(record_.max_iterations, engine->iterations());
      record_.max_violation = std::max(record_.max_violation, violation(problem, forces));
      for (std::size_t k = 0; k < truth_->forces[tick].size(); ++k) {
        const double error = (forces[k] - truth_->forces[tick][k]).cwiseAbs().maxCoeff();
        record_.max_force_error = std::max(record_.max_force_error, std::isfinite(error) ? error : 1e9);
      }
    }
  }

  bool gave_up() const { return gave_up_; }

  Record record() const {
    Record r = record_;
    r.engine = kind_->name;
    r.sequence = sequence_->name;
    r.num_stages = num_stages_;
    std::vector<double> all(time_us_.begin() + 1, time_us_.end());
    std::vector<double> active;
    for (std::size_t i = 1; i < time_us_.size(); ++i) {
      if (truth_->active[i]) active.push_back(time_us_[i]);
    }
    r.median_us = percentile(all, 0.5);
    r.p99_us = percentile(all, 0.99);
    r.active_share = static_cast<double>(active.size()) / static_cast<double>(all.size());
    r.active_median_us = percentile(active, 0.5);
    return r;
  }

 private:
  const EngineKind* kind_;
  const Sequence* sequence_;
  const Truth* truth_;
  int num_stages_;
  std::vector<double> time_us_;
  Record record_;
  bool gave_up_ = false;
};

void write_json(const std::vector<Record>& records, const std::string& file) {
  std::ofstream out(file);
  out.precision(17);
  out << "[\n";
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Record& r = records[i];
    out << R"( {"engine": ")" << r.engine << R"(", "case": ")" << r.sequence << R"(", "N": )" << r.num_stages
        << R"(, "median_us": )" << r.median_us << R"(, "p99_us": )" << r.p99_us << R"(, "active_share": )"
        << r.active_share << R"(, "active_median_us": )" << r.active_median_us << R"(, "max_force_error_N": )"
        << r.max_force_error << R"(, "max_violation_N": )" << r.max_violation << R"(, "max_iterations": )"
        << r.max_iterations << R"(, "failures": )" << r.failures << "}" << (i + 1 < records.size() ? "," : "") << "\n";
  }
  out << "]\n";
  if (!out.flush()) throw std::runtime_error(file + ": cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Times, accuracy and failures of the force QP's engines and their peers, in us and N");
  std::vector<std::string> files, wanted, motions = {"stand", "walk"};
  std::vector<int> stages = {10, 20, 50};
  std::vector<unsigned> seeds = {1};
  Recipe recipe;
  int runs = 5;
  std::string json, save;
  app.add_option("--sequence", files, "Files of recorded ticks, in place of those that are made here")
      ->check(CLI::ExistingFile);
  app.add_option("--motion", motions, "Sequences to make")->check(CLI::IsMember({"stand", "walk", "four-feet"}));
  app.add_option("--seed", seeds, "Seeds of the sequences");
  app.add_option("--push", recipe.push, "Strength of the pushes; 1: up to 50 N for 60 ms")
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--friction", recipe.friction, "mu")->check(CLI::Range(0.01, 2.0));
  app.add_flag("--often", recipe.often, "Pushed every 0.5 s, not once in the middle");
  app.add_flag("--coupled", recipe.coupled, "With the coupling term and a dense terminal cost");
  app.add_option("--stages", stages, "Horizons N")->check(CLI::Range(1, 200));
  app.add_option("--engine", wanted, "Engines to measure; all without it");
  app.add_option("--runs", runs, "Runs of each sequence")->check(CLI::Range(1, 1000));
  app.add_option("--json", json, "Writes one record per engine, case and N");
  app.add_option("--save", save, "Writes the first sequence to this file and ends");
  CLI11_PARSE(app, argc, argv);

  try {
    std::vector<const EngineKind*> kinds;
    for (const EngineKind& kind : engine_kinds()) {
      if (wanted.empty() || std::find(wanted.begin(), wanted.end(), kind.name) != wanted.end()) kinds.push_back(&kind);
    }
    for (const std::string& name : wanted) {
      if (std::none_of(kinds.begin(), kinds.end(), [&](const EngineKind* kind) { return kind->name == name; })) {
        std::string known;
        for (const EngineKind& kind : engine_kinds()) known += " " + kind.name;
        throw std::runtime_error("--engine " + name + " is not built in; there are:" + known);
      }
    }
    const int longest = *std::max_element(stages.begin(), stages.end());
    std::vector<Sequence> sequences;
    for (const std::string& file : files) sequences.push_back(read_sequence(file));
    if (files.empty()) {
      for (const std::string& motion : motions) {
        for (const unsigned seed : seeds) {
          recipe.motion = motion == "stand" ? Motion::kStand : motion == "walk" ? Motion::kWalk : Motion::kFourFeet;
          recipe.seed = seed;
          sequences.push_back(record(recipe, longest));
          sequences.back().name += " " + std::to_string(seed);
        }
      }
    }
    if (!save.empty()) {
      write_sequence(sequences.front(), save);
      return 0;
    }
    for (const EngineKind* kind : kinds) std::printf("%-22s %s\n", kind->name.c_str(), kind->settings.c_str());
    std::printf("\n%-14s %-4s %-22s %9s %9s  %7s %9s  %9s %9s %5s %s\n", "", "N", "us:", "median", "p99", "active",
                "median", "error N", "outside N", "iter", "failures");
    std::vector<Record> records;
    for (const Sequence& sequence : sequences) {
      for (const int num_stages : stages) {
        if (num_stages > sequence.ticks.front().sizes.num_stages) continue;
        const Truth truth = truth_of(sequence, num_stages);
        std::vector<Trial> trials;
        for (const EngineKind* kind : kinds) trials.emplace_back(*kind, sequence, num_stages, truth);
        for (int run = 0; run < runs; ++run) {
          for (Trial& trial : trials) trial.run(run == 0);
        }
        for (const Trial& trial : trials) {
          const Record r = trial.record();
          if (trial.gave_up()) {
            std::printf("%-14s %-4d %-22s more than %.0f s a tick\n", r.sequence.c_str(), num_stages, r.engine.c_str(),
                        kTooSlow);
            continue;
          }
          std::printf("%-14s %-4d %-22s %9.2f %9.2f  %6.1f%% %9.2f  %9.1e %9.1e %5d %d\n", r.sequence.c_str(),
                      num_stages, r.engine.c_str(), r.median_us, r.p99_us, 100.0 * r.active_share, r.active_median_us,
                      r.max_force_error, r.max_violation, r.max_iterations, r.failures);
          std::fflush(stdout);
          records.push_back(r);
        }
      }
    }
    if (!json.empty()) write_json(records, json);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_force_qp: %s\n", error.what());
    return 2;
  }
  return 0;
}
