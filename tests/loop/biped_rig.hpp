#pragma once
// The biped's simulator and controller in one process, one control period at a time, with hands on what the controller
// is told.
#include <cstdint>
#include <optional>
#include <stance_msgs/joint_command_t.hpp>
#include <stance_msgs/robot_state_t.hpp>
#include <stance_msgs/user_command_t.hpp>
#include <string>
#include <vector>

#include "controller/compose.hpp"
#include "controller/io/lcm_bytes.hpp"
#include "controller/loop/wall_clock.hpp"
#include "sim/simulator.hpp"

namespace stance::test {

using ByteVector = std::vector<std::uint8_t>;

using io::bytes_of;
using io::decoded;
inline ByteVector bytes_of(const io::Message& message) { return {message.bytes().begin(), message.bytes().end()}; }

config::RobotDescription biped();
/// The biped's YAML with another value (as YAML text) at a path as in "controller.safety.hold_time".
std::string biped_yaml_with(const std::string& path, const std::string& value);
/// The biped with that YAML.
config::RobotDescription biped_with(const std::string& path, const std::string& value);
/// Standing on perfect sensors, left alone.
sim::Scenario quiet_stand();
/// From `time` [s] on, for 0.1 s, at B's origin.
sim::ScheduledPush push(double time, double x, double y, double z);

/// What one tick published.
struct Answer {
  ByteVector plan, command, trace;
  friend bool operator==(const Answer&, const Answer&) = default;
};
Answer answer_of(const loop::Ticker& ticker);

/// What is of no robot in particular serves every one of them.
class BipedRig {
 public:
  explicit BipedRig(const sim::Scenario& scenario = quiet_stand(), const config::RobotDescription& robot = biped(),
                    std::int64_t run_id = 7);

  /// Of this instant, as the simulator says it.
  const stance_msgs::robot_state_t& state() const { return simulator.state(); }
  double tilt() const;  ///< rad, of the trunk, true

  // A period: the controller is told what the name says, the simulator gets the answer and goes on.
  void tick() { tick_with(state()); }
  void tick_with(const stance_msgs::robot_state_t& state);
  void tick_without_state();
  void tick_times(int periods);

  /// From now on every 0.1 s, with growing numbers, as an operator's program does.
  void give(const stance_msgs::user_command_t& command);
  void fall_silent() { given_.reset(); }
  void press_stop(std::int64_t seq);

  const Trace& trace() const { return ticker.output().trace; }
  const JointCommand& command() const { return ticker.output().command; }
  bool has(Fault fault) const { return (trace().faults & (1U << static_cast<int>(fault))) != 0; }
  std::int64_t count(Fault fault) const { return trace().fault_count[static_cast<std::size_t>(fault)]; }

  config::RobotDescription robot;
  sim::Simulator simulator;
  loop::Ticker ticker;
  std::int32_t time_left_us = loop::kWholePeriodUs;  ///< that the ticks are told

 private:
  void answer();
  void repeat_command();

  std::optional<stance_msgs::user_command_t> given_;
  int ticks_since_given_ = 0;
};

/// The states of a run with the biped's own controller, encoded; `scenario`'s user commands are left out.
std::vector<ByteVector> recorded_states(const sim::Scenario& scenario, int periods, std::int64_t run_id);

}  // namespace stance::test
