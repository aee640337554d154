#include "controller/config/biped_config_yaml.hpp"

#include "controller/config/safety_yaml.hpp"
#include "controller/config/strict_yaml.hpp"

namespace stance::config {
namespace {

estimation::BaseEstimatorConfig estimator(StrictYaml yaml) {
  estimation::BaseEstimatorConfig c;
  c.gyro_noise = yaml.number("gyro_noise");
  c.accelerometer_noise = yaml.number("accelerometer_noise");
  c.position_noise = yaml.number("position_noise");
  c.gyro_bias_noise = yaml.number("gyro_bias_noise");
  c.accelerometer_bias_noise = yaml.number("accelerometer_bias_noise");
  c.stance_foot_noise = yaml.number("stance_foot_noise");
  c.standing_foot_noise = yaml.number("standing_foot_noise");
  c.standing_time = yaml.number("standing_time");
  c.unloading_foot_noise = yaml.number("unloading_foot_noise");
  c.swing_foot_noise = yaml.number("swing_foot_noise");
  c.foot_velocity_sigma = yaml.number("foot_velocity_sigma");
  c.foot_position_sigma = yaml.number("foot_position_sigma");
  c.contact_ramp = yaml.number("contact_ramp");
  c.ramp_gain = yaml.number("ramp_gain");
  c.slip_gate = yaml.number("slip_gate");
  c.slip_timeout = yaml.number("slip_timeout");
  c.slip_inflation = yaml.number("slip_inflation");
  c.initial_tilt_sigma = yaml.number("initial_tilt_sigma");
  c.initial_yaw_sigma = yaml.number("initial_yaw_sigma");
  c.initial_velocity_sigma = yaml.number("initial_velocity_sigma");
  c.initial_position_sigma = yaml.number("initial_position_sigma");
  c.initial_foot_sigma = yaml.number("initial_foot_sigma");
  c.initial_gyro_bias_sigma = yaml.number("initial_gyro_bias_sigma");
  c.initial_accelerometer_bias_sigma = yaml.number("initial_accelerometer_bias_sigma");
  yaml.finish();
  return c;
}

estimation::CentreOfMassOffsetConfig com_offset_observer(StrictYaml yaml, double& quiet_momentum) {
  estimation::CentreOfMassOffsetConfig c;
  c.bandwidth = yaml.number("bandwidth");
  c.limit = yaml.number("limit");
  quiet_momentum = yaml.number("quiet_momentum");
  yaml.finish();
  return c;
}

void force_qp(StrictYaml yaml, force_qp::Settings& settings, behaviours::ForceLimits& limits) {
  const std::string engine = yaml.text("engine");
  if (engine == "osqp-condensed") {
    settings.engine = QpEngine::kOsqpCondensed;
  } else if (engine == "osqp-sparse") {
    settings.engine = QpEngine::kOsqpSparse;
  } else if (engine == "structured") {
    settings.engine = QpEngine::kStructured;
  } else {
    yaml.fail("engine", "is '" + engine + "', but must be structured, osqp-condensed or osqp-sparse");
  }
  settings.tolerance = yaml.number("tolerance");
  settings.max_iterations = yaml.integer("max_iterations");
  settings.max_primal_residual = yaml.number("max_primal_residual");
  settings.max_dual_residual = yaml.number("max_dual_residual");
  limits.friction = yaml.number("friction");
  limits.normal_force_min = yaml.number("normal_force_min");
  limits.normal_force_max = yaml.number("normal_force_max");
  yaml.finish();
}

behaviours::HeightConfig height(StrictYaml yaml) {
  behaviours::HeightConfig c;
  c.integral_gain = yaml.number("integral_gain");
  c.integral_limit = yaml.number("integral_limit");
  c.offset_rate = yaml.number("offset_rate");
  const auto range = yaml.numbers("offset_range", 2);
  c.offset_range = {range[0], range[1]};
  yaml.finish();
  return c;
}

behaviours::StandConfig stand(StrictYaml yaml) {
  behaviours::StandConfig c;
  c.stages = yaml.integer("stages");
  const auto weights = yaml.numbers("state_weights", 12);
  c.state_weights = Eigen::Map<const CentroidalState>(weights.data());
  c.force_weight = yaml.number("force_weight");
  yaml.finish();
  return c;
}

planning::Vector2 pair(StrictYaml& yaml, const char* key) {
  const auto values = yaml.numbers(key, 2);
  return {values[0], values[1]};
}

planning::FootholdConfig footholds(StrictYaml yaml) {
  planning::FootholdConfig c;
  c.step_width = yaml.number("step_width");
  c.swing_time = yaml.number("swing_time");
  c.double_support = yaml.number("double_support");
  c.min_swing_time = yaml.number("min_swing_time");
  c.max_swing_time = yaml.number("max_swing_time");
  c.min_second_time = yaml.number("min_second_time");
  c.max_second_time = yaml.number("max_second_time");
  c.min_time_left = yaml.number("min_time_left");
  c.max_forward = yaml.number("max_forward");
  c.min_lateral = yaml.number("min_lateral");
  c.max_lateral = yaml.number("max_lateral");
  c.crossing_forward = yaml.number("crossing_forward");
  c.crossing_lateral = yaml.number("crossing_lateral");
  c.hip_reach = yaml.number("hip_reach");
  c.centre_reach = yaml.number("centre_reach");
  c.foot_speed = yaml.number("foot_speed");
  c.path_clearance = yaml.number("path_clearance");
  c.crossing_cost = yaml.number("crossing_cost");
  c.crossing_threshold = yaml.number("crossing_threshold");
  yaml.finish();
  return c;
}

planning::SwingConfig swing(StrictYaml yaml) {
  planning::SwingConfig c;
  c.height = yaml.number("height");
  c.apex = yaml.number("apex");
  c.depth = yaml.number("depth");
  c.late_speed = yaml.number("late_speed");
  c.late_depth = yaml.number("late_depth");
  c.min_time_left = yaml.number("min_time_left");
  yaml.finish();
  return c;
}

planning::GaitConfig gait(StrictYaml yaml) {
  planning::GaitConfig c;
  c.footholds = footholds(yaml.mapping("footholds"));
  c.swing = swing(yaml.mapping("swing"));
  c.first_double_support = yaml.number("first_double_support");
  c.capture_double_support = yaml.number("capture_double_support");
  c.recovery_double_support = yaml.number("recovery_double_support");
  c.recovery_threshold = yaml.number("recovery_threshold");
  c.freeze = yaml.number("freeze");
  c.touchdown_phase = yaml.number("touchdown_phase");
  c.touchdown_speed = yaml.number("touchdown_speed");
  c.slope_gain = yaml.number("slope_gain");
  c.slope_min_step = yaml.number("slope_min_step");
  c.max_slope = yaml.number("max_slope");
  yaml.finish();
  return c;
}

planning::VelocityConfig velocity(StrictYaml yaml) {
  planning::VelocityConfig c;
  c.min = pair(yaml, "min");
  c.max = pair(yaml, "max");
  c.max_yaw_rate = yaml.number("max_yaw_rate");
  c.acceleration = yaml.number("acceleration");
  c.yaw_acceleration = yaml.number("yaw_acceleration");
  c.integral_gain = yaml.number("integral_gain");
  c.integral_limit = pair(yaml, "integral_limit");
  c.integral_share = yaml.number("integral_share");
  c.filter_time = yaml.number("filter_time");
  c.max_error = yaml.number("max_error");
  c.max_yaw_error = yaml.number("max_yaw_error");
  yaml.finish();
  return c;
}

planning::HorizonConfig horizon(StrictYaml yaml) {
  planning::HorizonConfig c;
  c.num_fine = yaml.integer("num_fine");
  c.num_coarse = yaml.integer("num_coarse");
  c.coarse_periods = yaml.integer("coarse_periods");
  yaml.finish();
  return c;
}

behaviours::WalkConfig walk(StrictYaml yaml) {
  behaviours::WalkConfig c;
  c.horizon = horizon(yaml.mapping("horizon"));
  c.gait = gait(yaml.mapping("gait"));
  c.velocity = velocity(yaml.mapping("velocity"));
  c.friction = yaml.number("friction");
  const auto weights = yaml.numbers("state_weights", 12), recovery = yaml.numbers("recovery_weights", 12);
  c.state_weights = Eigen::Map<const CentroidalState>(weights.data());
  c.recovery_weights = Eigen::Map<const CentroidalState>(recovery.data());
  c.force_weight = yaml.number("force_weight");
  c.recovery_crouch = yaml.number("recovery_crouch");
  c.crouch_rate = yaml.number("crouch_rate");
  yaml.finish();
  return c;
}

behaviours::SteppingConfig stepping(StrictYaml yaml) {
  behaviours::SteppingConfig c;
  c.capture = pair(yaml, "capture");
  c.capture_pitch = yaml.number("capture_pitch");
  c.capture_lead = yaml.number("capture_lead");
  c.min_steps = yaml.integer("min_steps");
  c.settled = pair(yaml, "settled");
  c.settled_feet = yaml.number("settled_feet");
  c.settled_pitch = yaml.number("settled_pitch");
  yaml.finish();
  return c;
}

behaviours::TorqueMapConfig torque_map(StrictYaml yaml) {
  behaviours::TorqueMapConfig c;
  c.null_space_kp = yaml.number("null_space_kp");
  c.null_space_kd = yaml.number("null_space_kd");
  c.lead = yaml.number("lead");
  c.max_posture_error = yaml.number("max_posture_error");
  c.swing_kp = yaml.number("swing_kp");
  c.swing_kd = yaml.number("swing_kd");
  c.swing_lead = yaml.number("swing_lead");
  c.max_ankle = yaml.number("max_ankle");
  c.max_reach = yaml.number("max_reach");
  c.limit_margin = yaml.number("limit_margin");
  yaml.finish();
  return c;
}

}  // namespace

behaviours::BipedConfig biped_config(const RobotDescription& robot) {
  StrictYaml root = StrictYaml::parse(robot.yaml_text, "biped.yaml");
  StrictYaml yaml = root.mapping("controller");
  behaviours::BipedConfig c;
  c.last_link_pitch = yaml.number("last_link_pitch");
  c.intake.user_command_timeout = yaml.number("user_command_timeout");
  c.estimator = estimator(yaml.mapping("estimator"));
  c.com_offset_observer = com_offset_observer(yaml.mapping("com_offset_observer"), c.com_offset_quiet_momentum);
  force_qp(yaml.mapping("force_qp"), c.force_qp, c.force_limits);
  c.height = height(yaml.mapping("height"));
  c.stand = stand(yaml.mapping("stand"));
  c.walk = walk(yaml.mapping("walk"));
  c.stepping = stepping(yaml.mapping("stepping"));
  c.torque_map = torque_map(yaml.mapping("torque_map"));
  read_safety(yaml.mapping("safety"), c.fault_ladder, c.intake.validation);
  yaml.finish();
  c.damping = robot.drives.damping;
  c.fallen = robot.fallen;
  try {
    c.validate();
  } catch (const std::invalid_argument& error) {
    throw ConfigError(std::string("biped.yaml: controller: ") + error.what());
  }
  return c;
}

}  // namespace stance::config
