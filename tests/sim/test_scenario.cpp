#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <string>

#include "controller/config/strict_yaml.hpp"
#include "tests/sim/robots.hpp"

namespace stance::sim {
namespace {

std::string text_of(const std::string& scenario) {
  return config::read_text(config::share_directory() / "sim/scenarios/biped" / (scenario + ".yaml"));
}

/// The message of the error that `scenario` with `from` replaced by `to` makes; empty where it makes none.
std::string error_of(const std::string& from, const std::string& to, const std::string& scenario = "demo") {
  std::string text = text_of(scenario);
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  text.replace(at, from.size(), to);
  try {
    static_cast<void>(scenario_from_text(text, scenario + ".yaml", test::biped(), 1));
  } catch (const config::ConfigError& error) {
    return error.what();
  }
  return "";
}

bool names(const std::string& message, const std::string& key) {
  INFO(message);
  return message.find("demo.yaml") != std::string::npos && message.find(key) != std::string::npos;
}

}  // namespace

TEST_CASE("EveryScenarioOfTheBipedLoads") {
  for (const char* name : {"stand", "stand_noisy", "single_body", "stepping", "walk", "walk_noisy"}) {
    const Scenario scenario = load_scenario(test::biped(), name, 1);
    CHECK(scenario.duration == 20.0);
    CHECK(scenario.robot == "biped");
    CHECK(scenario.text.find("duration: 20.0") != std::string::npos);
  }
}

TEST_CASE("TheDemoPushesHalfANewtonSecondForwardThreeSidewaysAndAWalkerByEight") {
  const Scenario scenario = load_scenario(test::biped(), "demo", 1);
  REQUIRE(scenario.pushes.size() == 3);
  CHECK((scenario.pushes[0].force_W * scenario.pushes[0].duration - Vector3(0.5, 0.0, 0.0)).norm() < 1e-12);
  CHECK((scenario.pushes[1].force_W * scenario.pushes[1].duration - Vector3(0.0, 3.0, 0.0)).norm() < 1e-12);
  CHECK(std::abs(scenario.pushes[2].force_W.norm() * scenario.pushes[2].duration - 8.0) < 1e-12);
  CHECK(behaviour_name(scenario.commands.back()) == "stand");
  CHECK(scenario.command_delay_steps == 1);
  CHECK(scenario.sensors.delay_steps == 1);
  CHECK(scenario.sensors.contact_delay_steps == 5);
  CHECK(scenario.sensors.noise.joint_position_resolution == 5e-4);
  CHECK(load_scenario(test::biped(), "stand", 1).sensors.noise.gyro_white == 0.0);
  CHECK(load_scenario(test::biped(), "single_body", 1).plant == Plant::kSingleBody);
}

TEST_CASE("ScenarioErrorsNameTheKey") {
  CHECK(names(error_of("duration: 48.0", "durration: 48.0"), "duration is missing"));
  CHECK(names(error_of("friction: 0.7", "friction: 0.7\nfrictoin: 0.7"), "frictoin"));
  CHECK(names(error_of("friction: 0.7", "friction: -0.1"), "friction is -0.1"));
  CHECK(names(error_of("friction: 0.7", "friction: .nan"), "friction"));
  CHECK(names(error_of("plant: multibody", "plant: multybody"), "plant is 'multybody'"));
  CHECK(names(error_of("command_latency: 0.001", "command_latency: 0.0015"), "command_latency is 0.0015"));
  CHECK(names(error_of("command_latency: 0.001", "command_latency: 0.2"), "command_latency"));
  CHECK(names(error_of("trunk: 1.0", "trunk: 0.0"), "mass_factor.trunk"));
  CHECK(names(error_of("gyro_white: 0.003", "gyro_white: -1"), "sensors.noise.gyro_white"));
  CHECK(names(error_of("gyro_bias: 0.002", "gyro_bais: 0.002"), "sensors.noise.gyro_bias is missing"));
  CHECK(names(error_of("  contact_delay: 0.005", "  contact_delay: 0.0052"), "sensors.contact_delay"));
  CHECK(names(error_of("force_W: [5, 0, 0]", "force_W: [5, 0]"), "pushes[1].force_W"));
  CHECK(names(error_of("time: 8.0", "time: 18.0"), "pushes must stand in the order"));
  CHECK(names(error_of("duration: 0.1, force_W: [0", "duration: 0, force_W: [0"), "pushes[2].duration"));
  CHECK(names(error_of("behaviour: stand", "behaviour: stend"), "commands[1].behaviour is 'stend'"));
  CHECK(names(error_of("{time: 0.0, b", "{time: 0.005, b"), "commands[1].time"));
  CHECK(names(error_of("foot_clearance: -0.0003", "foot_clearance: -1"), "initial_state.foot_clearance"));
}

TEST_CASE("APushMayBeGivenByItsImpulseAndDirection") {
  std::string text = text_of("demo");
  const std::string force = "force_W: [5, 0, 0]";
  text.replace(text.find(force), force.size(), "impulse: 6.0, direction: 2.0943951023931953");
  const ScheduledPush push = scenario_from_text(text, "demo.yaml", test::biped(), 1).pushes.front();
  CHECK((push.force_W * push.duration - Vector3(-3.0, 3.0 * std::sqrt(3.0), 0.0)).norm() < 1e-12);

  CHECK(names(error_of(force, "impulse: 6.0"), "pushes[1].direction is missing"));
  CHECK(names(error_of(force, "direction: 1.0"), "pushes[1].force_W is missing: give it, or impulse and direction"));
  CHECK(names(error_of(force, force + ", impulse: 6.0, direction: 1.0"), "pushes[1].impulse stands beside force_W"));
  CHECK(names(error_of(force, force + ", direction: 1.0"), "pushes[1].direction is not a known key"));
  CHECK(names(error_of(force, "impulse: -6.0, direction: 1.0"), "pushes[1].impulse is -6"));
}

TEST_CASE("CommandsMayCease") {
  const std::string text = text_of("stand");
  const auto scenario =
      scenario_from_text(text + "  - {time: 5.0, behaviour: silent}\n", "stand.yaml", test::biped(), 1);
  REQUIRE(scenario.commands.size() == 2);
  CHECK_FALSE(scenario.commands[0].silent);
  CHECK(scenario.commands[1].silent);
  CHECK(scenario.commands[1].period == 500);
  CHECK(behaviour_name(scenario.commands[0]) == "stand");
  CHECK(behaviour_name(scenario.commands[1]) == "silent");
  CHECK(names(error_of("behaviour: stand", "behaviour: silent"), "commands[1].velocity is not a known key"));
}

TEST_CASE("TerrainIsFlatOrASlopeWithOrWithoutTiles") {
  const auto terrain = [](const std::string& value) {
    std::string text = text_of("demo");
    const std::string flat = "terrain: flat";
    text.replace(text.find(flat), flat.size(), "terrain: " + value);
    return scenario_from_text(text, "demo.yaml", test::biped(), 1).terrain;
  };
  CHECK(terrain("flat").is_flat());
  const TerrainModel slope = terrain("{slope: [0.17, -0.1], tiles: none}");
  CHECK(slope.slope == Eigen::Vector2d(0.17, -0.1));
  CHECK_FALSE(slope.has_tiles());
  const TerrainModel tiles = terrain("{slope: [0, 0], tiles: {size: 0.2, height: 0.03}}");
  CHECK(tiles.tile_size == 0.2);
  CHECK(tiles.tile_height == 0.03);
  CHECK_FALSE(tiles.is_flat());

  CHECK(names(error_of("terrain: flat", ""), "terrain is missing"));
  CHECK(names(error_of("terrain: flat", "terrain: hilly"), "terrain is 'hilly', but must be flat or a mapping"));
  CHECK(names(error_of("terrain: flat", "terrain: {slope: [0, 0]}"), "terrain.tiles is missing"));
  CHECK(names(error_of("terrain: flat", "terrain: {tiles: none}"), "terrain.slope is missing"));
  CHECK(names(error_of("terrain: flat", "terrain: {slope: [10, 0], tiles: none}"), "terrain.slope has 10 rad"));
  CHECK(names(error_of("terrain: flat", "terrain: {slope: [0, 0], tiles: {size: 0, height: 0.03}}"),
              "terrain.tiles.size is 0"));
  CHECK(names(error_of("terrain: flat", "terrain: {slope: [0, 0], tiles: {size: 0.2, heigth: 0.03}}"),
              "terrain.tiles.height is missing"));
}

TEST_CASE("NoiseIsNoneOrAMapping") {
  CHECK(error_of("noise: none", "noise: some", "stand") ==
        "stand.yaml: sensors.noise is 'some', but must be none or a mapping");
  CHECK(error_of("noise: none", "noise: [none]", "stand") ==
        "stand.yaml: sensors.noise must be a mapping of keys to values");
  CHECK(error_of("noise: none", "noise:", "stand") == "stand.yaml: sensors.noise is missing");
}

TEST_CASE("ASectionThatIsNoMappingIsRefusedByItsKey") {
  const std::string text = text_of("demo");
  const auto from = text.find("sensors:"), to = text.find("pushes:");
  REQUIRE(from < to);
  CHECK(error_of(text.substr(from, to - from), "sensors: 3\n") ==
        "demo.yaml: sensors must be a mapping of keys to values");
  CHECK(error_of(text.substr(from, to - from), "") == "demo.yaml: sensors is missing");
}

TEST_CASE("AnUnknownScenarioAndAnotherRobotsAreErrors") {
  CHECK_THROWS_AS(load_scenario(test::biped(), "no_such", 1), config::ConfigError);
  const auto file = config::share_directory() / "sim/scenarios/biped/demo.yaml";
  CHECK_NOTHROW(load_scenario(test::biped(), file.string(), 1));
  config::RobotDescription another = test::biped();
  another.name = "catcher";
  CHECK_THROWS_AS(load_scenario(another, file.string(), 1), config::ConfigError);
}

}  // namespace stance::sim
