#include "controller/behaviours/biped_config.hpp"

#include <cmath>

#include "controller/interface/require.hpp"

namespace stance::behaviours {
namespace {

constexpr int kMaxStages = 100;  // of a horizon; a plan publishes the first kMaxPlanStages of them

constexpr Require require{""};

}  // namespace

void HeightConfig::validate() const {
  require(integral_gain >= 0.0, "height.integral_gain", integral_gain, ">= 0");
  require(integral_limit >= 0.0, "height.integral_limit", integral_limit, ">= 0 m");
  require(offset_rate > 0.0, "height.offset_rate", offset_rate, "> 0 m/s");
  const auto [lowest, highest] = offset_range;
  require(lowest <= 0.0, "height.offset_range's least", lowest, "<= 0 m");
  require(highest >= 0.0, "height.offset_range's greatest", highest, ">= 0 m");
}

void BipedConfig::validate() const {
  estimator.validate();
  com_offset_observer.validate();
  force_qp.validate();
  height.validate();
  fault_ladder.validate();
  intake.validate();
  require(std::abs(last_link_pitch) < 1.5, "last_link_pitch", last_link_pitch, "within 1.5 rad of zero");
  require(force_limits.friction > 0.0, "force_qp.friction", force_limits.friction, "> 0");
  require(force_limits.normal_force_min >= 0.0, "force_qp.normal_force_min", force_limits.normal_force_min, ">= 0 N");
  require(force_limits.normal_force_max > force_limits.normal_force_min, "force_qp.normal_force_max",
          force_limits.normal_force_max, "> normal_force_min");
  require(stand.stages >= 1 && stand.stages <= kMaxStages, "stand.stages", stand.stages, "in 1..100");
  require(stand.state_weights.minCoeff() >= 0.0, "stand.state_weights' least", stand.state_weights.minCoeff(), ">= 0");
  require(stand.force_weight > 0.0, "stand.force_weight", stand.force_weight, "> 0");
  require(torque_map.null_space_kp >= 0.0, "torque_map.null_space_kp", torque_map.null_space_kp, ">= 0");
  require(torque_map.null_space_kd >= 0.0, "torque_map.null_space_kd", torque_map.null_space_kd, ">= 0");
  walk.horizon.validate();
  walk.gait.validate();
  walk.velocity.validate();
  require(walk.horizon.num_stages() <= kMaxStages, "walk.horizon's stages", walk.horizon.num_stages(), "<= 100");
  require(walk.friction > 0.0, "walk.friction", walk.friction, "> 0");
  require(walk.state_weights.minCoeff() >= 0.0, "walk.state_weights' least", walk.state_weights.minCoeff(), ">= 0");
  require(walk.recovery_weights.minCoeff() >= 0.0, "walk.recovery_weights' least", walk.recovery_weights.minCoeff(),
          ">= 0");
  require(walk.force_weight > 0.0, "walk.force_weight", walk.force_weight, "> 0");
  require(walk.recovery_crouch >= 0.0, "walk.recovery_crouch", walk.recovery_crouch, ">= 0 m");
  require(walk.crouch_rate > 0.0, "walk.crouch_rate", walk.crouch_rate, "> 0 m/s");
  require(stepping.capture.minCoeff() > 0.0, "stepping.capture's least", stepping.capture.minCoeff(), "> 0 m");
  require(stepping.capture_pitch > 0.0, "stepping.capture_pitch", stepping.capture_pitch, "> 0 rad");
  require(stepping.capture_lead >= 0.0, "stepping.capture_lead", stepping.capture_lead, ">= 0 s");
  require(stepping.min_steps >= 1, "stepping.min_steps", stepping.min_steps, ">= 1");
  require(stepping.settled.minCoeff() > 0.0, "stepping.settled's least", stepping.settled.minCoeff(), "> 0 m");
  require(stepping.settled_feet > 0.0, "stepping.settled_feet", stepping.settled_feet, "> 0 m");
  require(stepping.settled_pitch > 0.0, "stepping.settled_pitch", stepping.settled_pitch, "> 0 rad");
  require(torque_map.max_posture_error > 0.0, "torque_map.max_posture_error", torque_map.max_posture_error, "> 0 rad");
  require(torque_map.swing_kp >= 0.0, "torque_map.swing_kp", torque_map.swing_kp, ">= 0");
  require(torque_map.swing_kd >= 0.0, "torque_map.swing_kd", torque_map.swing_kd, ">= 0");
  require(torque_map.swing_lead >= 0.0 && torque_map.swing_lead < 0.05, "torque_map.swing_lead", torque_map.swing_lead,
          "in 0..0.05 s");
  require(torque_map.max_ankle > 0.0, "torque_map.max_ankle", torque_map.max_ankle, "> 0 m");
  require(torque_map.max_reach > torque_map.max_ankle, "torque_map.max_reach", torque_map.max_reach, "> max_ankle");
  require(torque_map.limit_margin >= 0.0 && torque_map.limit_margin < 0.1, "torque_map.limit_margin",
          torque_map.limit_margin, "in 0..0.1 rad");
  require(torque_map.lead >= 0.0 && torque_map.lead < 0.05, "torque_map.lead", torque_map.lead, "in 0..0.05 s");
  require(com_offset_quiet_momentum > 0.0, "com_offset_observer.quiet_momentum", com_offset_quiet_momentum, "> 0");
}

}  // namespace stance::behaviours
