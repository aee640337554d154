#include "controller/behaviours/biped_controller.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>

#include "controller/behaviours/shifted_plan.hpp"
#include "controller/planning/heading.hpp"

namespace stance::behaviours {
namespace {

std::array<rigid_body::Foot, 2> two_feet(const std::vector<rigid_body::Foot>& feet) {
  if (feet.size() != 2) {
    throw std::invalid_argument("a biped has 2 feet, the robot has " + std::to_string(feet.size()));
  }
  return {feet[0], feet[1]};
}

/// The nominal posture, trunk upright: what standing is designed about.
struct Nominal {
  double height = 0.0;       ///< m, C over the ground
  std::array<Vector3, 2> r;  ///< m, from C to the ground points
};

Nominal nominal_posture(const rigid_body::Model& model, const std::array<rigid_body::Foot, 2>& feet,
                        const JointVector& q) {
  rigid_body::State state;
  state.q = q;
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(model, state, kinematics);
  rigid_body::Centroidal centroidal;
  rigid_body::centroidal(model, kinematics, centroidal);
  Nominal nominal;
  for (std::size_t i = 0; i < 2; ++i) {
    const auto link = static_cast<std::size_t>(feet[i].body);
    const Vector3 p_WF = kinematics.p_W[link] + kinematics.R_W[link] * feet[i].tip;
    nominal.r[i] = p_WF - Vector3(0.0, 0.0, feet[i].radius) - centroidal.p_WC;
  }
  nominal.height = -0.5 * (nominal.r[0].z() + nominal.r[1].z());
  return nominal;
}

bool has_plan(const TickOutput& out) noexcept { return out.plan.num_stages > 0; }

}  // namespace

BipedController::BipedController(const BipedConfig& config, const rigid_body::Model& model,
                                 const std::vector<rigid_body::Foot>& feet, const JointVector& nominal_joint_position)
    : config_(config),
      model_(model),
      feet_(two_feet(feet)),
      legs_(kinematics::leg_geometries(model, feet)),
      fresh_estimator_(config.estimator, legs_, feet_[0].radius),
      fresh_observer_(config.com_offset_observer, model.total_mass, feet_[0].radius),
      intake_(config.intake, model_, kFeet, offer()),
      ladder_(config.fault_ladder),
      estimator_(fresh_estimator_),
      observer_(fresh_observer_),
      torque_map_(config.torque_map, config.last_link_pitch, model_, feet_, legs_),
      stand_([&] {
        config.validate();
        const Nominal nominal = nominal_posture(model_, feet_, nominal_joint_position);
        return Stand(config.stand, config.height, config.force_limits, config.force_qp, model_.total_mass,
                     kinematics::standing_inertia(model_, feet_, nominal_joint_position), nominal.r, nominal.height);
      }()),
      walk_(config.walk, config.height, config.force_limits, config.force_qp, model_.total_mass,
            kinematics::stepping_inertia(model_, feet_, nominal_joint_position),
            nominal_posture(model_, feet_, nominal_joint_position).height, legs_[0].p_BL.y(), feet_[0].radius) {
  start_run(0);
}

void BipedController::start_run(std::int64_t run_id) noexcept {
  memory_ = Memory{};
  intake_.start_run(run_id);
  intake_.offer(offer());
  give_up(SafetyMode::kDamp, memory_.last);
  ladder_ = safety::FaultLadder(config_.fault_ladder);
  estimator_ = fresh_estimator_;
  observer_ = fresh_observer_;
}

safety::Offer BipedController::offer() const noexcept {
  return {safety::behaviour_bits({Behaviour::kStand, Behaviour::kWalk, Behaviour::kLieDown}),
          config_.height.offset_range};
}

void BipedController::step(const TickInput& input, StageClock& clock, TickOutput& out) noexcept {
  if (intake_.starts_run(input.state)) start_run(input.state.run_id);
  const bool fresh = intake_.accept(input, ladder_);
  clock.stamp(Stage::kValidate);

  out = memory_.last;
  Trace& trace = out.trace;
  trace.qp_status = QpStatus::kNotRun;
  trace.qp_iterations = 0;
  trace.qp_primal_residual = trace.qp_dual_residual = 0.0;
  trace.qp_active = 0;
  trace.torques_clipped = 0;
  memory_.plan_age += input.periods;
  if (fresh) {
    estimate(input.periods, input.state, trace.estimate);
    clock.stamp(Stage::kEstimate);
    plan(input.periods, input.state, trace);
    clock.stamp(Stage::kPlan);
    memory_.stepping ? walk_.model() : stand_.model();
    clock.stamp(Stage::kModel);
    if (memory_.lying) {
      give_up(SafetyMode::kDamp, out);  // the trunk comes to rest on the ground
    } else if (!ladder_.latched()) {
      make_plan(input, out);
    }
    clock.stamp(Stage::kForceQp);
    if (has_plan(out)) {
      torque_map_.map(body_, leg_tasks(out.plan), out.command);
      trace.torques_clipped = safety::limit_torques(model_, out.command);
      if (trace.torques_clipped > 0) ladder_.report(Fault::kTorqueSaturated);
    }
    clock.stamp(Stage::kTorque);
    if (safety::joint_outside_limits(model_, body_.state.q)) ladder_.report(Fault::kJointLimit);
  }
  const SafetyMode mode = ladder_.step(input.periods, has_plan(out));
  if (mode == SafetyMode::kDamp || mode == SafetyMode::kStop) give_up(mode, out);
  ladder_.write(trace);
  memory_.last = out;
  clock.stamp(Stage::kSafety);
}

void BipedController::estimate(int periods, const RobotState& state, BaseEstimate& base) noexcept {
  const bool first = !estimator_.initialised();
  if (first) estimator_.initialise(state);
  estimator_.step(state, contact_plan(), base);

  const double dt = kControlPeriod * periods;
  body_.a_WB = first ? Vector3::Zero() : Vector3((base.v_WB - body_.state.v_WB) / dt);
  body_.wdot_WB_W = first ? Vector3::Zero() : Vector3((base.w_WB_W - body_.state.w_WB_W) / dt);
  body_.state = {base.p_WB, base.R_WB, base.v_WB, base.w_WB_W, state.now().joint_position, state.now().joint_velocity};
  rigid_body::forward_kinematics(model_, body_.state, body_.kinematics);
  rigid_body::centroidal(model_, body_.kinematics, body_.centroidal);
  rigid_body::mass_matrix(model_, body_.state, body_.mass_matrix);
  rigid_body::gravity_torques(model_, body_.state, body_.gravity);
  if (!memory_.lying && kinematics::fall_of(config_.fallen, base.R_WB, base.p_WB, std::span(base.p_WF).first<kFeet>(),
                                            feet_[0].radius) != kinematics::Fall::kNone) {
    ladder_.report(Fault::kRobotFallen);
  }
}

estimation::ContactPlan BipedController::contact_plan() const noexcept {
  estimation::ContactPlan plan;
  if (!memory_.stepping) return plan;
  for (std::size_t i = 0; i < kFeet; ++i) {
    plan.stance[i] = walk_.gait().state().stance(static_cast<int>(i));
    plan.load[i] = walk_.gait().state().load(static_cast<int>(i));
  }
  return plan;
}

void BipedController::plan(int periods, const RobotState& state, Trace& trace) noexcept {
  const BaseEstimate& base = trace.estimate;
  WalkInput now;
  now.rpy = math::rpy_from_rotation(base.R_WB);
  now.rpy.z() = math::unwrap(now.rpy.z(), memory_.yaw);
  memory_.yaw = now.rpy.z();
  now.p_WF = {base.p_WF[0], base.p_WF[1]};
  now.v_WC = body_.centroidal.v_WC;
  now.w_WB_W = base.w_WB_W;
  now.contact_switch = {state.now().contact_switch[0], state.now().contact_switch[1]};
  now.velocity = intake_.user_command().velocity;
  now.yaw_rate = intake_.user_command().yaw_rate;
  now.height_offset = intake_.user_command().height_offset;
  now.periods = periods;

  estimation::CentreOfMassOffsetInput seen;
  seen.p_WC = body_.centroidal.p_WC;
  seen.v_WC = now.v_WC;
  seen.L_C_W = body_.centroidal.L_C_W;
  seen.p_WF = now.p_WF;
  seen.yaw = memory_.yaw;
  // A push turns the robot about its feet as an offset would: look only while the robot is quiet.
  seen.standing = !memory_.stepping && base.contact[0] && base.contact[1] &&
                  body_.centroidal.L_C_W.head<2>().norm() < config_.com_offset_quiet_momentum;
  now.p_WC = seen.p_WC + observer_.step(seen, tick_duration(periods));

  choose_behaviour(now);
  TickState reference;
  if (memory_.stepping) {
    walk_.plan(now, reference);
  } else {
    stand(now, reference);
  }
  trace.behaviour = memory_.stepping ? Behaviour::kWalk : lying_down() ? Behaviour::kLieDown : Behaviour::kStand;
  trace.gait = GaitTrace{};
  if (memory_.stepping) walk_.note(trace.gait);
  trace.x = reference.x;
  trace.x_ref = reference.x_ref;
}

void BipedController::stand(const WalkInput& now, TickState& reference) noexcept {
  // A stance that was given up (damped) is taken up anew.
  if (!memory_.standing || ladder_.mode() == SafetyMode::kDamp) stand_.enter();
  memory_.standing = true;
  StandInput where;
  where.rpy = now.rpy;
  where.p_WC = now.p_WC;
  where.v_WC = now.v_WC;
  where.L_C_W = body_.centroidal.L_C_W;
  const Vector3 radius(0.0, 0.0, feet_[0].radius);
  for (std::size_t i = 0; i < kFeet; ++i) where.p_WG[i] = now.p_WF[i] - radius;
  const double lowest = config_.height.offset_range[0];
  where.height_offset = lying_down() ? lowest : now.height_offset;
  where.periods = now.periods;
  stand_.plan(where, reference);
  if (!lying_down() || stand_.height_offset() > lowest) return;
  memory_.lying = true;
  // It cannot get up.
  intake_.offer({safety::behaviour_bits({Behaviour::kLieDown}), config_.height.offset_range});
}

void BipedController::choose_behaviour(const WalkInput& now) noexcept {
  const SteppingConfig& c = config_.stepping;
  const auto in_heading = [&](const Vector3& v) { return planning::in_heading(now.rpy.z(), v.head<2>()); };
  // The divergent component of motion from the middle of the feet, and the feet from each other.
  const Vector2 xi = in_heading(now.p_WC + now.v_WC / walk_.gait().omega() - 0.5 * (now.p_WF[0] + now.p_WF[1]));
  const double pitch_soon = now.rpy.y() + c.capture_lead * in_heading(now.w_WB_W).y();
  const bool wanted = intake_.user_command().behaviour == Behaviour::kWalk;
  if (memory_.lying) return;
  if (!memory_.stepping) {
    const bool pushed =
        std::abs(xi.x()) > c.capture.x() || std::abs(xi.y()) > c.capture.y() || std::abs(pitch_soon) > c.capture_pitch;
    if (!wanted && !pushed) return;
    const planning::GaitConfig& gait = config_.walk.gait;
    const double double_support = pushed ? gait.capture_double_support : gait.first_double_support;
    walk_.enter(now, walk_.better_swing(now, double_support), double_support);
    memory_.stepping = true;
    memory_.standing = false;
    return;
  }
  const planning::GaitState& gait = walk_.gait().state();
  const double apart = in_heading(now.p_WF[0] - now.p_WF[1]).x();
  const bool settled = gait.phase == planning::GaitPhase::kDoubleSupport && gait.steps >= c.min_steps &&
                       std::abs(xi.x()) < c.settled.x() && std::abs(xi.y()) < c.settled.y() &&
                       std::abs(apart) < c.settled_feet && std::abs(pitch_soon) < c.settled_pitch;
  if (!wanted && settled) memory_.stepping = false;
}

void BipedController::make_plan(const TickInput& input, TickOutput& out) noexcept {
  const QpStatus status = memory_.stepping ? walk_.solve(input.time_left, out.plan, out.trace)
                                           : stand_.solve(input.time_left, out.plan, out.trace);
  const double elapsed = kControlPeriod * static_cast<double>(memory_.plan_age);
  if (status != QpStatus::kSolved) {
    ladder_.report(Fault::kQpFailed);
    if (!shift_plan(out.plan, elapsed, standing_feet())) return;  // it stays as it was, as long as the ladder holds it
  }
  memory_.plan_age = 0;
}

ContactFlags BipedController::standing_feet() const noexcept {
  ContactFlags standing{};
  for (std::size_t i = 0; i < kFeet; ++i) {
    standing[i] = !memory_.stepping || walk_.gait().state().stance(static_cast<int>(i));
  }
  return standing;
}

std::array<LegTask, BipedController::kFeet> BipedController::leg_tasks(const ForcePlan& plan) const noexcept {
  std::array<LegTask, kFeet> tasks;
  const ContactFlags standing = standing_feet();
  for (std::size_t i = 0; i < kFeet; ++i) {
    tasks[i].stance = standing[i];
    tasks[i].force_W = plan.force.front()[i];
    tasks[i].swing = walk_.gait().swing();
  }
  return tasks;
}

void BipedController::give_up(SafetyMode mode, TickOutput& out) const noexcept {
  out.command = JointCommand{};
  out.command.num_joints = model_.num_joints;
  out.command.mode = mode == SafetyMode::kDamp ? DriveMode::kDamp : DriveMode::kStop;
  if (mode == SafetyMode::kDamp) out.command.kd = config_.damping;
  out.plan = ForcePlan{};
  out.plan.num_contacts = kFeet;
  out.trace.effort = 0.0;
}

}  // namespace stance::behaviours
