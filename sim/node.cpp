#include "sim/node.hpp"

#include <poll.h>

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <stance_msgs/run_info_t.hpp>
#include <string_view>
#include <utility>

#include "controller/io/lcm_bytes.hpp"
#include "controller/platform/hash.hpp"
#include "controller/platform/real_time.hpp"
#include "stance_commit.hpp"

namespace stance::sim {
namespace {

using io::encode;

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr auto kPeriodNs = static_cast<std::int64_t>(kControlPeriod * 1e9);
static_assert(kPeriodNs == 10'000'000);

const std::string kRobotState = "ROBOT_STATE";
const std::string kTruth = "TRUTH";
const std::string kUserCommand = "USER_COMMAND";
const std::string kCalibrationPoints = "CALIBRATION_POINTS";
const std::string kBallObservation = "BALL_OBSERVATION";
const std::string kBallTruth = "BALL_TRUTH";
const std::string kRunInfo = "RUN_INFO_SIMULATOR";

/// FNV-1a, 64 bit, of the texts one after the other, in hexadecimal.
std::string hash_of(std::initializer_list<std::string_view> texts) {
  std::uint64_t hash = platform::kHashSeed;
  for (const std::string_view text : texts) hash = platform::hash(text, hash);
  std::array<char, 17> digits{};
  std::snprintf(digits.data(), digits.size(), "%016" PRIx64, hash);
  return digits.data();
}

/// ns past `instant_ns` when it is over.
std::int64_t wait_until(std::int64_t instant_ns, const std::atomic<bool>& stop) noexcept {
  while (!stop.load(std::memory_order_relaxed) && platform::monotonic_ns() < instant_ns) {
    platform::sleep_until(instant_ns);
  }
  return platform::monotonic_ns() - instant_ns;
}

}  // namespace

std::vector<std::uint8_t> encode_run_info(const config::RobotDescription& robot, const Scenario& scenario,
                                          const SimulatorOptions& simulator_options, const std::string& options) {
  stance_msgs::run_info_t info{};
  info.utime = simulator_options.start_utime;
  info.seq = 1;
  info.run_id = simulator_options.run_id;
  info.seed = static_cast<std::int64_t>(simulator_options.seed);
  info.program = "stance-sim";
  info.version = STANCE_VERSION;
  info.source = STANCE_COMMIT;
  info.build = STANCE_BUILD;
  info.robot = robot.name;
  info.options = options;
  info.urdf = robot.urdf_text;
  info.configuration = robot.yaml_text;
  info.scenario = scenario.text;
  info.input_hash = hash_of({robot.urdf_text, robot.yaml_text, scenario.text});
  return io::bytes_of(info);
}

Node::Node(lcm::LCM& lcm, Simulator& simulator, std::vector<std::uint8_t> run_info)
    : lcm_(lcm), simulator_(simulator), run_info_(std::move(run_info)) {
  constexpr int queue = 16;
  lcm_.subscribeFunction("JOINT_COMMAND", &Node::on_command, this)->setQueueCapacity(queue);
  lcm_.subscribeFunction("FORCE_PLAN", &Node::on_plan, this)->setQueueCapacity(queue);
  lcm_.subscribeFunction("CATCH_PLAN", &Node::on_catch_plan, this)->setQueueCapacity(queue);
  lcm_.subscribeFunction("PUSH", &Node::on_push, this)->setQueueCapacity(queue);
  lcm_.subscribeFunction(kUserCommand, &Node::on_user_command, this)->setQueueCapacity(queue);
}

void Node::on_command(const Buffer*, const std::string&, const stance_msgs::joint_command_t* command, Node* node) {
  // A refused command is an answer, too: the drives do without it.
  node->simulator_.accept(*command);
  const auto& state = node->simulator_.state();
  const bool ours = command->run_id == state.run_id && command->state_seq <= state.seq;
  if (ours) node->answered_seq_ = std::max(node->answered_seq_, command->state_seq);
}

void Node::on_plan(const Buffer*, const std::string&, const stance_msgs::force_plan_t* plan, Node* node) {
  node->simulator_.accept(*plan);
}

void Node::on_catch_plan(const Buffer*, const std::string&, const stance_msgs::catch_plan_t* plan, Node* node) {
  node->simulator_.accept(*plan);
}

void Node::on_push(const Buffer*, const std::string&, const stance_msgs::push_t* push, Node* node) {
  node->simulator_.accept(*push);
}

void Node::on_user_command(const Buffer*, const std::string&, const stance_msgs::user_command_t* command, Node* node) {
  node->simulator_.hear(*command);
}

void Node::publish_state() {
  lcm_.publish(kRobotState, state_bytes_.data(), static_cast<unsigned>(state_bytes_.size()));
}

template <typename Message>
void Node::publish(const std::string& channel, const Message& message) {
  encode(message, bytes_);
  lcm_.publish(channel, bytes_.data(), static_cast<unsigned>(bytes_.size()));
}

void Node::publish_truth() {
  publish(kTruth, simulator_.truth());
  if (const auto* ball = simulator_.ball_truth()) publish(kBallTruth, *ball);
}

void Node::publish_instant() {
  if (const auto* command = simulator_.user_command()) publish(kUserCommand, *command);
  if (const auto* points = simulator_.calibration_points()) publish(kCalibrationPoints, *points);
  if (const auto* ball = simulator_.ball_observation()) publish(kBallObservation, *ball);
  encode(simulator_.state(), state_bytes_);
  publish_state();
  publish_truth();
}

void Node::housekeeping() {
  if (run_info_pace_.due()) lcm_.publish(kRunInfo, run_info_.data(), static_cast<unsigned>(run_info_.size()));
  const bool damped = simulator_.truth().drives_damped != 0;
  if (damped && !was_damped_) {
    ++report_.times_damped;
    std::fprintf(stderr, "stance-sim: no valid command: the drives damp (at %.2f s)\n", simulator_.time());
  }
  was_damped_ = damped;
}

void Node::take_messages_until(std::int64_t deadline_ns, const std::atomic<bool>& stop) {
  pollfd readable{lcm_.getFileno(), POLLIN, 0};
  while (!stop.load(std::memory_order_relaxed)) {
    const std::int64_t left = std::max<std::int64_t>(deadline_ns - platform::monotonic_ns(), 0);
    const timespec timeout{left / kSecondNs, left % kSecondNs};
    if (ppoll(&readable, 1, &timeout, nullptr) <= 0) return;  // the deadline, or a signal
    lcm_.handle();
  }
}

bool Node::wait_for_answer(const LockstepTiming& timing, const std::atomic<bool>& stop) {
  const auto ns = [](double seconds) { return static_cast<std::int64_t>(seconds * 1e9); };
  const std::int64_t start = platform::monotonic_ns();
  const std::int64_t end = start + ns(answered_seq_ == 0 ? timing.first_answer : timing.silence);
  std::int64_t repeat = start + ns(timing.repeat);
  pollfd readable{lcm_.getFileno(), POLLIN, 0};
  while (answered_seq_ < simulator_.state().seq) {
    const std::int64_t now = platform::monotonic_ns();
    if (stop.load(std::memory_order_relaxed) || now >= end) return false;
    if (now >= repeat) {
      publish_state();
      housekeeping();
      repeat = now + ns(timing.repeat);
    }
    const std::int64_t left = std::max<std::int64_t>(std::min(repeat, end) - now, 0);
    const timespec timeout{left / kSecondNs, left % kSecondNs};
    if (ppoll(&readable, 1, &timeout, nullptr) > 0) lcm_.handle();
  }
  return true;
}

NodeReport Node::run_lockstep(std::int64_t periods, const LockstepTiming& timing, const std::atomic<bool>& stop) {
  housekeeping();
  for (std::int64_t k = 0; k < periods; ++k) {
    publish_instant();
    housekeeping();
    if (!wait_for_answer(timing, stop)) {
      report_.ending = stop.load(std::memory_order_relaxed) ? Ending::kStopped : Ending::kSilence;
      return report_;
    }
    simulator_.advance();
  }
  publish_truth();
  return report_;
}

NodeReport Node::run_real_time(std::int64_t periods, std::int64_t start_ns, const std::atomic<bool>& stop) {
  constexpr auto deadline_after = static_cast<std::int64_t>(kCommandDeadline * 1e9);
  constexpr auto answer_time = static_cast<std::int64_t>(kAnswerTime * 1e9);
  constexpr auto max_lateness = static_cast<std::int64_t>(kMaxLateness * 1e9);
  constexpr auto late = static_cast<std::int64_t>(kLate * 1e9);
  housekeeping();
  for (std::int64_t k = 0; k < periods; ++k) {
    std::int64_t instant = start_ns + k * kPeriodNs;
    std::int64_t lateness = wait_until(instant, stop);
    if (lateness > late) ++report_.late_instants;
    report_.worst_lateness = std::max(report_.worst_lateness, static_cast<double>(lateness) * 1e-9);
    while (lateness > max_lateness) {
      const std::int64_t slip = (lateness - max_lateness) / kPeriodNs + 1;
      report_.slipped_periods += slip;
      start_ns += slip * kPeriodNs;
      instant += slip * kPeriodNs;
      lateness = wait_until(instant, stop);
    }
    if (stop.load(std::memory_order_relaxed)) {
      report_.ending = Ending::kStopped;
      return report_;
    }
    publish_instant();
    housekeeping();
    take_messages_until(std::max(instant + deadline_after, platform::monotonic_ns() + answer_time), stop);
    simulator_.advance();
  }
  publish_truth();
  return report_;
}

}  // namespace stance::sim
