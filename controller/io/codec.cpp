#include "controller/io/codec.hpp"

#include <algorithm>
#include <limits>
#include <stance_msgs/arm3_motion_t.hpp>
#include <stance_msgs/ball_estimate_t.hpp>
#include <stance_msgs/ball_observation_t.hpp>
#include <stance_msgs/calibration_points_t.hpp>
#include <stance_msgs/catch_plan_t.hpp>
#include <stance_msgs/controller_timing_t.hpp>
#include <stance_msgs/controller_trace_t.hpp>
#include <stance_msgs/force_plan_t.hpp>
#include <stance_msgs/joint_command_t.hpp>
#include <stance_msgs/robot_state_t.hpp>
#include <stance_msgs/stop_t.hpp>
#include <stance_msgs/tick_input_t.hpp>
#include <stance_msgs/user_command_t.hpp>

namespace stance::io {
namespace {

using stance_msgs::arm3_motion_t;
using stance_msgs::ball_estimate_t;
using stance_msgs::ball_observation_t;
using stance_msgs::calibration_points_t;
using stance_msgs::catch_plan_t;
using stance_msgs::controller_timing_t;
using stance_msgs::controller_trace_t;
using stance_msgs::force_plan_t;
using stance_msgs::joint_command_t;
using stance_msgs::robot_state_t;
using stance_msgs::stop_t;
using stance_msgs::tick_input_t;
using stance_msgs::user_command_t;

static_assert(robot_state_t::MAX_JOINTS == kMaxJoints && robot_state_t::MAX_CONTACTS == kMaxContacts &&
              robot_state_t::SAMPLES == kStateSamples);
static_assert(joint_command_t::MAX_JOINTS == kMaxJoints);
static_assert(force_plan_t::MAX_CONTACTS == kMaxContacts && force_plan_t::MAX_STAGES == kMaxPlanStages);
static_assert(controller_trace_t::MAX_CONTACTS == kMaxContacts && controller_trace_t::NUM_FAULTS == kNumFaults);
static_assert(controller_timing_t::NUM_STAGES == kNumStages);
static_assert(calibration_points_t::MAX_POINTS == kMaxCalibrationPoints && catch_plan_t::MAX_JOINTS == kMaxJoints);

/// A whole message and nothing else, or false.
template <typename Lcm>
bool decode_whole(Bytes bytes, Lcm& message) noexcept {
  const auto size = static_cast<int>(bytes.size());
  return message.decode(bytes.data(), 0, size) == size;
}

template <typename Lcm>
void encode_whole(const Lcm& message, Message& out) noexcept {
  const int size = message.encode(out.data.data(), 0, static_cast<int>(out.data.size()));
  out.size = size > 0 ? static_cast<std::size_t>(size) : 0;
}

template <typename Lcm>
void set_header(const Header& header, Lcm& message) noexcept {
  message.utime = header.utime;
  message.seq = header.seq;
  message.state_seq = header.state_seq;
  message.run_id = header.run_id;
  std::fill(std::begin(message.tag), std::end(message.tag), std::uint8_t{0});
}

template <typename Vector, typename T>
void copy_out(const Vector& from, T* to) noexcept {
  for (int i = 0; i < from.size(); ++i) to[i] = from[i];
}
template <typename Vector, typename T>
void copy_in(const T* from, Vector& to) noexcept {
  for (int i = 0; i < to.size(); ++i) to[i] = from[i];
}

}  // namespace

bool decode(Bytes bytes, RobotState& out) noexcept {
  robot_state_t message{};
  if (!decode_whole(bytes, message)) return false;
  out.utime = message.utime;
  out.seq = message.seq;
  out.run_id = message.run_id;
  out.num_joints = message.num_joints;
  out.num_contacts = message.num_contacts;
  out.sample_period = message.sample_period;
  for (std::size_t s = 0; s < kStateSamples; ++s) {
    SensorSample& sample = out.samples[s];
    copy_in(message.gyro[s], sample.gyro);
    copy_in(message.accelerometer[s], sample.accelerometer);
    copy_in(message.joint_position[s], sample.joint_position);
    copy_in(message.joint_velocity[s], sample.joint_velocity);
    for (std::size_t c = 0; c < kMaxContacts; ++c) sample.contact_switch[c] = message.contact_switch[s][c] != 0;
  }
  copy_in(message.joint_torque, out.joint_torque);
  return true;
}

bool decode(Bytes bytes, UserCommand& out) noexcept {
  user_command_t message{};
  if (!decode_whole(bytes, message)) return false;
  out.utime = message.utime;
  out.seq = message.seq;
  out.behaviour = static_cast<Behaviour>(message.behaviour);
  copy_in(message.velocity, out.velocity);
  out.yaw_rate = message.yaw_rate;
  out.height_offset = message.height_offset;
  return true;
}

bool decode(Bytes bytes, Stop& out) noexcept {
  stop_t message{};
  if (!decode_whole(bytes, message)) return false;
  out.utime = message.utime;
  out.seq = message.seq;
  return true;
}

bool decode(Bytes bytes, BallObservation& out) noexcept {
  ball_observation_t message{};
  if (!decode_whole(bytes, message)) return false;
  out.utime = message.utime;
  out.seq = message.seq;
  out.run_id = message.run_id;
  out.valid = message.valid != 0;
  copy_in(message.p_KBall, out.p_K);
  return true;
}

bool decode(Bytes bytes, CalibrationPoints& out) noexcept {
  calibration_points_t message{};
  if (!decode_whole(bytes, message)) return false;
  out.utime = message.utime;
  out.seq = message.seq;
  out.run_id = message.run_id;
  out.num_points = message.num_points;
  for (std::size_t i = 0; i < kMaxCalibrationPoints; ++i) {
    copy_in(message.p_K[i], out.p_K[i]);
    copy_in(message.p_A[i], out.p_A[i]);
  }
  return true;
}

bool decode(Bytes bytes, TraceKey& out) noexcept {
  controller_trace_t message{};
  if (!decode_whole(bytes, message)) return false;
  out.header = {message.utime, message.seq, message.state_seq, message.run_id};
  out.consumed = {message.state_is_new != 0,
                  message.periods,
                  message.user_command_seq,
                  message.stop_seq,
                  message.ball_seq,
                  message.calibration_seq,
                  static_cast<std::uint64_t>(message.consumed_hash)};
  return true;
}

bool decode(Bytes bytes, TickTime& out) noexcept {
  tick_input_t message{};
  if (!decode_whole(bytes, message)) return false;
  out = {message.seq, message.time_left_us};
  return true;
}

std::optional<std::int64_t> tick_of(std::string_view channel, Bytes bytes) noexcept {
  joint_command_t command{};
  if (channel == io::channel::kJointCommand && decode_whole(bytes, command)) return command.seq;
  force_plan_t plan{};
  if (channel == io::channel::kForcePlan && decode_whole(bytes, plan)) return plan.seq;
  arm3_motion_t motion{};
  if (channel == io::channel::kArm3Motion && decode_whole(bytes, motion)) return motion.seq;
  ball_estimate_t ball{};
  if (channel == io::channel::kBallEstimate && decode_whole(bytes, ball)) return ball.seq;
  catch_plan_t catching{};
  if (channel == io::channel::kCatchPlan && decode_whole(bytes, catching)) return catching.seq;
  return std::nullopt;
}

void encode(const Header& header, const JointCommand& command, Message& out) noexcept {
  joint_command_t message{};
  set_header(header, message);
  message.mode = static_cast<std::int8_t>(command.mode);
  message.num_joints = command.num_joints;
  copy_out(command.feedforward_torque, message.feedforward_torque);
  copy_out(command.position, message.position);
  copy_out(command.velocity, message.velocity);
  copy_out(command.kp, message.kp);
  copy_out(command.kd, message.kd);
  encode_whole(message, out);
}

void encode(const Header& header, const ForcePlan& plan, Message& out) noexcept {
  force_plan_t message{};
  set_header(header, message);
  message.num_contacts = plan.num_contacts;
  message.num_stages = plan.num_stages;
  for (std::size_t k = 0; k < kMaxPlanStages; ++k) {
    message.stage_duration[k] = plan.stage_duration[k];
    copy_out(plan.p_WC[k], message.p_WC[k]);
    for (std::size_t c = 0; c < kMaxContacts; ++c) {
      message.contact[k][c] = plan.contact[k][c] ? 1 : 0;
      copy_out(plan.force[k][c], message.force[k][c]);
    }
  }
  for (std::size_t c = 0; c < kMaxContacts; ++c) copy_out(plan.p_WF[c], message.p_WF[c]);
  message.effort = plan.effort;
  encode_whole(message, out);
}

void encode(const Header& header, const Arm3Motion& motion, Message& out) noexcept {
  arm3_motion_t message{};
  set_header(header, message);
  message.step = motion.step;
  message.time = motion.time;
  copy_out(motion.theta, message.theta);
  copy_out(motion.given_rate, message.given_rate);
  copy_out(motion.calculated_rate, message.calculated_rate);
  copy_out(motion.v, message.v);
  copy_out(motion.omega, message.omega);
  copy_out(motion.dp, message.dp);
  copy_out(motion.dphi, message.dphi);
  for (int row = 0; row < motion.map.rows(); ++row) copy_out(motion.map.row(row), message.map_A3[row]);
  for (int row = 0; row < motion.jacobian.rows(); ++row) copy_out(motion.jacobian.row(row), message.jacobian[row]);
  encode_whole(message, out);
}

void encode(const Header& header, const BallEstimate& ball, Message& out) noexcept {
  ball_estimate_t message{};
  message.utime = ball.utime;
  message.seq = header.seq;
  message.observation_seq = ball.observation_seq;
  message.run_id = header.run_id;
  copy_out(ball.p_A, message.p_ABall);
  copy_out(ball.v_A, message.v_ABall);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) message.covariance[i][j] = ball.covariance(i, j);
  }
  message.nis = ball.updated ? ball.nis : std::numeric_limits<double>::quiet_NaN();
  encode_whole(message, out);
}

void encode(const Header& header, const CatchPlan& plan, Message& out) noexcept {
  catch_plan_t message{};
  set_header(header, message);
  message.phase = static_cast<std::int8_t>(plan.phase);
  message.calibration = static_cast<std::int8_t>(plan.calibration);
  message.calibration_rms = plan.calibration_rms;
  message.status = static_cast<std::int8_t>(plan.status);
  message.committed = plan.committed ? 1 : 0;
  message.catch_utime = plan.catch_utime;
  copy_out(plan.p_ABall, message.p_ABall);
  copy_out(plan.p_ACup, message.p_ACup);
  copy_out(plan.axis_ACup, message.axis_ACup);
  copy_out(plan.q, message.q);
  message.slack = plan.slack;
  copy_out(plan.q_ref, message.q_ref);
  copy_out(plan.v_ref, message.v_ref);
  message.observations = plan.observations;
  message.rejected = plan.rejected;
  encode_whole(message, out);
}

void encode(const Header& header, const Consumed& consumed, const Trace& trace, Message& out) noexcept {
  controller_trace_t message{};
  set_header(header, message);
  message.state_is_new = consumed.state_is_new ? 1 : 0;
  message.periods = consumed.periods;
  message.user_command_seq = consumed.user_command_seq;
  message.stop_seq = consumed.stop_seq;
  message.ball_seq = consumed.ball_seq;
  message.calibration_seq = consumed.calibration_seq;
  message.consumed_hash = static_cast<std::int64_t>(consumed.hash);
  message.safety = static_cast<std::int8_t>(trace.safety);
  message.faults = static_cast<std::int32_t>(trace.faults);
  std::copy(trace.fault_count.begin(), trace.fault_count.end(), message.fault_count);
  message.behaviour = static_cast<std::int8_t>(trace.behaviour);
  const BaseEstimate& estimate = trace.estimate;
  copy_out(estimate.p_WB, message.p_WB);
  const Quaternion quat(estimate.R_WB);
  message.quat_WB[0] = quat.w();
  message.quat_WB[1] = quat.x();
  message.quat_WB[2] = quat.y();
  message.quat_WB[3] = quat.z();
  copy_out(estimate.v_WB, message.v_WB);
  copy_out(estimate.w_WB_W, message.w_WB_W);
  copy_out(estimate.gyro_bias, message.gyro_bias);
  copy_out(estimate.accelerometer_bias, message.accelerometer_bias);
  copy_out(estimate.sigma_p, message.sigma_p);
  copy_out(estimate.sigma_v, message.sigma_v);
  copy_out(estimate.sigma_theta, message.sigma_theta);
  for (std::size_t c = 0; c < kMaxContacts; ++c) {
    copy_out(estimate.p_WF[c], message.p_WF[c]);
    message.contact[c] = estimate.contact[c] ? 1 : 0;
  }
  message.nis = estimate.nis;
  const GaitTrace& gait = trace.gait;
  message.gait_phase = static_cast<std::int8_t>(gait.phase);
  message.swing_foot = static_cast<std::int8_t>(gait.swing_foot);
  message.recovering = gait.recovering ? 1 : 0;
  message.crossing = static_cast<std::int8_t>(gait.crossing);
  message.steps = gait.steps;
  message.gait_time = gait.time;
  message.swing_time = gait.swing_time;
  message.next_swing_time = gait.next_swing_time;
  copy_out(gait.foothold, message.foothold);
  copy_out(gait.swing_p, message.swing_p);
  copy_out(gait.swing_v, message.swing_v);
  copy_out(gait.velocity_wanted, message.velocity_wanted);
  message.slope = gait.slope;
  copy_out(trace.x, message.x);
  copy_out(trace.x_ref, message.x_ref);
  message.qp_engine = static_cast<std::int8_t>(trace.qp_engine);
  message.qp_status = static_cast<std::int8_t>(trace.qp_status);
  message.qp_iterations = trace.qp_iterations;
  message.qp_primal_residual = trace.qp_primal_residual;
  message.qp_dual_residual = trace.qp_dual_residual;
  message.qp_active = trace.qp_active;
  message.effort = trace.effort;
  message.torques_clipped = trace.torques_clipped;
  encode_whole(message, out);
}

void encode(const Header& header, const Timing& timing, Message& out) noexcept {
  controller_timing_t message{};
  set_header(header, message);
  message.utime = timing.start_utime;
  std::copy(timing.stage_us.begin(), timing.stage_us.end(), message.stage_us);
  message.tick_us = timing.tick_us;
  message.cpu_us = timing.cpu_us;
  message.period_us = timing.period_us;
  message.wake_latency_us = timing.wake_latency_us;
  message.slack_us = timing.slack_us;
  message.state_age_us = timing.state_age_us;
  message.missed_ticks = timing.missed_ticks;
  message.dropped_states = timing.dropped_states;
  encode_whole(message, out);
}

void encode(const Header& header, std::int32_t time_left_us, Message& out) noexcept {
  tick_input_t message{};
  set_header(header, message);
  message.time_left_us = time_left_us;
  encode_whole(message, out);
}

}  // namespace stance::io
