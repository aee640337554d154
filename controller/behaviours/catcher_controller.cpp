#include "controller/behaviours/catcher_controller.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "controller/behaviours/tick.hpp"
#include "controller/calibration/calibration.hpp"
#include "controller/rigid_body/chain_dynamics.hpp"

namespace stance::behaviours {
namespace {

using calibration::Status;
using planning::InterceptionPlan;
using planning::InterceptionStatus;

// s before the meeting, from when on the give stays: a quintic so short breaks its limits by a posture's least change,
// and the arm has that speed by then.
constexpr double kGiveIsKept = 5 * kControlPeriod;

constexpr safety::Offer kOffer{safety::behaviour_bits({Behaviour::kStand, Behaviour::kCatch})};

static_assert(kMaxCalibrationPoints == calibration::kMaxPoints);

double seconds(std::int64_t from_us, std::int64_t to_us) noexcept {
  return (static_cast<double>(to_us) - static_cast<double>(from_us)) * 1e-6;
}

CalibrationState state_of(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return CalibrationState::kCalibrated;
    case Status::kUnequal:
      return CalibrationState::kUnequal;
    case Status::kTooFew:
      return CalibrationState::kTooFew;
    case Status::kTooMany:
      return CalibrationState::kTooMany;
    case Status::kNotFinite:
      return CalibrationState::kNotFinite;
    case Status::kDegenerate:
      break;
  }
  return CalibrationState::kDegenerate;
}

CatchStatus status_of(InterceptionStatus status) noexcept {
  switch (status) {
    case InterceptionStatus::kPlanned:
      return CatchStatus::kPlanned;
    case InterceptionStatus::kTime:
      return CatchStatus::kTime;
    case InterceptionStatus::kReach:
      break;
  }
  return CatchStatus::kReach;
}

}  // namespace

CatcherController::CatcherController(const CatcherConfig& config, const rigid_body::Model& model)
    : config_(config),
      model_(model),
      tree_(rigid_body::screw_tree(model)),
      cup_(rigid_body::tip_on_link(model, model.num_joints, {Matrix3::Identity(), {0.0, 0.0, config.tool}})),
      arm_(kinematics::arm5_geometry(model, config.tool)),
      ladder_(config.fault_ladder),
      intake_(config.intake, model_, 0, kOffer),
      track_(config.track, config.filter),
      interception_(config.planner, arm_, config.motion) {
  config_.validate();
  start_run(0);
}

void CatcherController::start_run(std::int64_t run_id) noexcept {
  memory_ = Memory{};
  give_up(SafetyMode::kDamp, memory_.last);
  ladder_ = safety::FaultLadder(config_.fault_ladder);
  intake_.start_run(run_id);
  track_ = BallTrack(config_.track, config_.filter);
  interception_.reset();
}

void CatcherController::step(const TickInput& input, StageClock& clock, TickOutput& out) noexcept {
  if (intake_.starts_run(input.state)) start_run(input.state.run_id);
  const bool fresh = intake_.accept(input, ladder_);
  clock.stamp(Stage::kValidate);

  out = memory_.last;
  Trace& trace = out.trace;
  trace.torques_clipped = 0;
  out.ball.updated = false;
  memory_.periods += input.periods;
  calibrate(input, out.catching);
  observe(input, out.ball, out.catching);
  clock.stamp(Stage::kEstimate);
  if (fresh) {
    const double dt = tick_duration(memory_.periods);
    memory_.periods = 0;
    plan(input.state, dt, out.catching);
    move(input.state, dt, out.catching);
    clock.stamp(Stage::kPlan);
    out.command = JointCommand{};
    out.command.num_joints = model_.num_joints;
    out.command.mode = DriveMode::kActive;
    planning::JointMotion reference = memory_.motion;
    reference.q += config_.computed_torque.lead * (reference.v + 0.5 * config_.computed_torque.lead * reference.a);
    reference.v += config_.computed_torque.lead * reference.a;
    computed_torque(reference, out.command);
    trace.torques_clipped = safety::limit_torques(model_, out.command);
    if (trace.torques_clipped > 0) ladder_.report(Fault::kTorqueSaturated);
    clock.stamp(Stage::kTorque);
    if (safety::joint_outside_limits(model_, input.state.now().joint_position)) ladder_.report(Fault::kJointLimit);
  }
  const SafetyMode mode = ladder_.step(input.periods, out.command.mode == DriveMode::kActive);
  if (mode == SafetyMode::kDamp || mode == SafetyMode::kStop) give_up(mode, out);
  ladder_.write(trace);
  trace.behaviour = intake_.user_command().behaviour;
  memory_.last = out;
  clock.stamp(Stage::kSafety);
}

void CatcherController::calibrate(const TickInput& input, CatchPlan& plan) noexcept {
  const CalibrationPoints& points = input.calibration;
  if (points.seq == memory_.calibration_seq || points.run_id != input.state.run_id) return;
  memory_.calibration_seq = points.seq;
  const auto count = static_cast<std::size_t>(std::clamp(points.num_points, 0, kMaxCalibrationPoints));
  const auto fit = calibration::calibrate(calibration::Kind::kRigid, std::span(points.p_K).first(count),
                                          std::span(points.p_A).first(count));
  plan.calibration = points.num_points > kMaxCalibrationPoints ? CalibrationState::kTooMany : state_of(fit.status);
  plan.calibration_rms = fit.rms;
  if (plan.calibration == CalibrationState::kCalibrated && !(fit.rms <= config_.max_calibration_rms)) {
    plan.calibration = CalibrationState::kTooRough;
  }
  if (plan.calibration != CalibrationState::kCalibrated) return;
  memory_.T_AK = {fit.T.leftCols<3>(), fit.T.col(3)};
  if (plan.phase == CatchPhase::kUncalibrated) enter(CatchPhase::kWaiting, plan);
}

void CatcherController::observe(const TickInput& input, BallEstimate& ball, CatchPlan& plan) noexcept {
  const BallObservation& seen = input.ball;
  const bool usable = input.ball_is_new && seen.run_id == input.state.run_id && seen.utime > memory_.ball_utime &&
                      seen.utime <= input.state.utime && seen.p_K.allFinite();
  if (!usable || !seen.valid || plan.phase == CatchPhase::kUncalibrated) return;
  memory_.ball_utime = seen.utime;
  const Vector3 p_A = memory_.T_AK * seen.p_K;
  if (plan.phase == CatchPhase::kWaiting) {
    // What it has in its cup is no new ball.
    const Vector3 cup = kinematics::arm5_forward(arm_, memory_.motion.q.head<5>()).p;
    if ((p_A - cup).norm() < config_.track.clear_of_cup && track_.observations() == 0) return;
  } else if (plan.phase != CatchPhase::kCatching) {
    return;
  }
  ball.nis = track_.observe(seen.utime, p_A);
  ball.updated = true;
  ball.utime = seen.utime;
  ball.observation_seq = seen.seq;
  const auto estimate = track_.at(seen.utime);
  ball.p_A = estimate.p();
  ball.v_A = estimate.v();
  ball.covariance = estimate.P.topLeftCorner<6, 6>();
  plan.observations = track_.observations();
  plan.rejected = track_.rejected();
}

void CatcherController::enter(CatchPhase phase, CatchPlan& plan) noexcept {
  plan.phase = phase;
  memory_.phase_time = 0.0;
}

void CatcherController::plan(const RobotState& state, double dt, CatchPlan& plan) noexcept {
  memory_.phase_time += dt;
  const bool wanted = intake_.user_command().behaviour == Behaviour::kCatch;
  const bool in_flight = track_.is_known(state.utime);
  switch (plan.phase) {
    case CatchPhase::kUncalibrated:
      break;
    case CatchPhase::kWaiting:
      if (wanted && in_flight) enter(CatchPhase::kCatching, plan);
      break;
    case CatchPhase::kCatching: {
      const double left = seconds(state.utime, plan.catch_utime);
      const bool planned = interception_.plan().exists();
      if (planned && left <= 0.0) {
        enter(CatchPhase::kHolding, plan);
      } else if (!wanted || (!in_flight && !(planned && plan.committed))) {
        enter(CatchPhase::kReturning, plan);
      }
      break;
    }
    case CatchPhase::kHolding:
      if (memory_.phase_time >= config_.course.hold_time) enter(CatchPhase::kReturning, plan);
      break;
    case CatchPhase::kReturning:
      if (memory_.phase_time >= config_.course.return_time) enter(CatchPhase::kWaiting, plan);
      break;
  }
  if (plan.phase == CatchPhase::kCatching) {
    intercept(state, dt, plan);
  } else if (plan.phase == CatchPhase::kReturning && memory_.phase_time == 0.0) {
    track_.reset();
    interception_.reset();
    memory_.give.setZero();
    plan.status = CatchStatus::kNone;
    plan.committed = false;
    plan.observations = 0;
  }
}

void CatcherController::intercept(const RobotState& state, double dt, CatchPlan& plan) noexcept {
  if (track_.is_known(state.utime)) {
    const auto ball = track_.thrown_at_aim(state.utime);
    const double now = static_cast<double>(state.utime) * 1e-6;
    const InterceptionPlan& found = interception_.update(now, {ball.p(), ball.v(), ball.x(6)}, memory_.motion);
    plan.status = status_of(found.status);
    plan.committed = found.committed;
    if (!found.exists()) return;
    plan.catch_utime = static_cast<std::int64_t>(std::llround(found.time * 1e6));
    plan.p_ABall = found.p_ABall;
    plan.q = found.q;
    plan.slack = found.slack;
    const double left = found.time - now;
    if (left > kGiveIsKept) memory_.give = choose_give(found, left, dt);
    const RigidTransform cup = kinematics::arm5_forward(arm_, found.q.head<5>());
    plan.p_ACup = cup.p;
    plan.axis_ACup = cup.R.col(2);
  }
}

/// The most of give() that the way there allows; nothing where the meeting's place is not known well enough.
JointVector CatcherController::choose_give(const InterceptionPlan& found, double left, double dt) const noexcept {
  const auto meeting = track_.at(static_cast<std::int64_t>(found.time * 1e6));
  const double variance = meeting.P.topLeftCorner<3, 3>().trace() / 3.0;
  if (variance <= config_.course.give_sigma * config_.course.give_sigma) {
    const JointVector whole = give(found);
    for (const double share : {1.0, 0.75, 0.5, 0.25}) {
      const JointVector speed = share * whole;
      if (planning::keeps_to_limits(config_.motion, model_.num_joints, found.q, speed, left + dt, memory_.motion)) {
        return speed;
      }
    }
  }
  return JointVector::Zero();
}

/// The joints' speeds with which the cup yields to the ball, of least norm and within a share of their limits.
JointVector CatcherController::give(const InterceptionPlan& found) const noexcept {
  constexpr double damping = 0.05;  // m/rad, where the cup cannot move that way
  constexpr double most = 0.8;      // of a joint's speed, and of the one from which it settles
  constexpr double peak = 1.5;      // of the acceleration over its mean, of the quintic to rest at half the way
  rigid_body::JointJacobian J_b;
  const RigidTransform T = rigid_body::body_jacobian(tree_, cup_, found.q, J_b);
  const Eigen::Matrix<double, 3, 5> J = T.R * J_b.bottomRows<3>().leftCols<5>();
  const double speed = std::min(config_.course.give * found.v_ABall.norm(), config_.course.max_give);
  const Matrix3 A = J * J.transpose() + damping * damping * Matrix3::Identity();
  JointVector v = JointVector::Zero();
  v.head<5>() = J.transpose() * A.llt().solve(speed * found.v_ABall.normalized());
  const auto attainable =
      config_.motion.speed.cwiseMin(config_.course.settle / peak * config_.motion.acceleration).head<5>().array();
  const double share = (v.head<5>().array() / attainable).abs().maxCoeff();
  return share > most ? JointVector(v * (most / share)) : v;
}

/// The posture with its cup turned up, as far as the last pitch joint goes.
JointVector CatcherController::upright(const JointVector& q) const noexcept {
  // The axis is up where the pitch q2 + q3 + q4 is pi.
  JointVector turned = q;
  turned[3] += std::remainder(std::numbers::pi - (q[1] + q[2] + q[3]), 2.0 * std::numbers::pi);
  return within_limits(turned);
}

JointVector CatcherController::within_limits(const JointVector& q) const noexcept {
  return q.cwiseMax(config_.motion.lower).cwiseMin(config_.motion.upper);
}

void CatcherController::move(const RobotState& state, double dt, CatchPlan& plan) noexcept {
  planning::JointMotion& motion = memory_.motion;
  // Where it was not led, the reference begins where the arm is.
  if (!memory_.moving || ladder_.mode() == SafetyMode::kDamp) {
    motion = planning::JointMotion{};
    motion.q = state.now().joint_position;
    if (!memory_.moving) memory_.phase_time = 0.0;
    memory_.moving = true;
  }
  JointVector target = config_.place, speed = JointVector::Zero();
  auto priority = planning::Priority::kSpeed;
  double time_left = config_.course.return_time - memory_.phase_time;
  if (plan.phase == CatchPhase::kCatching && interception_.plan().exists()) {
    time_left = seconds(state.utime, plan.catch_utime);
    target = plan.q;
    speed = memory_.give;
    priority = planning::Priority::kTime;
  } else if (plan.phase == CatchPhase::kHolding) {
    const CatchConfig& course = config_.course;
    const JointVector rest = within_limits(plan.q + 0.5 * course.settle * memory_.give);
    const bool settled = memory_.phase_time >= course.settle;
    target = settled ? upright(rest) : rest;
    time_left = (settled ? course.settle + course.upright_time : course.settle) - memory_.phase_time;
  }
  planning::advance(config_.motion, model_.num_joints, target, speed, time_left + dt, priority, dt, motion);
  plan.q_ref = motion.q;
  plan.v_ref = motion.v;
}

void CatcherController::computed_torque(const planning::JointMotion& reference, JointCommand& command) const noexcept {
  const rigid_body::Load gravity_only;
  rigid_body::JointMatrix M;
  rigid_body::joint_mass_matrix(tree_, reference.q, M);
  command.feedforward_torque = rigid_body::inverse_dynamics(tree_, reference.q, reference.v, reference.a, gravity_only);
  command.position = reference.q;
  command.velocity = reference.v;
  command.kp.head(model_.num_joints) = config_.computed_torque.kp * M.diagonal();
  command.kd.head(model_.num_joints) = config_.computed_torque.kd * M.diagonal();
}

void CatcherController::give_up(SafetyMode mode, TickOutput& out) const noexcept {
  out.command = JointCommand{};
  out.command.num_joints = model_.num_joints;
  out.command.mode = mode == SafetyMode::kDamp ? DriveMode::kDamp : DriveMode::kStop;
  if (mode == SafetyMode::kDamp) out.command.kd = config_.damping;
}

}  // namespace stance::behaviours
