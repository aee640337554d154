#pragma once
// Where a run begins.
#include "controller/config/robot_description.hpp"
#include "controller/rigid_body/dynamics.hpp"
#include "sim/scenario.hpp"
#include "sim/terrain.hpp"

namespace stance::sim {

/// The nominal pose, W's origin amid the feet, the lowest foot at its clearance over the ground. Where the ground is
/// not as high under one foot as under the other, each leg reaches for its own, the last link's pitch kept. A robot
/// without feet begins with its joints where `initial` has them, its base in W's origin. Throws std::invalid_argument
/// where a leg cannot reach.
rigid_body::State initial_state(const config::RobotDescription& robot, const InitialState& initial,
                                const Terrain& terrain);

}  // namespace stance::sim
