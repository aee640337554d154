#pragma once
// The 3-joint arm in the loop with its simulator.
#include <string>

#include "tests/loop/biped_rig.hpp"

namespace stance::test {

inline config::RobotDescription arm3() { return config::load_robot(config::share_directory() / "robots", "arm3"); }

/// The arm with `from` replaced by `to` in its YAML, or else in its URDF.
inline config::RobotDescription arm3_with(const std::string& from, const std::string& to) {
  config::RobotDescription arm = arm3();
  std::string& text = arm.yaml_text.find(from) != std::string::npos ? arm.yaml_text : arm.urdf_text;
  const auto at = text.find(from);
  if (at == std::string::npos) throw std::invalid_argument("arm3 has no " + from);
  text.replace(at, from.size(), to);
  return config::robot_from_texts(arm.yaml_text, arm.urdf_text);
}

/// On perfect sensors, told nothing.
inline sim::Scenario quiet_arm(const Vector3& start = Vector3::Zero()) {
  sim::Scenario scenario = sim::load_scenario(arm3(), "track", 1);
  scenario.initial.joint_position.head<3>() = start;
  scenario.commands.clear();
  return scenario;
}

class Arm3Rig : public BipedRig {
 public:
  explicit Arm3Rig(const sim::Scenario& scenario = quiet_arm(), const config::RobotDescription& arm = arm3())
      : BipedRig(scenario, arm) {}

  const Arm3Motion& motion() const { return ticker.output().arm3_motion; }
  Vector3 true_theta() const { return Eigen::Map<const Vector3>(simulator.truth().joint_position); }

  /// From now on every 0.1 s.
  void want(Behaviour behaviour) {
    stance_msgs::user_command_t command{};
    command.seq = next_seq_ += 1000;  // beyond those that repeat the last one
    command.behaviour = static_cast<std::int8_t>(behaviour);
    give(command);
  }

 private:
  std::int64_t next_seq_ = 0;
};

}  // namespace stance::test
