#pragma once
// What happens in a run: sim/scenarios/<robot>/<name>.yaml, strict once its random values are drawn. Limits that a run
// is judged by are not here.
#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "controller/config/robot_description.hpp"
#include "controller/interface/signals.hpp"
#include "sim/ball.hpp"
#include "sim/camera.hpp"
#include "sim/random_values.hpp"
#include "sim/terrain.hpp"

namespace stance::sim {

enum class Plant { kMultibody, kSingleBody };

/// "multibody" or "single-body"; nothing for another word.
std::optional<Plant> plant_from_name(const std::string& name);

/// Errors of the sensors. White ones are standard deviations of each 1 kHz sample; biases and offsets have the given
/// size and a random sign on each axis or joint.
struct SensorNoise {
  double gyro_white = 0.0;                 ///< rad/s
  double gyro_bias = 0.0;                  ///< rad/s
  double gyro_bias_walk = 0.0;             ///< rad/s/sqrt(s)
  double accelerometer_white = 0.0;        ///< m/s^2
  double accelerometer_bias = 0.0;         ///< m/s^2
  double joint_position_resolution = 0.0;  ///< rad, 0 for none
  double joint_position_offset = 0.0;      ///< rad
  double joint_velocity_white = 0.0;       ///< rad/s
};

struct SensorModel {
  int delay_steps = 0;  ///< physics steps, of the IMU and the encoders alike
  double accelerometer_limit = std::numeric_limits<double>::infinity();  ///< m/s^2, saturation of each axis
  double contact_threshold = 0.0;                                        ///< N, normal force that closes a switch
  int contact_delay_steps = 0;                                           ///< physics steps
  SensorNoise noise;
};

/// Of a robot with feet, its nominal posture somewhere; of one without, its joints' positions.
struct InitialState {
  JointVector joint_position = JointVector::Zero();  ///< rad
  double foot_clearance = 0.0;                       ///< m, of the lowest foot over the ground; negative in contact
  Vector3 roll_pitch_yaw = Vector3::Zero();
  Vector3 velocity_W = Vector3::Zero();          ///< m/s, of the base
  Vector3 angular_velocity_W = Vector3::Zero();  ///< rad/s, of the base
};

struct ScheduledPush {
  double time = 0.0;                  ///< s
  double duration = 0.0;              ///< s
  Vector3 force_W = Vector3::Zero();  ///< N
  Vector3 point_B = Vector3::Zero();  ///< m, where it acts on the base
};

/// A ball that flies from `from_W` past `aim_W`.
struct ScheduledThrow {
  double time = 0.0;                 ///< s
  double flight_time = 0.0;          ///< s
  Vector3 from_W = Vector3::Zero();  ///< m
  Vector3 aim_W = Vector3::Zero();   ///< m, where it is after flight_time
};

struct ScheduledCommand {
  int period = 0;  ///< control period from whose start it is given, every kUserCommandPeriods
  Behaviour behaviour = Behaviour::kStand;
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  ///< m/s, in H
  double yaw_rate = 0.0;                               ///< rad/s
  double height_offset = 0.0;                          ///< m
  bool silent = false;                                 ///< nothing is sent from here on
};

/// As scenarios write it.
std::string_view behaviour_name(const ScheduledCommand& command);

struct Scenario {
  std::string text;               ///< the whole file, as draw_random_values leaves it
  std::vector<DrawnValue> drawn;  ///< its random values
  std::string robot;              ///< for which it is written
  Plant plant = Plant::kMultibody;
  double duration = 0.0;  ///< s
  double friction = 0.0;  ///< mu of the ground
  TerrainModel terrain;
  int command_delay_steps = 0;     ///< physics steps from a state to the effect of the command that answers it
  double trunk_mass_factor = 1.0;  ///< the plant's mass and inertia over the URDF's
  double limb_mass_factor = 1.0;   ///< the same of all that is not the base: legs, or an arm's links
  InitialState initial;
  SensorModel sensors;
  std::vector<ScheduledPush> pushes;       ///< in order of time
  std::vector<ScheduledCommand> commands;  ///< in order of time, at most one a period
  // Of a robot with a cup.
  BallModel ball;
  double ball_taken_after = 0.0;  ///< s, from a flight's end until the ball is taken away
  CameraModel camera;
  std::vector<ScheduledThrow> throws;  ///< in order of time, each after the ball before it is gone
};

inline constexpr int kUserCommandPeriods = 10;  ///< control periods between two user commands, as programs send them
inline constexpr int kMaxCommandDelaySteps = 50;
inline constexpr int kMaxSensorDelaySteps = 20;

/// A scenario of `robot`; `seed` draws the random values. What only robots with feet have is asked of them and refused
/// of others, and the other way round. Throws config::ConfigError naming `name`, the key, its value and what is
/// allowed.
Scenario scenario_from_text(const std::string& text, const std::string& name, const config::RobotDescription& robot,
                            std::uint64_t seed);

/// `scenario` is a name below sim/scenarios/<robot>/ of the share directory, or a path that ends in .yaml. Throws
/// likewise.
Scenario load_scenario(const config::RobotDescription& robot, const std::string& scenario, std::uint64_t seed);

}  // namespace stance::sim
