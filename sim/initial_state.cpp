#include "sim/initial_state.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "controller/kinematics/leg.hpp"
#include "sim/world.hpp"

namespace stance::sim {
namespace {

/// Moves the tip of each foot by its `lift` [m] along W's z, the base where it is.
void lift_feet(const config::RobotDescription& robot, const std::vector<double>& lift, rigid_body::State& state) {
  const auto legs = kinematics::leg_geometries(robot.model, robot.feet);
  for (std::size_t i = 0; i < legs.size(); ++i) {
    auto q = state.q.segment<4>(static_cast<Eigen::Index>(4 * i));
    Vector3 p_BF;
    Eigen::Matrix<double, 3, 4> J_BF;
    kinematics::foot_in_base(legs[i], q, p_BF, J_BF);
    p_BF += state.R_WB.transpose() * Vector3(0.0, 0.0, lift[i]);
    kinematics::LegVector reached;
    const Vector3 p_LF = kinematics::leg_rotation().transpose() * (p_BF - legs[i].p_BL);
    if (kinematics::leg_ik(legs[i], p_LF, q.tail<3>().sum(), reached) != kinematics::LegIkStatus::kOk) {
      throw std::invalid_argument("the legs do not reach the ground at the start: make the terrain's slope smaller");
    }
    q = reached;
  }
}

}  // namespace

rigid_body::State initial_state(const config::RobotDescription& robot, const InitialState& initial,
                                const Terrain& terrain) {
  rigid_body::State state;
  if (!robot.has_feet()) {
    state.q = initial.joint_position;
    return state;
  }
  state.q = robot.nominal_joint_position;
  state.R_WB = math::rotation_from_rpy(initial.roll_pitch_yaw);
  state.v_WB = initial.velocity_W;
  state.w_WB_W = initial.angular_velocity_W;

  const std::size_t num_feet = robot.feet.size();
  ContactVectors tips = foot_tips(robot.model, robot.feet, state);
  Vector3 mean = Vector3::Zero();
  for (std::size_t i = 0; i < num_feet; ++i) mean += tips[i] / static_cast<double>(num_feet);
  std::vector<double> ground, lift;
  for (std::size_t i = 0; i < num_feet; ++i) ground.push_back(terrain.height((tips[i] - mean).head<2>()));
  const double level = std::accumulate(ground.begin(), ground.end(), 0.0) / static_cast<double>(num_feet);
  for (const double height : ground) lift.push_back(height - level);
  if (std::any_of(lift.begin(), lift.end(), [](double height) { return height != 0.0; })) {
    lift_feet(robot, lift, state);
    tips = foot_tips(robot.model, robot.feet, state);
  }
  // A sphere's distance from an inclined plane is along the plane's normal.
  const double upright = terrain.normal().z();
  double lowest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < num_feet; ++i) {
    lowest = std::min(lowest, tips[i].z() - ground[i] - robot.feet[i].radius / upright);
  }
  state.p_WB = {-mean.x(), -mean.y(), initial.foot_clearance / upright - lowest};
  return state;
}

}  // namespace stance::sim
