#pragma once
// What a rollout tells of itself, in numbers, as JSON and as text.
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "controller/loop/ticker.hpp"
#include "controller/platform/hash.hpp"
#include "sim/scenario.hpp"
#include "sim/simulator.hpp"

namespace stance::rollout {

/// Where the robot is at an instant, by the truth.
struct Place {
  Eigen::Vector2d p_WC = Eigen::Vector2d::Zero();  ///< m
  double yaw = 0.0;                                ///< rad, of the trunk, unwrapped
};

/// A stretch between two user commands that want different things.
struct Segment {
  double start = 0.0;  ///< s
  double end = 0.0;    ///< s
  sim::ScheduledCommand wanted;
  double measured_from = 0.0;                               ///< s: the means are from here to the end
  Eigen::Vector2d mean_velocity = Eigen::Vector2d::Zero();  ///< m/s, of C, in the trunk's heading frame
  double mean_yaw_rate = 0.0;                               ///< rad/s
  double distance = 0.0;  ///< m, horizontal, between where C was at the start and at the end
};

/// Of the commands, in order of their periods, along `path`: a place for each instant. The means leave out a segment's
/// first 3 s, or its first half where that is shorter.
std::vector<Segment> segments(const std::vector<sim::ScheduledCommand>& commands, std::span<const Place> path);

/// Times of the ticks on the CPU, counted on a logarithmic grid that is the same for every rollout, so that counts add
/// up.
struct TickCpu {
  static constexpr int kBinsPerDecade = 20;
  static constexpr int kBins = 5 * kBinsPerDecade + 1;
  /// Bin i is from 10^(i / kBinsPerDecade) us to the next one's; the first and the last take what lies beyond.
  std::array<std::int64_t, kBins> counts{};
  double p50 = 0.0, p99 = 0.0, p99_9 = 0.0, max = 0.0;  ///< us
};
/// Of `times` [us]; all zero where there is none.
TickCpu tick_cpu(std::vector<double> times);

/// What became of a ball thrown at a robot with a cup.
struct ThrowOutcome {
  double time = 0.0;  ///< s, of the throw
  sim::Verdict verdict = sim::Verdict::kOpen;
  bool crossed = false;          ///< the cup's plane, as asked
  bool retained = false;         ///< in the cup
  double crossing_offset = 0.0;  ///< m, infinity where it did not come by
  double crossing_angle = 0.0;   ///< rad
  double nearest = 0.0;          ///< m
  double plan_ball_error = 0.0;  ///< m, NaN without a plan
  double plan_cup_error = 0.0;   ///< m, the same
};

struct Summary {
  std::uint64_t seed = 0;
  std::vector<sim::DrawnValue> drawn;
  double duration = 0.0;  ///< s, simulated
  double wall = 0.0;      ///< s
  bool has_feet = true;   ///< without: nothing falls, tilts, steps or goes anywhere
  kinematics::Fall fall = kinematics::Fall::kNone;
  std::string fallen_on;               ///< the link, where a body is on the ground
  bool lying = false;                  ///< since it was told to lie down
  double max_tilt = 0.0;               ///< rad, of the trunk
  double max_torque_share = 0.0;       ///< of a joint's limit, mean over a control period
  double drives_damped = 0.0;          ///< s, without a valid command
  std::int64_t torques_saturated = 0;  ///< ticks that clipped one
  bool has_cup = false;
  std::vector<ThrowOutcome> throws;  ///< that are over
  std::int64_t qp_failures = 0;
  int qp_iterations_max = 0;
  std::int64_t steps = 0;  ///< swings that ended in stance
  Vector3 p_WB = Vector3::Zero();
  std::uint64_t command_hash = platform::kHashSeed;  ///< of every JOINT_COMMAND
  std::vector<Segment> segments;
  TickCpu tick_cpu;

  bool fallen() const { return fall != kinematics::Fall::kNone; }
};

std::string as_json(const Summary& summary);
/// For people: a line, and one more for each stretch of walking.
std::string as_text(const Summary& summary);

/// Looks on at a rollout.
class Observer {
 public:
  /// All outlive the observer.
  Observer(const rigid_body::Model& model, const sim::Scenario& scenario, const sim::Simulator& simulator);

  /// After each control period: what was ticked in it, in `cpu_us` of the CPU.
  void period(const loop::Ticker& ticker, double cpu_us);

  /// `seed` and `wall` [s] of the rollout.
  Summary summary(std::uint64_t seed, double wall) const;

 private:
  void look();

  const rigid_body::Model& model_;
  const sim::Scenario& scenario_;
  const sim::Simulator& simulator_;
  Summary so_far_;
  std::vector<Place> path_;
  std::vector<double> cpu_us_;
  std::array<bool, kMaxContacts> was_swinging_{};
};

}  // namespace stance::rollout
