#include "controller/behaviours/arm3_controller.hpp"

#include "controller/behaviours/tick.hpp"
#include "controller/rigid_body/chain_dynamics.hpp"

namespace stance::behaviours {
namespace {

constexpr int kJoints = 3;

constexpr safety::Offer kOffer{safety::behaviour_bits({Behaviour::kStand, Behaviour::kTrack, Behaviour::kTrackSmooth})};

}  // namespace

Arm3Controller::Arm3Controller(const Arm3Config& config, const rigid_body::Model& model)
    : config_(config),
      model_(model),
      tree_(rigid_body::screw_tree(model_)),
      ladder_(config.fault_ladder),
      intake_(config.intake, model_, 0, kOffer),
      integrator_(config.geometry) {
  config_.validate();
  start_run(0);
}

void Arm3Controller::start_run(std::int64_t run_id) noexcept {
  memory_ = Memory{};
  give_up(SafetyMode::kDamp, memory_.last.command);
  ladder_ = safety::FaultLadder(config_.fault_ladder);
  intake_.start_run(run_id);
}

void Arm3Controller::step(const TickInput& input, StageClock& clock, TickOutput& out) noexcept {
  if (intake_.starts_run(input.state)) start_run(input.state.run_id);
  const bool fresh = intake_.accept(input, ladder_);
  clock.stamp(Stage::kValidate);

  out = memory_.last;
  Trace& trace = out.trace;
  trace.torques_clipped = 0;
  if (fresh) {
    const JointVector& q = input.state.now().joint_position;
    choose_motion(q);
    play(input.periods, out);
    trace.behaviour = memory_.playing;
    clock.stamp(Stage::kPlan);
    follow(out.arm3_motion, out.command);
    trace.torques_clipped = safety::limit_torques(model_, out.command);
    if (trace.torques_clipped > 0) ladder_.report(Fault::kTorqueSaturated);
    clock.stamp(Stage::kTorque);
    if (safety::joint_outside_limits(model_, q)) ladder_.report(Fault::kJointLimit);
  }
  const SafetyMode mode = ladder_.step(input.periods, memory_.moving);
  if (mode == SafetyMode::kDamp || mode == SafetyMode::kStop) give_up(mode, out.command);
  ladder_.write(trace);
  memory_.last = out;
  clock.stamp(Stage::kSafety);
}

void Arm3Controller::choose_motion(const JointVector& q) noexcept {
  const Behaviour wanted = intake_.user_command().behaviour;
  // An arm that was damped is where it sank to, and its motion is over: who wants it asks again.
  const bool damped = ladder_.mode() == SafetyMode::kDamp || ladder_.mode() == SafetyMode::kStop;
  if (!memory_.moving || damped) {
    integrator_.start(q.head<kJoints>());
    memory_.rate.setZero();
    memory_.playing = Behaviour::kStand;
    memory_.steps = 0;
  }
  if (wanted != memory_.wanted && !damped) {
    integrator_.start(integrator_.theta());
    memory_.playing = wanted;
    memory_.steps = 0;
  }
  memory_.wanted = wanted;
  memory_.moving = true;
}

void Arm3Controller::play(int periods, TickOutput& out) noexcept {
  Arm3Motion& motion = out.arm3_motion;
  for (int k = 0; k < periods_made_good(periods); ++k) {
    motion.time = kControlPeriod * static_cast<double>(memory_.steps);
    if (memory_.playing != Behaviour::kStand) ++memory_.steps;
    motion.step = memory_.steps;
    integrator_.step(within_limits(given_rate(motion.time)), kControlPeriod, motion);
  }
}

Vector3 Arm3Controller::given_rate(double time) const noexcept {
  switch (memory_.playing) {
    case Behaviour::kTrack:
      return kinematics::arm3_given_rates(time);
    case Behaviour::kTrackSmooth:
      return kinematics::arm3_smooth_rates(config_.track.smooth_peak_rate, config_.track.smooth_duration, time);
    default:
      return Vector3::Zero();
  }
}

Vector3 Arm3Controller::within_limits(const Vector3& rate) noexcept {
  Vector3 allowed = rate;
  for (int i = 0; i < kJoints; ++i) {
    const rigid_body::Joint& joint = model_.joints[static_cast<std::size_t>(i)];
    const double next = integrator_.theta()[i] + rate[i] * kControlPeriod;
    const bool leaves = (rate[i] > 0.0 && next > joint.upper - config_.track.limit_margin) ||
                        (rate[i] < 0.0 && next < joint.lower + config_.track.limit_margin);
    if (!leaves) continue;
    allowed[i] = 0.0;
    ladder_.report(Fault::kJointLimit);
  }
  return allowed;
}

void Arm3Controller::follow(const Arm3Motion& motion, JointCommand& command) noexcept {
  const Arm3TrackConfig& track = config_.track;
  JointVector q = JointVector::Zero(), qd = JointVector::Zero(), qdd = JointVector::Zero();
  qd.head<kJoints>() = motion.calculated_rate;
  q.head<kJoints>() = motion.theta + motion.calculated_rate * track.lead;
  qdd.head<kJoints>() = (motion.calculated_rate - memory_.rate) / kControlPeriod;
  memory_.rate = motion.calculated_rate;

  rigid_body::JointMatrix M;
  rigid_body::joint_mass_matrix(tree_, q, M);
  command.mode = DriveMode::kActive;
  command.num_joints = kJoints;
  command.feedforward_torque = rigid_body::inverse_dynamics(tree_, q, qd, qdd, {});
  command.position = q;
  command.velocity = qd;
  command.kp.head<kJoints>() = track.kp * M.diagonal();
  command.kd.head<kJoints>() = track.kd * M.diagonal();
}

void Arm3Controller::give_up(SafetyMode mode, JointCommand& command) const noexcept {
  command = JointCommand{};
  command.num_joints = model_.num_joints;
  command.mode = mode == SafetyMode::kDamp ? DriveMode::kDamp : DriveMode::kStop;
  if (mode == SafetyMode::kDamp) command.kd = config_.damping;
}

}  // namespace stance::behaviours
