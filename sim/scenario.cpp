#include "sim/scenario.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <string_view>

#include "controller/platform/text.hpp"
#include "sim/world.hpp"

namespace stance::sim {
namespace {

using config::StrictYaml;
using platform::to_text;

constexpr std::array<std::string_view, 6> kBehaviourNames = {"stand", "walk",  "lie-down",
                                                             "track", "catch", "track-smooth"};
constexpr std::string_view kSilent = "silent";  // of who commands, not of the robot
static_assert(static_cast<int>(Behaviour::kTrackSmooth) + 1 == kBehaviourNames.size());

double number_in(StrictYaml& yaml, const std::string& key, double lowest, double highest) {
  const double value = yaml.number(key);
  if (value < lowest || value > highest) {
    yaml.fail(key, "is " + to_text(value) + ", but must be in [" + to_text(lowest) + ", " + to_text(highest) + "]");
  }
  return value;
}

Vector3 vector(StrictYaml& yaml, const std::string& key) {
  const std::vector<double> v = yaml.numbers(key, 3);
  return {v[0], v[1], v[2]};
}

/// A time [s] as a whole number of `step` [s].
int whole_steps(StrictYaml& yaml, const std::string& key, double step, int most) {
  const double value = number_in(yaml, key, 0.0, most * step);
  const double steps = std::round(value / step);
  if (std::abs(value - steps * step) > 1e-9) {
    yaml.fail(key, "is " + to_text(value) + " s, but must be a multiple of " + to_text(step) + " s");
  }
  return static_cast<int>(steps);
}

/// Does `word` stand there in place of a mapping? No other word may.
bool is_word(StrictYaml& yaml, const std::string& key, const std::string& word) {
  if (!yaml.is_scalar(key)) return false;
  const std::string text = yaml.text(key);
  if (text != word) yaml.fail(key, "is '" + text + "', but must be " + word + " or a mapping");
  return true;
}

/// Tells the keys of robots with feet from those of robots on a fixed base: what a robot's kind has not is refused by
/// name, so that nothing in a scenario goes unheard.
class Kind {
 public:
  explicit Kind(const config::RobotDescription& robot)
      : has_feet_(robot.has_feet()), has_cup_(robot.cup.has_value()), robot_(robot.name) {}

  /// Are `keys`, which only robots with feet have, to be read?
  bool with_feet(const StrictYaml& yaml, std::initializer_list<const char*> keys) const {
    return ask(yaml, keys, has_feet_, "is of robots with feet, and " + robot_ + " has none: remove it");
  }
  /// The same of keys which only robots without feet have.
  bool without_feet(const StrictYaml& yaml, std::initializer_list<const char*> keys) const {
    return ask(yaml, keys, !has_feet_, "is of robots without feet, and " + robot_ + " has some: remove it");
  }
  /// The same of keys which only robots with a cup have.
  bool with_cup(const StrictYaml& yaml, std::initializer_list<const char*> keys) const {
    return ask(yaml, keys, has_cup_, "is of robots with a cup, and " + robot_ + " has none: remove it");
  }

 private:
  static bool ask(const StrictYaml& yaml, std::initializer_list<const char*> keys, bool ours,
                  const std::string& refusal) {
    for (const char* key : keys) {
      if (!ours && yaml.has(key)) yaml.fail(key, refusal);
    }
    return ours;
  }

  bool has_feet_, has_cup_;
  std::string robot_;
};

SensorNoise noise_from(StrictYaml yaml, const Kind& kind) {
  constexpr double most = 10.0;  // of any of them: a bound that only an error of units passes
  SensorNoise noise;
  if (kind.with_feet(yaml,
                     {"gyro_white", "gyro_bias", "gyro_bias_walk", "accelerometer_white", "accelerometer_bias"})) {
    noise.gyro_white = number_in(yaml, "gyro_white", 0.0, most);
    noise.gyro_bias = number_in(yaml, "gyro_bias", 0.0, most);
    noise.gyro_bias_walk = number_in(yaml, "gyro_bias_walk", 0.0, most);
    noise.accelerometer_white = number_in(yaml, "accelerometer_white", 0.0, most);
    noise.accelerometer_bias = number_in(yaml, "accelerometer_bias", 0.0, most);
  }
  noise.joint_position_resolution = number_in(yaml, "joint_position_resolution", 0.0, most);
  noise.joint_position_offset = number_in(yaml, "joint_position_offset", 0.0, most);
  noise.joint_velocity_white = number_in(yaml, "joint_velocity_white", 0.0, most);
  yaml.finish();
  return noise;
}

SensorModel sensors_from(StrictYaml yaml, const Kind& kind) {
  SensorModel sensors;
  sensors.delay_steps = whole_steps(yaml, "delay", kPhysicsStep, kMaxSensorDelaySteps);
  if (kind.with_feet(yaml, {"accelerometer_limit", "contact_threshold", "contact_delay"})) {
    sensors.accelerometer_limit = number_in(yaml, "accelerometer_limit", kGravity, 1e6);
    sensors.contact_threshold = number_in(yaml, "contact_threshold", 0.0, 1e6);
    sensors.contact_delay_steps = whole_steps(yaml, "contact_delay", kPhysicsStep, kMaxSensorDelaySteps);
  }
  if (!is_word(yaml, "noise", "none")) sensors.noise = noise_from(yaml.mapping("noise"), kind);
  yaml.finish();
  return sensors;
}

InitialState initial_from(StrictYaml yaml, const Kind& kind, const rigid_body::Model& model) {
  InitialState initial;
  if (kind.with_feet(yaml, {"foot_clearance", "roll_pitch_yaw", "velocity_W", "angular_velocity_W"})) {
    initial.foot_clearance = number_in(yaml, "foot_clearance", -0.005, 10.0);
    initial.roll_pitch_yaw = vector(yaml, "roll_pitch_yaw");
    initial.velocity_W = vector(yaml, "velocity_W");
    initial.angular_velocity_W = vector(yaml, "angular_velocity_W");
  }
  if (kind.without_feet(yaml, {"joint_position"})) {
    const std::vector<double> position = yaml.numbers("joint_position", model.num_joints);
    for (std::size_t i = 0; i < position.size(); ++i) {
      const auto& joint = model.joints[i];
      if (position[i] < joint.lower || position[i] > joint.upper) {
        yaml.fail("joint_position", "puts joint " + joint.name + " at " + to_text(position[i]) +
                                        " rad, but must be in [" + to_text(joint.lower) + ", " + to_text(joint.upper) +
                                        "]");
      }
      initial.joint_position[static_cast<Eigen::Index>(i)] = position[i];
    }
  }
  yaml.finish();
  return initial;
}

TerrainModel terrain_from(StrictYaml yaml) {
  constexpr double steepest = 0.5;  // rad
  TerrainModel terrain;
  const std::vector<double> slope = yaml.numbers("slope", 2);
  for (const double angle : slope) {
    if (std::abs(angle) > steepest) yaml.fail("slope", "has " + to_text(angle) + " rad, but must be within +-0.5 rad");
  }
  terrain.slope = {slope[0], slope[1]};
  if (!is_word(yaml, "tiles", "none")) {
    StrictYaml tiles = yaml.mapping("tiles");
    terrain.tile_size = number_in(tiles, "size", 0.05, 10.0);
    terrain.tile_height = number_in(tiles, "height", 0.0, 1.0);
    tiles.finish();
  }
  yaml.finish();
  return terrain;
}

ScheduledPush push_from(StrictYaml yaml) {
  ScheduledPush push;
  push.time = number_in(yaml, "time", 0.0, 1e6);
  push.duration = number_in(yaml, "duration", 1e-6, 1e6);
  if (yaml.has("impulse")) {
    if (yaml.has("force_W")) yaml.fail("impulse", "stands beside force_W: keep one of the two");
    const double force = number_in(yaml, "impulse", 0.0, 1e6) / push.duration;
    const double direction = yaml.number("direction");
    push.force_W = {force * std::cos(direction), force * std::sin(direction), 0.0};
  } else if (yaml.has("force_W")) {
    push.force_W = vector(yaml, "force_W");
  } else {
    yaml.fail("force_W", "is missing: give it, or impulse and direction");
  }
  push.point_B = vector(yaml, "point_B");
  yaml.finish();
  return push;
}

BallModel ball_from(StrictYaml yaml, double& taken_after) {
  BallModel ball;
  ball.radius = number_in(yaml, "radius", 0.005, 0.1);
  ball.mass = number_in(yaml, "mass", 1e-4, 10.0);
  ball.drag = number_in(yaml, "drag", 0.0, 1.0);
  ball.restitution = number_in(yaml, "restitution", 0.0, 1.0);
  ball.friction = number_in(yaml, "friction", 0.0, 10.0);
  taken_after = number_in(yaml, "taken_after", kControlPeriod, 1e6);
  yaml.finish();
  return ball;
}

ScheduledThrow throw_from(StrictYaml yaml) {
  ScheduledThrow thrown;
  thrown.time = number_in(yaml, "time", 0.0, 1e6);
  thrown.flight_time = number_in(yaml, "flight_time", 0.05, 10.0);
  thrown.aim_W = vector(yaml, "aim_W");
  const double distance = number_in(yaml, "distance", 0.0, 100.0), azimuth = yaml.number("azimuth");
  thrown.from_W = {distance * std::cos(azimuth), distance * std::sin(azimuth), number_in(yaml, "height", 0.0, 100.0)};
  yaml.finish();
  return thrown;
}

CameraModel camera_from(StrictYaml yaml) {
  constexpr int longest = 100;  // control periods
  CameraModel camera;
  camera.period = whole_steps(yaml, "period", kControlPeriod, longest);
  if (camera.period == 0) yaml.fail("period", "must be > 0 s");
  camera.latency = whole_steps(yaml, "latency", kControlPeriod, kMaxCameraLatency);
  camera.sigma = number_in(yaml, "sigma", 0.0, 10.0);
  camera.dropout = number_in(yaml, "dropout", 0.0, 1.0);
  camera.outlier_share = number_in(yaml, "outlier_share", 0.0, 1.0);
  camera.outlier_size = number_in(yaml, "outlier_size", 0.0, 100.0);
  camera.T_WK.p = vector(yaml, "position_W");
  camera.T_WK.R = math::rotation_from_rpy(vector(yaml, "roll_pitch_yaw"));
  StrictYaml points = yaml.mapping("calibration");
  camera.points = points.integer("points");
  if (camera.points < 0 || camera.points > kMaxCalibrationPoints) {
    points.fail("points",
                "is " + std::to_string(camera.points) + ", but must be in 0.." + std::to_string(kMaxCalibrationPoints));
  }
  camera.point_sigma = number_in(points, "sigma", 0.0, 10.0);
  camera.points_from_K = vector(points, "from_K");
  camera.points_to_K = vector(points, "to_K");
  points.finish();
  yaml.finish();
  return camera;
}

ScheduledCommand command_from(StrictYaml yaml, const Kind& kind) {
  ScheduledCommand command;
  command.period = whole_steps(yaml, "time", kControlPeriod, 100'000'000);
  const std::string name = yaml.text("behaviour");
  if (name == kSilent) {
    command.silent = true;
    yaml.finish();
    return command;
  }
  const auto* known = std::find(kBehaviourNames.begin(), kBehaviourNames.end(), name);
  if (known == kBehaviourNames.end()) {
    yaml.fail("behaviour",
              "is '" + name + "', but must be stand, walk, lie-down, track, catch, track-smooth or silent");
  }
  command.behaviour = static_cast<Behaviour>(known - kBehaviourNames.begin());
  if (kind.with_feet(yaml, {"velocity", "yaw_rate", "height_offset"})) {
    const std::vector<double> velocity = yaml.numbers("velocity", 2);
    command.velocity = {velocity[0], velocity[1]};
    command.yaw_rate = yaml.number("yaw_rate");
    command.height_offset = yaml.number("height_offset");
  }
  yaml.finish();
  return command;
}

}  // namespace

std::string_view behaviour_name(const ScheduledCommand& command) {
  return command.silent ? kSilent : kBehaviourNames[static_cast<std::size_t>(command.behaviour)];
}

std::optional<Plant> plant_from_name(const std::string& name) {
  if (name == "multibody") return Plant::kMultibody;
  if (name == "single-body") return Plant::kSingleBody;
  return std::nullopt;
}

Scenario scenario_from_text(const std::string& text, const std::string& name, const config::RobotDescription& robot,
                            std::uint64_t seed) {
  const Kind kind(robot);
  const DrawnText drawn = draw_random_values(text, name, seed);
  StrictYaml yaml = StrictYaml::parse(drawn.text, name);
  Scenario scenario;
  scenario.text = drawn.text;
  scenario.drawn = drawn.values;
  scenario.robot = yaml.text("robot");
  if (scenario.robot != robot.name) {
    throw config::ConfigError(name + ": robot is '" + scenario.robot + "', but the run is of '" + robot.name + "'");
  }
  scenario.duration = number_in(yaml, "duration", kControlPeriod, 1e6);
  scenario.command_delay_steps = whole_steps(yaml, "command_latency", kPhysicsStep, kMaxCommandDelaySteps);
  StrictYaml factors = yaml.mapping("mass_factor");
  if (kind.with_feet(yaml, {"plant", "friction", "terrain", "pushes"})) {
    const std::string plant = yaml.text("plant");
    if (!plant_from_name(plant)) yaml.fail("plant", "is '" + plant + "', but must be multibody or single-body");
    scenario.plant = *plant_from_name(plant);
    scenario.friction = number_in(yaml, "friction", 0.0, 10.0);
    if (!is_word(yaml, "terrain", "flat")) scenario.terrain = terrain_from(yaml.mapping("terrain"));
    for (StrictYaml& push : yaml.mappings("pushes")) scenario.pushes.push_back(push_from(push));
  }
  if (kind.with_feet(factors, {"trunk", "legs"})) {
    scenario.trunk_mass_factor = number_in(factors, "trunk", 0.1, 10.0);
    scenario.limb_mass_factor = number_in(factors, "legs", 0.1, 10.0);
  }
  if (kind.without_feet(factors, {"links"})) scenario.limb_mass_factor = number_in(factors, "links", 0.1, 10.0);
  factors.finish();
  scenario.initial = initial_from(yaml.mapping("initial_state"), kind, robot.model);
  scenario.sensors = sensors_from(yaml.mapping("sensors"), kind);
  for (StrictYaml& command : yaml.mappings("commands")) scenario.commands.push_back(command_from(command, kind));
  if (kind.with_cup(yaml, {"ball", "camera", "throws"})) {
    scenario.ball = ball_from(yaml.mapping("ball"), scenario.ball_taken_after);
    scenario.camera = camera_from(yaml.mapping("camera"));
    for (StrictYaml& thrown : yaml.mappings("throws")) scenario.throws.push_back(throw_from(thrown));
  }
  yaml.finish();

  const auto early = [&](const ScheduledThrow& a, const ScheduledThrow& b) {
    return b.time < a.time + a.flight_time + scenario.ball_taken_after;
  };
  if (std::adjacent_find(scenario.throws.begin(), scenario.throws.end(), early) != scenario.throws.end()) {
    yaml.fail("throws", "must stand in the order of their times, each after the ball before it is taken away");
  }
  const auto earlier = [](const auto& a, const auto& b) { return a.time < b.time; };
  if (!std::is_sorted(scenario.pushes.begin(), scenario.pushes.end(), earlier)) {
    yaml.fail("pushes", "must stand in the order of their times");
  }
  const auto not_before = [](const auto& a, const auto& b) { return a.period >= b.period; };
  if (std::adjacent_find(scenario.commands.begin(), scenario.commands.end(), not_before) != scenario.commands.end()) {
    yaml.fail("commands", "must stand in the order of their times, one at a time");
  }
  return scenario;
}

Scenario load_scenario(const config::RobotDescription& robot, const std::string& scenario, std::uint64_t seed) {
  std::filesystem::path file = scenario;
  if (file.extension() != ".yaml") {
    file = config::share_directory() / "sim" / "scenarios" / robot.name / (scenario + ".yaml");
    if (!std::filesystem::exists(file)) {
      throw config::ConfigError("no scenario '" + scenario + "' of robot " + robot.name + ": " + file.string() +
                                " does not exist");
    }
  }
  return scenario_from_text(config::read_text(file), file.filename().string(), robot, seed);
}

}  // namespace stance::sim
