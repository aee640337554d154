#include "controller/compose.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>

#include "controller/behaviours/arm3_controller.hpp"
#include "controller/behaviours/biped_controller.hpp"
#include "controller/behaviours/catcher_controller.hpp"
#include "controller/config/arm3_config_yaml.hpp"
#include "controller/config/biped_config_yaml.hpp"
#include "controller/config/catcher_config_yaml.hpp"

namespace stance {
namespace {

/// The ticks of a controller that the function keeps alive.
template <typename Controller>
loop::TickFunction ticks_of(std::shared_ptr<Controller> controller) {
  return
      [controller](const TickInput& input, StageClock& clock, TickOutput& out) { controller->step(input, clock, out); };
}

loop::Controller biped(const config::RobotDescription& robot) { return compose_biped(robot).controller; }

loop::Controller arm3(const config::RobotDescription& robot) {
  return {ticks_of(std::make_shared<behaviours::Arm3Controller>(config::arm3_config(robot), robot.model)),
          {loop::kArm3Motion}};
}

loop::Controller catcher(const config::RobotDescription& robot) {
  return {ticks_of(std::make_shared<behaviours::CatcherController>(config::catcher_config(robot), robot.model)),
          {loop::publication<&TickOutput::ball>(io::channel::kBallEstimate),
           loop::publication<&TickOutput::catching>(io::channel::kCatchPlan)}};
}

struct Entry {
  std::string_view robot;
  loop::Controller (*compose)(const config::RobotDescription& robot);
};
constexpr std::array kRobots = {Entry{"biped", biped}, Entry{"arm3", arm3}, Entry{"catcher", catcher}};

}  // namespace

ComposedBiped compose_biped(const config::RobotDescription& robot) {
  if (robot.name != "biped") throw config::ConfigError("the robot '" + robot.name + "' is no biped");
  const auto biped = std::make_shared<behaviours::BipedController>(config::biped_config(robot), robot.model, robot.feet,
                                                                   robot.nominal_joint_position);
  return {{ticks_of(biped), {loop::kForcePlan}}, biped};
}

loop::Controller compose(const config::RobotDescription& robot) {
  const auto* const found =
      std::find_if(kRobots.begin(), kRobots.end(), [&](const Entry& entry) { return entry.robot == robot.name; });
  if (found != kRobots.end()) return found->compose(robot);
  std::string names;
  for (const Entry& entry : kRobots) names += (names.empty() ? "" : ", ") + std::string(entry.robot);
  throw config::ConfigError("no controller for the robot '" + robot.name + "': there is one for " + names);
}

std::string with_engine(const std::string& yaml_text, const std::string& engine) {
  YAML::Node root = YAML::Load(yaml_text);
  if (!root["controller"]["force_qp"]) {
    throw config::ConfigError("--solver is of robots with a force QP, and " +
                              root["robot"].as<std::string>("this one") + " has none: leave it out");
  }
  root["controller"]["force_qp"]["engine"] = engine;
  return YAML::Dump(root) + "\n";
}

}  // namespace stance
