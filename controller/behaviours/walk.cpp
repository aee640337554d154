#include "controller/behaviours/walk.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "controller/planning/heading.hpp"

namespace stance::behaviours {
namespace {

constexpr int kFeet = 2;
constexpr int kSettlingSteps = 2;       // touchdowns before the velocity's integral starts
constexpr double kSameFoothold = 1e-9;  // m

}  // namespace

Walk::Walk(const WalkConfig& config, const HeightConfig& height, const ForceLimits& limits,
           const force_qp::Settings& qp, double mass, const Matrix3& inertia, double nominal_height, double hip_lateral,
           double foot_radius)
    : config_(config),
      height_(height),
      limits_(limits),
      parameters_{mass, inertia},
      nominal_height_(nominal_height),
      foot_radius_(foot_radius),
      velocity_(config.velocity),
      gait_(config.gait, std::sqrt(kGravity / nominal_height), hip_lateral),
      horizon_(config.horizon),
      problem_({config.horizon.num_stages(), kFeet}),
      solution_({config.horizon.num_stages(), kFeet}),
      qp_(force_qp::make_force_qp(qp, {config.horizon.num_stages(), kFeet}, mass * kGravity)) {
  problem_.friction = config.friction;
}

planning::GaitInput Walk::gait_input(const WalkInput& input) const noexcept {
  planning::GaitInput out;
  out.com = {input.p_WC.head<2>(), input.v_WC.head<2>()};
  out.p_WF = input.p_WF;
  out.contact_switch = input.contact_switch;
  out.velocity = velocity_.effective();
  out.yaw = velocity_.yaw();
  return out;
}

int Walk::better_swing(const WalkInput& input, double double_support) const noexcept {
  const planning::Pendulum now{input.p_WC.head<2>(), input.v_WC.head<2>()};
  std::array<double, kFeet> cost{};
  for (int swing = 0; swing < kFeet; ++swing) {
    const Vector2 foot = input.p_WF[static_cast<std::size_t>(swing)].head<2>();
    const Vector2 support = input.p_WF[static_cast<std::size_t>(1 - swing)].head<2>();
    // The load moves over to the support meanwhile.
    const planning::Pendulum then = planning::swung(now, 0.5 * (foot + support), gait_.omega(), double_support);
    cost[static_cast<std::size_t>(swing)] =
        planning::plan_footholds(config_.gait.footholds,
                                 gait_.problem(then, support, foot, swing, Vector2::Zero(), input.rpy.z()))
            .cost;
  }
  return cost[0] <= cost[1] ? 0 : 1;
}

void Walk::enter(const WalkInput& input, int swing, double double_support) noexcept {
  height_.reset();
  crouch_ = 0.0;
  velocity_.reset(input.rpy.z());
  gait_.start(swing, double_support, gait_input(input));
  qp_->reset();
}

void Walk::plan(const WalkInput& input, TickState& out) noexcept {
  const double dt = tick_duration(input.periods);
  yaw_ = input.rpy.z();
  const Vector2 measured = planning::in_heading(velocity_.yaw(), input.v_WC.head<2>());
  velocity_.step(input.velocity, input.yaw_rate, measured, yaw_, gait_.state().steps > kSettlingSteps, dt);
  gait_.step(gait_input(input), dt);
  const planning::GaitState& gait = gait_.state();
  horizon_.roll_out(gait_, {input.p_WC.head<2>(), input.v_WC.head<2>()}, velocity_.effective(), velocity_.yaw());

  // The ground under the standing feet, and under C by its slope.
  Vector3 middle = Vector3::Zero();
  int standing = 0;
  for (int foot = 0; foot < kFeet; ++foot) {
    if (!gait.stance(foot)) continue;
    middle += gait.p_WF[static_cast<std::size_t>(foot)];
    ++standing;
  }
  middle /= standing;
  ground_z_ = middle.z() - foot_radius_;
  const double crouch_step = config_.crouch_rate * dt;
  crouch_ += std::clamp((gait.recovering ? config_.recovery_crouch : 0.0) - crouch_, -crouch_step, crouch_step);
  const double offset = height_.offset(input.height_offset, dt) - crouch_;
  const Vector2 ahead = planning::in_world(velocity_.yaw(), Vector2::UnitX());
  const auto height_at = [&](const Vector2& p) {
    return ground_z_ + nominal_height_ + offset + gait.slope * ahead.dot(p - middle.head<2>());
  };
  const double integral = height_.integral(height_at(input.p_WC.head<2>()) - input.p_WC.z(), dt);

  const double weight = parameters_.mass * kGravity;
  double time = 0.0;
  for (std::size_t k = 0; k < problem_.stages.size(); ++k) {
    const planning::HorizonStage& from = horizon_.stages()[k];
    force_qp::StageData& stage = problem_.stages[k];
    time += from.duration;
    stage.x_ref << 0.0, 0.0, velocity_.yaw() + velocity_.yaw_rate() * time, from.end.p,
        height_at(from.end.p) + integral, 0.0, 0.0, velocity_.yaw_rate(), from.end.v,
        gait.slope * ahead.dot(from.end.v);
    const double scale = from.duration / kControlPeriod;
    stage.Q = scale * (gait.recovering ? config_.recovery_weights : config_.state_weights);
    stage.R.setConstant(3 * kFeet, scale * config_.force_weight);

    // The pendulum's force, shared so that it acts in its ZMP.
    const Vector2 horizontal = parameters_.mass * gait_.omega() * gait_.omega() * (from.middle.p - from.zmp);
    const Vector3 force(horizontal.x(), horizontal.y(), weight);
    const Vector2 between = from.foot[1] - from.foot[0];
    const double share =
        std::clamp((from.zmp - from.foot[0]).dot(between) / std::max(between.squaredNorm(), 1e-4), 0.0, 1.0);
    stage.f_ref << (1.0 - share) * force, share * force;
    for (std::size_t i = 0; i < kFeet; ++i) {
      stage.fz_min[i] = from.contact[i] ? limits_.normal_force_min : 0.0;
      stage.fz_max[i] = from.contact[i] ? limits_.normal_force_max : 0.0;
    }
  }

  problem_.x0 << input.rpy, input.p_WC, input.w_WB_W, input.v_WC;
  out.x = problem_.x0;
  out.x_ref = problem_.stages.front().x_ref;
}

void Walk::model() noexcept {
  const planning::GaitState& gait = gait_.state();
  const double weight = parameters_.mass * kGravity;
  centroidal::Linearisation at;
  at.yaw = yaw_;
  at.num_contacts = kFeet;
  at.coupling = true;
  for (std::size_t k = 0; k < problem_.stages.size(); ++k) {
    const planning::HorizonStage& from = horizon_.stages()[k];
    at.dt = from.duration;
    const Vector2 horizontal = parameters_.mass * gait_.omega() * gait_.omega() * (from.middle.p - from.zmp);
    at.force_ref = {horizontal.x(), horizontal.y(), weight};
    at.p_ref = {from.start.p.x(), from.start.p.y(), ground_z_ + nominal_height_};
    for (std::size_t i = 0; i < kFeet; ++i) {
      const bool here = (from.foot[i] - gait.p_WF[i].head<2>()).norm() < kSameFoothold;
      const double z = here && gait.stance(static_cast<int>(i)) ? gait.p_WF[i].z() - foot_radius_ : ground_z_;
      const Vector3 p_WG(from.foot[i].x(), from.foot[i].y(), z);
      if (k == 0) p_WG_[i] = p_WG;
      at.r[i] = p_WG - at.p_ref;
    }
    centroidal::dynamics(parameters_, at, problem_.stages[k].dynamics);
  }
}

void Walk::note(GaitTrace& trace) const noexcept {
  const planning::GaitState& gait = gait_.state();
  const bool swinging = gait.phase == planning::GaitPhase::kSingleSupport;
  trace = GaitTrace{};
  trace.phase = swinging ? GaitPhase::kSingleSupport : GaitPhase::kDoubleSupport;
  trace.swing_foot = gait.swing;
  trace.recovering = gait.recovering;
  trace.crossing = gait.crossing;
  trace.steps = gait.steps;
  trace.time = gait.time;
  trace.swing_time = gait.swing_time;
  trace.next_swing_time = gait.next_swing_time;
  if (swinging) {
    const planning::SwingReference& swing = gait_.swing();
    trace.foothold << gait.foothold, gait.foothold_z;
    trace.swing_p = swing.p;
    trace.swing_v = swing.v;
  }
  trace.velocity_wanted << velocity_.ramped(), velocity_.yaw_rate();
  trace.slope = gait.slope;
}

QpStatus Walk::solve(double time_left, ForcePlan& plan, Trace& trace) noexcept {
  const QpStatus status = qp_->solve(problem_, solution_, time_left);
  behaviours::note(solution_, trace);
  if (status != QpStatus::kSolved) return status;
  plan.num_contacts = kFeet;
  plan.num_stages = std::min(static_cast<int>(problem_.stages.size()), kMaxPlanStages);
  plan.p_WF = p_WG_;
  for (std::size_t k = 0; k < static_cast<std::size_t>(plan.num_stages); ++k) {
    plan.stage_duration[k] = horizon_.stages()[k].duration;
    plan.p_WC[k] = solution_.states[k].segment<3>(3);
    for (std::size_t i = 0; i < kFeet; ++i) {
      plan.contact[k][i] = horizon_.stages()[k].contact[i];
      plan.force[k][i] = solution_.forces[k].segment<3>(3 * static_cast<int>(i));
    }
  }
  plan.effort = centroidal::effort(solution_.forces.front(), problem_.stages.front().R);
  trace.effort = plan.effort;
  return status;
}

}  // namespace stance::behaviours
