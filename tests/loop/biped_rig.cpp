#include "tests/loop/biped_rig.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <stance_msgs/force_plan_t.hpp>
#include <stance_msgs/stop_t.hpp>
#include <string_view>

namespace stance::test {
namespace {

/// Sets the node at a dotted path below `node`.
void set(YAML::Node node, const std::string& path, const YAML::Node& value) {
  const auto dot = path.find('.');
  if (dot == std::string::npos) {
    node[path] = value;
  } else {
    set(node[path.substr(0, dot)], path.substr(dot + 1), value);
  }
}

}  // namespace

config::RobotDescription biped() { return config::load_robot(config::share_directory() / "robots", "biped"); }

std::string biped_yaml_with(const std::string& path, const std::string& value) {
  YAML::Node root = YAML::Load(biped().yaml_text);
  set(root, path, YAML::Load(value));
  return YAML::Dump(root);
}

config::RobotDescription biped_with(const std::string& path, const std::string& value) {
  return config::robot_from_texts(biped_yaml_with(path, value), biped().urdf_text);
}

sim::Scenario quiet_stand() {
  sim::Scenario scenario = sim::load_scenario(biped(), "stand", 1);
  scenario.sensors.noise = {};
  scenario.pushes.clear();
  return scenario;
}

sim::ScheduledPush push(double time, double x, double y, double z) {
  return {.time = time, .duration = 0.1, .force_W = {x, y, z}, .point_B = Vector3::Zero()};
}

Answer answer_of(const loop::Ticker& ticker) {
  return {bytes_of(ticker.published().front().message), bytes_of(ticker.command()), bytes_of(ticker.trace())};
}

BipedRig::BipedRig(const sim::Scenario& scenario, const config::RobotDescription& description, std::int64_t run_id)
    : robot(description),
      simulator(robot, scenario, {.seed = 1, .run_id = run_id, .start_utime = 0, .plant = {}}),
      ticker(compose(robot)) {}

double BipedRig::tilt() const {
  const auto& q = simulator.truth().quat_WB;
  return std::acos(std::clamp(1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]), -1.0, 1.0));
}

void BipedRig::answer() {
  loop::NoClock clock;
  ticker.tick(1, clock, time_left_us);
  for (const auto& [channel, message] : ticker.published()) {
    if (std::string_view(channel) != io::channel::kForcePlan) continue;
    simulator.accept(decoded<stance_msgs::force_plan_t>(message.bytes()));
  }
  simulator.accept(decoded<stance_msgs::joint_command_t>(ticker.command().bytes()));
  simulator.advance();
}

void BipedRig::tick_with(const stance_msgs::robot_state_t& state) {
  repeat_command();
  static_cast<void>(ticker.offer_state(bytes_of(state)));
  answer();
}

void BipedRig::tick_without_state() {
  repeat_command();
  answer();
}

void BipedRig::tick_times(int periods) {
  for (int k = 0; k < periods; ++k) tick();
}

void BipedRig::give(const stance_msgs::user_command_t& command) {
  given_ = command;
  ticks_since_given_ = 0;
  static_cast<void>(ticker.offer_user_command(bytes_of(command)));
  simulator.hear(command);
}

void BipedRig::repeat_command() {
  if (given_ && ticks_since_given_ == sim::kUserCommandPeriods) {
    ++given_->seq;
    give(*given_);
  }
  ++ticks_since_given_;
}

void BipedRig::press_stop(std::int64_t seq) {
  stance_msgs::stop_t stop{};
  stop.seq = seq;
  static_cast<void>(ticker.offer_stop(bytes_of(stop)));
}

std::vector<ByteVector> recorded_states(const sim::Scenario& scenario, int periods, std::int64_t run_id) {
  BipedRig rig(scenario, biped(), run_id);
  std::vector<ByteVector> states;
  for (int k = 0; k < periods; ++k) {
    states.push_back(bytes_of(rig.state()));
    rig.tick();
  }
  return states;
}

}  // namespace stance::test
