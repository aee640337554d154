#pragma once
// Force QPs for the fuzzer: from a number, of the structure and feasible; from bytes, whatever they say.
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp::test {

constexpr double kTypicalForce = 129.0;  // N

/// The structured engine, one for each size, as it comes: with the history of the problems before.
class Engines {
 public:
  explicit Engines(int fallback_iterations);
  ForceQp& of(const Sizes& sizes);
  int max_iterations() const { return settings_.max_iterations; }

 private:
  Settings settings_;
  std::map<std::pair<int, int>, std::unique_ptr<ForceQp>> engines_;
};

/// Problem `number`, the same on every machine: 1 to 4 contacts over 1 to 12 stages, standing or of any model, well and
/// ill scaled (R over five, Q over four decades), feet with no arm about the centre of mass or two on one spot, mu 0.05
/// to 1.5, from calm to far beyond what the feet can do.
Problem random_problem(std::uint64_t number);

/// A standing or random problem by the first bytes, then edits by the others: three bytes choose a number of the
/// problem and what becomes of it (0, -1, NaN, infinity, the smallest and the largest, ten times, its negative, the
/// next eight bytes, ...), until they end.
Problem problem_from_bytes(std::span<const std::uint8_t> bytes);

/// Bytes `number`, up to 24.
std::vector<std::uint8_t> random_bytes(std::uint64_t number);

/// What is wrong with an engine's answer, empty where nothing is: a status that is not true of the problem, more
/// iterations than it may take, or forces called solved that are not by a check of its own, dense, in extended
/// precision: outside their bounds or short of stationary by more than 1e-6 N and what rounding the terms costs.
std::string fault_of(const Problem& problem, const Solution& solution, int max_iterations);

}  // namespace stance::force_qp::test
