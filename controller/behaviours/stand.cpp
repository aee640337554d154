#include "controller/behaviours/stand.hpp"

#include <algorithm>
#include <cmath>

namespace stance::behaviours {
namespace {

constexpr int kFeet = 2;

/// p, omega and v turned by R; theta as it is.
CentroidalState rotated(const Matrix3& R, const CentroidalState& x) noexcept {
  CentroidalState y = x;
  for (int block = 3; block < 12; block += 3) y.segment<3>(block) = R * x.segment<3>(block);
  return y;
}

}  // namespace

Stand::Stand(const StandConfig& config, const HeightConfig& height, const ForceLimits& limits,
             const force_qp::Settings& qp, double mass, const Matrix3& inertia, const std::array<Vector3, 2>& nominal_r,
             double nominal_height)
    : height_(height),
      parameters_{mass, inertia},
      nominal_height_(nominal_height),
      inertia_inverse_(inertia.inverse()),
      problem_({config.stages, kFeet}),
      solution_({config.stages, kFeet}),
      qp_(force_qp::make_force_qp(qp, {config.stages, kFeet}, mass * kGravity)) {
  const double weight = mass * kGravity;
  problem_.friction = limits.friction;
  for (force_qp::StageData& stage : problem_.stages) {
    stage.Q = config.state_weights;
    stage.R = centroidal::ForceVector::Constant(3 * kFeet, config.force_weight);
    stage.f_ref = centroidal::ForceVector::Zero(3 * kFeet);
    for (int i = 0; i < kFeet; ++i) {
      stage.f_ref[3 * i + 2] = weight / kFeet;
      stage.fz_min[static_cast<std::size_t>(i)] = limits.normal_force_min;
      stage.fz_max[static_cast<std::size_t>(i)] = limits.normal_force_max;
    }
  }
  centroidal::Linearisation nominal;
  nominal.num_contacts = kFeet;
  for (std::size_t i = 0; i < kFeet; ++i) nominal.r[i] = nominal_r[i];
  nominal.coupling = true;
  nominal.force_ref = {0.0, 0.0, weight};
  centroidal::Dynamics dynamics;
  centroidal::dynamics(parameters_, nominal, dynamics);
  problem_.has_terminal_cost = true;
  problem_.terminal_cost = centroidal::riccati_terminal_cost(dynamics, config.state_weights, problem_.stages.front().R);
}

void Stand::enter() noexcept {
  height_.reset();
  qp_->reset();
}

void Stand::plan(const StandInput& input, TickState& out) noexcept {
  const double dt = tick_duration(input.periods);
  p_WG_ = input.p_WG;
  const Vector3 middle = 0.5 * (p_WG_[0] + p_WG_[1]);
  const double height_ref = middle.z() + nominal_height_ + height_.offset(input.height_offset, dt);

  // Square to the feet, whatever the estimated yaw drifts by.
  const Vector3 feet = p_WG_[0] - p_WG_[1];
  yaw_ref_ = math::unwrap(std::atan2(-feet.x(), feet.y()), input.rpy.z());
  R_WH_ = math::rotation_z(yaw_ref_);
  p_ref_W_ = {middle.x(), middle.y(), height_ref + height_.integral(height_ref - input.p_WC.z(), dt)};
  // The trunk's angular velocity that carries the whole robot's angular momentum.
  const Vector3 omega_W = R_WH_ * (inertia_inverse_ * (R_WH_.transpose() * input.L_C_W));
  out.x << input.rpy, input.p_WC, omega_W, input.v_WC;
  out.x_ref << 0.0, 0.0, yaw_ref_, p_ref_W_, Vector3::Zero(), Vector3::Zero();

  const Matrix3 R_HW = R_WH_.transpose();
  problem_.x0 = rotated(R_HW, out.x);
  problem_.x0[2] -= yaw_ref_;
  CentroidalState x_ref_H = rotated(R_HW, out.x_ref);
  x_ref_H[2] = 0.0;
  for (force_qp::StageData& stage : problem_.stages) stage.x_ref = x_ref_H;
}

void Stand::model() noexcept {
  centroidal::Linearisation at;
  at.num_contacts = kFeet;
  for (std::size_t i = 0; i < kFeet; ++i) at.r[i] = R_WH_.transpose() * (p_WG_[i] - p_ref_W_);
  at.coupling = true;
  at.force_ref = {0.0, 0.0, parameters_.mass * kGravity};
  at.p_ref = R_WH_.transpose() * p_ref_W_;
  centroidal::dynamics(parameters_, at, problem_.stages.front().dynamics);
  for (std::size_t k = 1; k < problem_.stages.size(); ++k) {
    problem_.stages[k].dynamics = problem_.stages.front().dynamics;
  }
}

QpStatus Stand::solve(double time_left, ForcePlan& plan, Trace& trace) noexcept {
  const QpStatus status = qp_->solve(problem_, solution_, time_left);
  note(solution_, trace);
  if (status != QpStatus::kSolved) return status;

  plan.num_contacts = kFeet;
  plan.num_stages = std::min(static_cast<int>(problem_.stages.size()), kMaxPlanStages);
  plan.p_WF = p_WG_;
  for (std::size_t k = 0; k < static_cast<std::size_t>(plan.num_stages); ++k) {
    plan.stage_duration[k] = kControlPeriod;
    plan.p_WC[k] = R_WH_ * solution_.states[k].segment<3>(3);
    for (std::size_t i = 0; i < kFeet; ++i) {
      plan.contact[k][i] = true;
      plan.force[k][i] = R_WH_ * solution_.forces[k].segment<3>(3 * static_cast<int>(i));
    }
  }
  plan.effort = centroidal::effort(solution_.forces.front(), problem_.stages.front().R);
  trace.effort = plan.effort;
  return status;
}

}  // namespace stance::behaviours
