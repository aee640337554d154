#include "controller/planning/gait.hpp"

#include <algorithm>
#include <cmath>

#include "controller/interface/require.hpp"
#include "controller/planning/heading.hpp"

namespace stance::planning {
namespace {

constexpr double kRounding = 1e-6;  // s

constexpr Require require{"gait."};

}  // namespace

void GaitConfig::validate() const {
  footholds.validate();
  swing.validate();
  require(first_double_support > 0.0, "first_double_support", first_double_support, "> 0 s");
  require(capture_double_support > 0.0, "capture_double_support", capture_double_support, "> 0 s");
  require(recovery_double_support > 0.0, "recovery_double_support", recovery_double_support, "> 0 s");
  require(recovery_threshold > 0.0, "recovery_threshold", recovery_threshold, "> 0 m");
  require(freeze >= 0.0, "freeze", freeze, ">= 0 s");
  require(touchdown_phase > 0.0 && touchdown_phase < 1.0, "touchdown_phase", touchdown_phase, "in 0..1");
  require(touchdown_speed > 0.0, "touchdown_speed", touchdown_speed, "> 0 m/s");
  require(slope_gain >= 0.0 && slope_gain <= 1.0, "slope_gain", slope_gain, "in 0..1");
  require(slope_min_step > 0.0, "slope_min_step", slope_min_step, "> 0 m");
  require(max_slope >= 0.0, "max_slope", max_slope, ">= 0");
}

double GaitState::load(int foot) const noexcept {
  if (!stance(foot)) return 0.0;
  if (phase == GaitPhase::kSingleSupport || foot != swing || double_support <= 0.0) return 1.0;
  return std::clamp(1.0 - time / double_support, 0.0, 1.0);
}

Gait::Gait(const GaitConfig& config, double omega, double hip_lateral)
    : config_(config), omega_(omega), hip_lateral_(hip_lateral), swing_(config.swing) {
  config.validate();
}

double Gait::double_support() const noexcept {
  return state_.recovering ? config_.recovery_double_support : config_.footholds.double_support;
}

void Gait::start(int swing, double double_support, const GaitInput& input) noexcept {
  state_ = GaitState{};
  state_.swing = swing;
  state_.double_support = double_support;
  state_.swing_time = state_.next_swing_time = config_.footholds.swing_time;
  state_.p_WF = input.p_WF;
}

FootholdProblem Gait::problem(const Pendulum& com, const Vector2& support, const Vector2& swing_foot, int swing,
                              const Vector2& velocity, double yaw) const noexcept {
  FootholdProblem problem;
  problem.com = {in_heading(yaw, com.p - support), in_heading(yaw, com.v)};
  problem.swing_foot = in_heading(yaw, swing_foot - support);
  problem.side = swing == 0 ? 1.0 : -1.0;
  problem.swing_time = state_.swing_time;
  problem.double_support = double_support();
  problem.velocity = velocity;
  problem.omega = omega_;
  problem.hip_lateral = hip_lateral_;
  return problem;
}

void Gait::step(const GaitInput& input, double dt) noexcept {
  state_.time += dt;
  if (state_.phase == GaitPhase::kDoubleSupport) {
    if (state_.time >= state_.double_support - kRounding) {
      state_.phase = GaitPhase::kSingleSupport;
      state_.time = 0.0;
      state_.swing_time = state_.next_swing_time;
      swing_.lift_off(input.p_WF[static_cast<std::size_t>(state_.swing)]);
    }
  } else if (landed(input, dt)) {
    touch_down(input);
  }
  p_swing_ = input.p_WF[static_cast<std::size_t>(state_.swing)];
  for (int foot = 0; foot < 2; ++foot) {
    const auto i = static_cast<std::size_t>(foot);
    if (state_.stance(foot)) state_.p_WF[i] = input.p_WF[i];
  }
  if (state_.phase == GaitPhase::kSingleSupport) {
    plan(input);
    const Vector3& support = state_.p_WF[static_cast<std::size_t>(state_.support())];
    const double forward = in_heading(input.yaw, state_.foothold - support.head<2>()).x();
    state_.foothold_z = support.z() + state_.slope * forward;
    swing_.step(state_.foothold, state_.foothold_z, std::max(0.0, state_.swing_time - state_.time), dt);
  }
}

bool Gait::landed(const GaitInput& input, double dt) const noexcept {
  const auto foot = static_cast<std::size_t>(state_.swing);
  // A foot that scuffs on its way would be kicked off the ground by the forces of a stance.
  const double speed = (input.p_WF[foot] - p_swing_).head<2>().norm() / dt;
  return swing_.phase() > config_.touchdown_phase && input.contact_switch[foot] && speed < config_.touchdown_speed;
}

void Gait::touch_down(const GaitInput& input) noexcept {
  const Vector3 step =
      input.p_WF[static_cast<std::size_t>(state_.swing)] - input.p_WF[static_cast<std::size_t>(state_.support())];
  const double forward = in_heading(input.yaw, step.head<2>()).x();
  if (std::abs(forward) > config_.slope_min_step) {
    const double slope = std::clamp(step.z() / forward, -config_.max_slope, config_.max_slope);
    state_.slope += config_.slope_gain * (slope - state_.slope);
  }
  state_.phase = GaitPhase::kDoubleSupport;
  state_.time = 0.0;
  state_.double_support = double_support();
  state_.swing = state_.support();
  ++state_.steps;
}

void Gait::plan(const GaitInput& input) noexcept {
  const Vector2 support = state_.p_WF[static_cast<std::size_t>(state_.support())].head<2>();
  const Vector2 swing_foot = input.p_WF[static_cast<std::size_t>(state_.swing)].head<2>();
  FootholdProblem now = problem(input.com, support, swing_foot, state_.swing, input.velocity, input.yaw);
  now.time = state_.time;
  Vector2 foothold;
  if (state_.swing_time - state_.time > config_.freeze) {
    const FootholdPlan best = plan_footholds(config_.footholds, now);
    state_.swing_time = best.swing_time;
    state_.next_swing_time = best.next_swing_time;
    state_.crossing = best.crossing;
    const double measure = std::max(best.deviation, 0.5 * std::abs(best.swing_time - config_.footholds.swing_time));
    state_.recovering = measure > config_.recovery_threshold;
    foothold = best.foothold;
  } else {
    foothold = foothold_at(config_.footholds, now, state_.swing_time, state_.crossing);
  }
  state_.foothold = support + in_world(input.yaw, foothold);
  state_.double_support = double_support();
}

}  // namespace stance::planning
