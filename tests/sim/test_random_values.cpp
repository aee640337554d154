#include <yaml-cpp/yaml.h>

#include <array>
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <set>
#include <string>

#include "controller/config/robot_description.hpp"
#include "sim/random.hpp"
#include "sim/random_values.hpp"
#include "sim/scenario.hpp"
#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

constexpr int kSeeds = 4000;

YAML::Node drawn(const std::string& text, std::uint64_t seed) {
  return YAML::Load(draw_random_values(text, "wild.yaml", seed).text);
}

double value_of(const std::string& text, std::uint64_t seed) { return drawn(text, seed)["v"].as<double>(); }

std::string error_of(const std::string& text) {
  try {
    static_cast<void>(draw_random_values(text, "wild.yaml", 1));
  } catch (const config::ConfigError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("KeyedNumbersAreSplitmix64s") {
  // The first three of the published generator from the state 0, which advances by its golden gamma.
  constexpr std::uint64_t gamma = 0x9e3779b97f4a7c15ULL;
  constexpr std::array<std::uint64_t, 3> published = {0xe220a8397b1dcdafULL, 0x6e789e6aa1b965f4ULL,
                                                      0x06c45d188009454fULL};
  for (std::size_t i = 0; i < published.size(); ++i) {
    CHECK(keyed_uniform(gamma * i) == static_cast<double>(published[i] >> 11) * 0x1p-53);
  }
}

TEST_CASE("UniformValuesFillTheirRangeEvenly") {
  std::array<int, 10> tenths{};
  for (int seed = 0; seed < kSeeds; ++seed) {
    const double value = value_of("v: {uniform: [-3, 2]}", static_cast<std::uint64_t>(seed));
    REQUIRE(value >= -3.0);
    REQUIRE(value <= 2.0);
    ++tenths[static_cast<std::size_t>(std::min(9.0, (value + 3.0) * 2.0))];
  }
  // Each is binomial: 400 with a standard deviation of 19.
  for (const int count : tenths) CHECK(std::abs(count - kSeeds / 10) < 5 * 19);
}

TEST_CASE("SteppedValuesStandOnTheirGridWithBothItsEnds") {
  std::array<int, 6> counts{};
  for (int seed = 0; seed < kSeeds; ++seed) {
    const double value = value_of("v: {uniform: [0.1, 0.6], step: 0.1}", static_cast<std::uint64_t>(seed));
    const double place = (value - 0.1) / 0.1;
    REQUIRE(std::abs(place - std::round(place)) < 1e-9);
    ++counts.at(static_cast<std::size_t>(std::lround(place)));
  }
  for (const int count : counts) CHECK(std::abs(count - kSeeds / 6) < 5 * 24);
}

TEST_CASE("ChoicesComeEquallyOftenAndMayBeListsMappingsAndRandomAgain") {
  const std::string text = "v: {choice: [stand, [1, {uniform: [2, 3]}], {a: {choice: [4, 5]}}]}";
  std::array<int, 3> counts{};
  std::set<std::string> inner;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const YAML::Node v = drawn(text, static_cast<std::uint64_t>(seed))["v"];
    if (v.IsScalar()) {
      ++counts[0];
      CHECK(v.Scalar() == "stand");
    } else if (v.IsSequence()) {
      ++counts[1];
      CHECK(v[0].as<int>() == 1);
      CHECK(v[1].as<double>() >= 2.0);
    } else {
      ++counts[2];
      inner.insert(v["a"].Scalar());
    }
  }
  for (const int count : counts) CHECK(std::abs(count - kSeeds / 3) < 5 * 30);
  CHECK(inner == std::set<std::string>{"4", "5"});
}

TEST_CASE("OneMoreRandomValueChangesNoOther") {
  const std::string before = "a: {uniform: [0, 1]}\nlist: [{b: {uniform: [0, 1]}}, {b: 7}]\n";
  const std::string after =
      "new: {choice: [1, 2]}\nlist: [{b: {uniform: [0, 1]}, c: {uniform: [0, 1]}}, {b: 7}]\n"
      "a: {uniform: [0, 1]}\n";
  for (const std::uint64_t seed : {1ULL, 2ULL, 1ULL << 63}) {
    const YAML::Node one = drawn(before, seed), other = drawn(after, seed);
    CHECK(one["a"].Scalar() == other["a"].Scalar());
    CHECK(one["list"][0]["b"].Scalar() == other["list"][0]["b"].Scalar());
    CHECK(other["list"][0]["b"].Scalar() != other["list"][0]["c"].Scalar());
    CHECK(one["a"].Scalar() != one["list"][0]["b"].Scalar());
    CHECK(one["list"][1]["b"].Scalar() == "7");
  }
}

TEST_CASE("TheSameSeedDrawsTheSameTextAndAnotherDoesNot") {
  const std::string text = "a: {uniform: [0, 1]}\nb: {choice: [x, y]}\n";
  CHECK(draw_random_values(text, "wild.yaml", 5).text == draw_random_values(text, "wild.yaml", 5).text);
  CHECK(draw_random_values(text, "wild.yaml", 5).text != draw_random_values(text, "wild.yaml", 6).text);
}

TEST_CASE("TheDrawnTextTellsWhatWasDrawnAndFromWhatAndIsDrawnToTheEnd") {
  const std::string text = "a: {uniform: [0, 1]}  # m\nb: [1, {choice: [x, [y]]}]\n";
  const DrawnText once = draw_random_values(text, "wild.yaml", 5);
  REQUIRE(once.values.size() == 2);
  CHECK(once.values[0].path == "a");
  CHECK(once.values[0].value == YAML::Load(once.text)["a"].Scalar());
  CHECK(once.values[1].path == "b[2]");
  const bool word = YAML::Load(once.text)["b"][1].IsScalar();
  CHECK(once.values[1].value == (word ? "x" : "choice[2]"));
  CHECK(once.text.find("# Drawn by the seed 5 from:\n# a: {uniform: [0, 1]}  # m\n# b: [1, {choice") !=
        std::string::npos);
  const DrawnText again = draw_random_values(once.text, "wild.yaml", 99);
  CHECK(again.text == once.text);
  CHECK(again.values.empty());
}

TEST_CASE("ADocumentWithoutRandomValuesStaysAsItIs") {
  const std::string text = "a:   1.50   # a comment\nb: [x]\n";
  CHECK(draw_random_values(text, "wild.yaml", 5).text == text);
}

TEST_CASE("ErrorsOfRandomValuesNameTheirPath") {
  CHECK(error_of("a: {uniform: 3}") == "wild.yaml: a.uniform must be a list of two numbers");
  CHECK(error_of("a: {uniform: [3]}") == "wild.yaml: a.uniform must be a list of two numbers");
  CHECK(error_of("a: {uniform: [3, 1]}") == "wild.yaml: a.uniform must have its lower end first");
  CHECK(error_of("a: {uniform: [1, x]}") == "wild.yaml: a.uniform has an entry that is not a finite number");
  CHECK(error_of("a: {uniform: [1, .inf]}") == "wild.yaml: a.uniform has an entry that is not a finite number");
  CHECK(error_of("a: [1, {b: {uniform: [1, 2], step: 0}}]") == "wild.yaml: a[2].b.step must be > 0");
  CHECK(error_of("a: {b: {choice: []}}") == "wild.yaml: a.b.choice must be a list of at least one value");
  CHECK(error_of("a: {choice: 3}") == "wild.yaml: a.choice must be a list of at least one value");
  CHECK(error_of("a: {choice: [{uniform: [2, 1]}]}") == "wild.yaml: a.choice[1].uniform must have its lower end first");
  for (const char* text :
       {"a: {uniform: [1, 2], steps: 1}", "a: {choice: [1, 2], step: 1}", "a: {choice: [1, 2], uniform: [1, 2]}"}) {
    CHECK(error_of(text).find("wild.yaml: a has '") == 0);
  }
  CHECK(error_of("a: {b: 1, b: 2}") == "wild.yaml: a.b stands twice");
  CHECK(error_of("a: {choice: [1]").find("wild.yaml: not YAML") == 0);
}

TEST_CASE("AScenarioIsStrictAboutWhatWasDrawn") {
  std::string text = config::read_text(config::share_directory() / "sim/scenarios/biped/stand.yaml");
  const auto replace = [&](const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    REQUIRE(at != std::string::npos);
    text.replace(at, from.size(), to);
  };
  replace("friction: 0.7", "friction: {uniform: [0.5, 0.8]}");
  replace("velocity: [0, 0]", "velocity: [{uniform: [-0.3, 0.5]}, 0]");
  replace("noise: none", "noise: {choice: [none]}");
  std::set<double> frictions;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Scenario scenario = scenario_from_text(text, "wild.yaml", test::biped(), seed);
    CHECK(scenario.friction >= 0.5);
    CHECK(scenario.friction <= 0.8);
    CHECK(std::abs(scenario.commands[0].velocity.x() - 0.1) <= 0.4);
    CHECK(scenario.sensors.noise.gyro_white == 0.0);
    REQUIRE(scenario.drawn.size() == 3);
    CHECK(scenario.drawn[2].path == "commands[1].velocity[1]");
    frictions.insert(scenario.friction);
    // What a log keeps is the same scenario.
    const Scenario again = scenario_from_text(scenario.text, "wild.yaml", test::biped(), 77);
    CHECK(again.friction == scenario.friction);
    CHECK(again.commands[0].velocity == scenario.commands[0].velocity);
  }
  CHECK(frictions.size() == 3);
  replace("friction: {uniform: [0.5, 0.8]}", "friction: {uniform: [-2, -1]}");
  CHECK_THROWS_AS(scenario_from_text(text, "wild.yaml", test::biped(), 1), config::ConfigError);
}

}  // namespace stance::sim
