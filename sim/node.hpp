#pragma once
// The simulator on LCM. At each instant, in this order: USER_COMMAND, CALIBRATION_POINTS and
// BALL_OBSERVATION where one is due, ROBOT_STATE, TRUTH, BALL_TRUTH of a robot with a cup.
//
// Lockstep: the next instant comes when the JOINT_COMMAND that answers the state has arrived; the controller sends its
// FORCE_PLAN before it. Without an answer the same bytes of the state go out again and again, and silence ends the run.
// Real time: instants stand on an absolute grid of the monotonic clock. What has arrived by kCommandDeadline after an
// instant counts as given at it, then the whole period is computed at once; the simulator never waits for a command. So
// a run whose every command is on time equals the lockstep run, bit for bit. Where the machine stalls, the robot must
// not fall for it: an instant that is late still leaves kAnswerTime for its answer, and one later than kMaxLateness
// moves to the grid's next point, with all that follow; simulated time then falls behind the clock by whole periods.
#include <atomic>
#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "controller/config/robot_description.hpp"
#include "controller/platform/program.hpp"
#include "sim/scenario.hpp"
#include "sim/simulator.hpp"

namespace stance::sim {

/// The run_info_t of stance-sim, encoded. `options`: the command line.
std::vector<std::uint8_t> encode_run_info(const config::RobotDescription& robot, const Scenario& scenario,
                                          const SimulatorOptions& simulator_options, const std::string& options);

struct LockstepTiming {
  double repeat = 0.1;         ///< s without an answer, after which the state is sent again
  double silence = 5.0;        ///< s without an answer, after which the run ends
  double first_answer = 30.0;  ///< s: the same, before the first answer of all
};

enum class Ending { kCompleted, kStopped, kSilence };

/// What became of a run.
struct NodeReport {
  Ending ending = Ending::kCompleted;
  std::int64_t times_damped = 0;     ///< times that the drives began to damp for want of a command
  std::int64_t late_instants = 0;    ///< real time: instants more than kLate behind the grid
  std::int64_t slipped_periods = 0;  ///< real time: by which simulated time fell behind the clock
  double worst_lateness = 0.0;       ///< s
};

class Node {
 public:
  static constexpr double kCommandDeadline = 0.008;  ///< s after an instant
  static constexpr double kAnswerTime = 0.005;       ///< s, at least, from a state's sending
  static constexpr double kLate = 0.001;             ///< s
  static constexpr double kMaxLateness = 0.004;      ///< s

  /// Subscribes. `run_info` is published at the start and each second.
  Node(lcm::LCM& lcm, Simulator& simulator, std::vector<std::uint8_t> run_info);

  /// `periods` control periods, or until `stop`.
  NodeReport run_lockstep(std::int64_t periods, const LockstepTiming& timing, const std::atomic<bool>& stop);
  /// The same; the first instant is at `start_ns` of the monotonic clock, the simulator's start_utime.
  NodeReport run_real_time(std::int64_t periods, std::int64_t start_ns, const std::atomic<bool>& stop);

 private:
  // Handlers in LCM's way, for functions: those for methods do not get past GCC 12's undefined-behaviour sanitizer.
  using Buffer = lcm::ReceiveBuffer;
  static void on_command(const Buffer*, const std::string&, const stance_msgs::joint_command_t* command, Node* node);
  static void on_plan(const Buffer*, const std::string&, const stance_msgs::force_plan_t* plan, Node* node);
  static void on_catch_plan(const Buffer*, const std::string&, const stance_msgs::catch_plan_t* plan, Node* node);
  static void on_push(const Buffer*, const std::string&, const stance_msgs::push_t* push, Node* node);
  static void on_user_command(const Buffer*, const std::string&, const stance_msgs::user_command_t* command,
                              Node* node);
  template <typename Message>
  void publish(const std::string& channel, const Message& message);
  void publish_instant();
  void publish_state();
  void publish_truth();
  void housekeeping();
  void take_messages_until(std::int64_t deadline_ns, const std::atomic<bool>& stop);
  bool wait_for_answer(const LockstepTiming& timing, const std::atomic<bool>& stop);

  lcm::LCM& lcm_;
  Simulator& simulator_;
  std::vector<std::uint8_t> run_info_;
  std::vector<std::uint8_t> state_bytes_;
  std::vector<std::uint8_t> bytes_;  // of other messages, one after the other
  platform::EverySecond run_info_pace_;
  std::int64_t answered_seq_ = 0;  // newest state that a command answered
  bool was_damped_ = false;
  NodeReport report_;
};

}  // namespace stance::sim
