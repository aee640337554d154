#include "sim/simulator.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>

#include "sim/initial_state.hpp"

namespace stance::sim {
namespace {

using kinematics::Fall;
using stance_msgs::catch_plan_t;
using stance_msgs::force_plan_t;
using stance_msgs::joint_command_t;
using stance_msgs::push_t;
using stance_msgs::truth_t;
using stance_msgs::user_command_t;

constexpr std::int64_t kPeriodUs = 10'000;
constexpr std::int64_t kStepUs = kPeriodUs / kStepsPerPeriod;
constexpr std::int64_t kCalibrationPeriods = 100;  ///< from one telling of the calibration's points to the next
static_assert(kControlPeriod == static_cast<double>(kPeriodUs) * 1e-6);
static_assert(kMaxContacts == force_plan_t::MAX_CONTACTS && kMaxContacts == truth_t::MAX_CONTACTS &&
              kMaxJoints == truth_t::MAX_JOINTS && kMaxJoints == joint_command_t::MAX_JOINTS);

void copy(const Vector3& from, double (&to)[3]) noexcept {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

Vector3 vector(const double (&v)[3]) noexcept { return {v[0], v[1], v[2]}; }

rigid_body::Model with_mass_factors(rigid_body::Model model, double base, double limbs) {
  model.total_mass = 0.0;
  for (int i = 0; i < model.num_bodies(); ++i) {
    auto& body = model.bodies[static_cast<std::size_t>(i)];
    const double factor = i == 0 ? base : limbs;
    body.mass *= factor;
    body.inertia *= factor;
    model.total_mass += body.mass;
  }
  return model;
}

}  // namespace

Simulator::Sums Simulator::no_sums() noexcept {
  Sums sums;
  sums.foot_force.fill(Vector3::Zero());
  return sums;
}

template <typename Message>
void Simulator::Delayed<Message>::put(const Message& message, std::int64_t now, std::int64_t delay) noexcept {
  last_accepted_step = now;
  if (num_waiting > 0 && waiting[num_waiting - 1].effect_step == now + delay) --num_waiting;
  waiting[num_waiting] = {message, now + delay};
  ++num_waiting;
}

template <typename Message>
void Simulator::Delayed<Message>::promote(std::int64_t now) noexcept {
  while (num_waiting > 0 && waiting[0].effect_step <= now) {
    current = waiting[0].message;
    has_current = true;
    std::move(waiting.begin() + 1, waiting.begin() + static_cast<std::ptrdiff_t>(num_waiting), waiting.begin());
    --num_waiting;
  }
}

template <typename Message>
bool Simulator::Delayed<Message>::valid(std::int64_t now, std::int64_t timeout_steps) const noexcept {
  return has_current && now - last_accepted_step < timeout_steps;
}

Simulator::Simulator(const config::RobotDescription& robot, const Scenario& scenario, const SimulatorOptions& options)
    : robot_(robot),
      scenario_(scenario),
      options_(options),
      num_contacts_(robot.feet.size()),
      timeout_steps_(std::lround(robot.drives.command_timeout / kPhysicsStep)),
      gate_(options.run_id, robot.model.num_joints, timeout_steps_ / kStepsPerPeriod) {
  robot_.model = with_mass_factors(robot_.model, scenario_.trunk_mass_factor, scenario_.limb_mass_factor);
  WorldSetup setup;
  setup.model = robot_.model;
  setup.feet = robot_.feet;
  setup.shapes = rigid_body::collision_shapes_from_urdf(robot_.urdf_text, robot_.model);
  setup.friction = scenario_.friction;
  setup.floating = num_contacts_ > 0;
  setup.terrain = Terrain(scenario_.terrain, options_.seed);
  setup.initial = initial_state(robot_, scenario_.initial, setup.terrain);
  if (robot_.cup) {
    setup.ball = scenario_.ball;
    camera_.emplace(scenario_.camera, options_.seed);
    camera_->begin(options_.start_utime, options_.run_id);
    judge_.emplace(robot_.cup->radius, robot_.cup->depth);
    throws_.reserve(scenario_.throws.size());
    for (const ScheduledThrow& one : scenario_.throws) {
      launch_velocity_.push_back(launch_velocity(scenario_.ball, one.from_W, one.aim_W, one.flight_time));
    }
  }
  if (options_.plant.value_or(scenario_.plant) == Plant::kMultibody) {
    world_.emplace(setup);
  } else {
    if (num_contacts_ == 0) {
      throw std::invalid_argument("the single body stands on feet, and " + robot.name +
                                  " has none: leave the plant out");
    }
    if (!scenario_.terrain.is_flat()) {
      throw std::invalid_argument("the single body stands on flat ground: give the scenario's terrain as flat");
    }
    single_body_.emplace(setup);
  }

  resting_force_W_.fill(Vector3::Zero());
  for (std::size_t i = 0; i < num_contacts_; ++i) {
    resting_force_W_[i].z() = robot_.model.total_mass * kGravity / static_cast<double>(num_contacts_);
  }
  ContactVectors first_force = resting_force_W_;
  if (scenario_.initial.foot_clearance > 0.0) first_force.fill(Vector3::Zero());
  sensors_.emplace(scenario_.sensors, robot_.model.num_joints, static_cast<int>(num_contacts_), setup.initial,
                   first_force, options_.seed);
  write_messages(no_sums());
}

Acceptance Simulator::accept(const joint_command_t& command) noexcept {
  const Acceptance acceptance = gate_.judge(command, state_.seq);
  if (acceptance == Acceptance::kAccepted) commands_.put(command, step_, scenario_.command_delay_steps);
  return acceptance;
}

bool Simulator::accept(const force_plan_t& plan) noexcept {
  if (plan.run_id != options_.run_id || plan.num_contacts != static_cast<int>(num_contacts_) || plan.num_stages < 0) {
    return false;
  }
  if (plan.state_seq > state_.seq || plan.state_seq < newest_plan_state_seq_ ||
      (plan.state_seq == newest_plan_state_seq_ && plan.seq <= newest_plan_seq_)) {
    return false;
  }
  for (std::size_t i = 0; i < num_contacts_; ++i) {
    if (!vector(plan.force[0][i]).allFinite() || !vector(plan.p_WF[i]).allFinite()) return false;
  }
  newest_plan_seq_ = plan.seq;
  newest_plan_state_seq_ = plan.state_seq;
  plans_.put(plan, step_, scenario_.command_delay_steps);
  return true;
}

bool Simulator::accept(const catch_plan_t& plan) noexcept {
  if (!judge_ || plan.run_id != options_.run_id) return false;
  judge_->hear(plan);
  return true;
}

bool Simulator::accept(const push_t& push) noexcept {
  const Vector3 force = vector(push.force_W);
  const Vector3 point = vector(push.point_B);
  if (push.run_id != 0 && push.run_id != options_.run_id) return false;
  if (!force.allFinite() || !point.allFinite() || !std::isfinite(push.duration) || push.duration <= 0.0) return false;
  const auto over = [now = time()](const ScheduledPush& entry) { return entry.time + entry.duration <= now; };
  auto* const free = std::find_if(requested_pushes_.begin(), requested_pushes_.end(), over);
  if (free == requested_pushes_.end()) return false;
  *free = {time(), push.duration, force, point};
  return true;
}

Wrench Simulator::push_wrench(const rigid_body::State& state, double now) const noexcept {
  Wrench wrench;
  const auto add = [&](const ScheduledPush& push) {
    // The part of this step that the push covers, so that its impulse is exact whatever its times.
    const double covered = std::min(now + kPhysicsStep, push.time + push.duration) - std::max(now, push.time);
    if (covered <= 0.0) return;
    const Vector3 force = push.force_W * (covered / kPhysicsStep);
    wrench.force += force;
    wrench.moment += (state.R_WB * push.point_B).cross(force);
  };
  for (const ScheduledPush& push : scenario_.pushes) add(push);
  for (const ScheduledPush& push : requested_pushes_) add(push);
  return wrench;
}

ContactVectors Simulator::planned_forces() const noexcept {
  ContactVectors force_W = zero_contact_vectors();
  if (!plans_.valid(step_, timeout_steps_)) return force_W;
  for (std::size_t i = 0; i < num_contacts_; ++i) force_W[i] = vector(plans_.current.force[0][i]);
  return force_W;
}

void Simulator::move_single_body(const Wrench& push) {
  const bool planned = plans_.valid(step_, timeout_steps_) && plans_.current.num_stages > 0;
  for (std::size_t foot = 0; foot < num_contacts_; ++foot) {
    if (planned && plans_.current.contact[0][foot] == 0 && !drives_damped_) {
      single_body_->swing(foot, Eigen::Map<const kinematics::LegVector>(commands_.current.position + 4 * foot));
    } else {
      single_body_->stand(foot);
    }
  }
  single_body_->step(planned_forces(), push);
}

/// A foot on the ground rests there, whatever the plan asks of it.
ContactVectors Simulator::felt_by_single_body() const noexcept {
  ContactVectors force_W = zero_contact_vectors();
  for (std::size_t foot = 0; foot < num_contacts_; ++foot) {
    if (single_body_->on_ground(foot)) force_W[foot] = resting_force_W_[foot];
  }
  return force_W;
}

void Simulator::step(Sums& sums) {
  const auto state = [](const auto& plant) { return plant.state(); };
  const rigid_body::State before = plant(state);
  commands_.promote(step_);
  plans_.promote(step_);
  drives_damped_ = !commands_.valid(step_, timeout_steps_);
  const Wrench push = push_wrench(before, static_cast<double>(step_) * kPhysicsStep);
  JointVector torque = JointVector::Zero();
  if (world_) {
    torque = drives_damped_ ? damping_torque(robot_.model, robot_.drives.damping, before.qd)
                            : drive_torque(robot_.model, commands_.current, before.q, before.qd);
    if (robot_.cup) move_ball();
    world_->step(torque, push);
  } else {
    move_single_body(push);
  }
  const ContactVectors foot_force = plant([](const auto& p) { return p.foot_force_W(); });
  sensors_->step(before, plant(state), world_ ? foot_force : felt_by_single_body());
  const int body = plant([](const auto& p) { return p.body_on_ground(); });
  if (body >= 0 && num_contacts_ > 0) {
    const bool first = fall_ == Fall::kNone;
    judge_fall(Fall::kBodyOnGround);
    if (first && fallen()) fallen_on_ = robot_.model.bodies[static_cast<std::size_t>(body)].name;
  }
  if (world_ && world_->ball()) {
    judge_->step(options_.start_utime + (step_ + 1) * kStepUs, cup(), world_->ball()->p_W, world_->ball()->v_W);
  }
  sums.torque += torque / kStepsPerPeriod;
  sums.push += push.force / kStepsPerPeriod;
  for (std::size_t i = 0; i < num_contacts_; ++i) sums.foot_force[i] += foot_force[i] / kStepsPerPeriod;
  ++step_;
}

void Simulator::advance() {
  Sums sums = no_sums();
  for (int i = 0; i < kStepsPerPeriod; ++i) step(sums);
  ++period_;
  write_messages(sums);
}

void Simulator::hear(const user_command_t& command) noexcept {
  told_to_lie_ = command.behaviour == user_command_t::LIE_DOWN;
}

void Simulator::judge_fall(Fall fall) noexcept {
  if (fall == Fall::kNone || fallen() || lying_) return;
  if (told_to_lie_ && fall != Fall::kTilt && commands_.current.mode == joint_command_t::DAMP) {
    lying_ = true;
  } else {
    fall_ = fall;
  }
}

/// Throws the ball and takes it away as the scenario says.
void Simulator::move_ball() {
  const double now = static_cast<double>(step_) * kPhysicsStep;
  const auto at = [&](double time) { return std::abs(now - time) < 0.5 * kPhysicsStep; };
  if (world_->ball()) {
    const ScheduledThrow& one = scenario_.throws[next_throw_ - 1];
    if (at(one.time + one.flight_time + scenario_.ball_taken_after)) {
      judge_->end();
      write_ball_truth();
      throws_.push_back(ball_truth_);
      world_->take_ball();
    }
  }
  if (next_throw_ < scenario_.throws.size() && at(scenario_.throws[next_throw_].time)) {
    world_->throw_ball(scenario_.throws[next_throw_].from_W, launch_velocity_[next_throw_]);
    judge_->begin();
    ++next_throw_;
  }
}

CupPose Simulator::cup() const noexcept {
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(robot_.model, world_->state(), kinematics);
  const auto body = static_cast<std::size_t>(robot_.cup->body);
  return {kinematics.p_W[body] + kinematics.R_W[body] * robot_.cup->position, kinematics.R_W[body].col(2)};
}

void Simulator::write_ball_truth() noexcept {
  const CupPose pose = cup();
  const std::optional<BallState>& ball = world_->ball();
  ball_truth_.utime = options_.start_utime + period_ * kPeriodUs;
  ball_truth_.seq = period_ + 1;
  ball_truth_.run_id = options_.run_id;
  ball_truth_.throw_number = static_cast<std::int32_t>(next_throw_);
  ball_truth_.present = ball ? 1 : 0;
  if (ball) {
    copy(ball->p_W, ball_truth_.p_WBall);
    copy(ball->v_W, ball_truth_.v_WBall);
  }
  copy(pose.p_W, ball_truth_.p_WCup);
  copy(pose.axis_W, ball_truth_.axis_WCup);
  judge_->tell(ball_truth_);
}

const stance_msgs::calibration_points_t* Simulator::calibration_points() const {
  return camera_ && scenario_.camera.points > 0 && period_ % kCalibrationPeriods == 0 ? &camera_->calibration_points()
                                                                                      : nullptr;
}

void Simulator::write_messages(const Sums& sums) noexcept {
  const rigid_body::State now = plant([](const auto& p) { return p.state(); });
  const std::int64_t utime = options_.start_utime + period_ * kPeriodUs;
  const std::int64_t seq = period_ + 1;

  state_.utime = utime;
  state_.seq = seq;
  state_.run_id = options_.run_id;
  sensors_->read(state_);
  for (int i = 0; i < kMaxJoints; ++i) state_.joint_torque[i] = sums.torque[i];

  const Mechanics mechanics = plant([](const auto& p) { return p.mechanics(); });
  const ContactVectors tips = plant([](const auto& p) { return p.foot_tips_W(); });
  const Quaternion rotation(now.R_WB);
  const bool has_plan = plans_.valid(step_ - 1, timeout_steps_) && plans_.current.num_stages > 0;
  truth_.utime = utime;
  truth_.seq = seq;
  truth_.run_id = options_.run_id;
  truth_.num_joints = robot_.model.num_joints;
  truth_.num_contacts = static_cast<std::int32_t>(num_contacts_);
  copy(now.p_WB, truth_.p_WB);
  truth_.quat_WB[0] = rotation.w();
  truth_.quat_WB[1] = rotation.x();
  truth_.quat_WB[2] = rotation.y();
  truth_.quat_WB[3] = rotation.z();
  copy(now.v_WB, truth_.v_WB);
  copy(now.w_WB_W, truth_.w_WB_W);
  copy(mechanics.p_WC, truth_.p_WC);
  copy(mechanics.v_WC, truth_.v_WC);
  copy(mechanics.L_C_W, truth_.L_C_W);
  truth_.energy = mechanics.energy;
  for (int i = 0; i < kMaxJoints; ++i) {
    truth_.joint_position[i] = now.q[i];
    truth_.joint_velocity[i] = now.qd[i];
    truth_.joint_torque[i] = sums.torque[i];
  }
  truth_.plan_seq = has_plan ? plans_.current.seq : 0;
  for (std::size_t i = 0; i < num_contacts_; ++i) {
    const Vector3 planned = has_plan ? vector(plans_.current.force[0][i]) : sums.foot_force[i];
    copy(tips[i], truth_.p_WF[i]);
    copy(sums.foot_force[i], truth_.f_F_W[i]);
    copy(sums.foot_force[i] - planned, truth_.force_error[i]);
  }
  copy(sums.push, truth_.push_W);
  truth_.drives_damped = drives_damped_ ? 1 : 0;
  if (num_contacts_ > 0) {
    judge_fall(kinematics::fall_of(robot_.fallen, now.R_WB, now.p_WB, std::span(tips).first(num_contacts_),
                                   robot_.feet.front().radius));
  }
  truth_.fallen = fallen() ? 1 : 0;
  truth_.refused_stale = refused().stale;
  truth_.refused_not_finite = refused().not_finite;
  truth_.refused_order = refused().order;
  truth_.refused_run = refused().run;

  if (camera_) {
    write_ball_truth();
    const std::optional<BallState>& ball = world_->ball();
    camera_->look(period_, utime, ball ? std::optional(ball->p_W) : std::nullopt);
  }

  const auto& commands = scenario_.commands;
  while (next_command_ < commands.size() && commands[next_command_].period <= period_) ++next_command_;
  if (next_command_ == 0) return;
  const ScheduledCommand& command = commands[next_command_ - 1];
  user_command_due_ = !command.silent && (period_ - command.period) % kUserCommandPeriods == 0;
  if (!user_command_due_) return;
  user_command_.utime = utime;
  ++user_command_.seq;
  user_command_.run_id = options_.run_id;
  user_command_.behaviour = static_cast<std::int8_t>(command.behaviour);
  user_command_.velocity[0] = command.velocity.x();
  user_command_.velocity[1] = command.velocity.y();
  user_command_.yaw_rate = command.yaw_rate;
  user_command_.height_offset = command.height_offset;
  hear(user_command_);
}

}  // namespace stance::sim
