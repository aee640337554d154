#pragma once
// What the simulator's tests share.
#include <string>

#include "controller/config/robot_description.hpp"
#include "sim/scenario.hpp"
#include "sim/simulator.hpp"
#include "sim/world.hpp"

namespace stance::sim::test {

config::RobotDescription biped();

/// The biped high over the ground or on it, in its nominal pose.
WorldSetup biped_world(double height);

/// sim/scenarios/biped/<name>.yaml.
Scenario biped_scenario(const std::string& name);

/// A command of `run_id` that answers the simulator's present state and holds the nominal pose.
stance_msgs::joint_command_t hold_command(const config::RobotDescription& robot, const Simulator& simulator);

}  // namespace stance::sim::test
