#include "controller/io/codec.hpp"

#include <array>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <random>
#include <set>
#include <stance_msgs/arm3_motion_t.hpp>
#include <stance_msgs/controller_timing_t.hpp>
#include <stance_msgs/controller_trace_t.hpp>
#include <stance_msgs/force_plan_t.hpp>
#include <stance_msgs/joint_command_t.hpp>
#include <stance_msgs/robot_state_t.hpp>
#include <stance_msgs/run_info_t.hpp>
#include <stance_msgs/stop_t.hpp>
#include <stance_msgs/tick_input_t.hpp>
#include <stance_msgs/user_command_t.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "controller/io/run_info.hpp"
#include "controller/platform/hash.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::io {
namespace {

using test::bytes_of;
using test::ByteVector;
using test::decoded;

constexpr double kQuaternionTolerance = 1e-12;

/// Gives a different value each time, so that no field can stand for another.
class Distinct {
 public:
  double real() { return next() + 0.25; }
  std::int64_t whole() { return static_cast<std::int64_t>(next()); }
  Vector3 vector() {
    Vector3 v;
    for (int i = 0; i < 3; ++i) v[i] = real();
    return v;
  }
  template <typename Vector>
  void fill(Vector& v) {
    for (auto& element : v) element = real();
  }
  void operator()(double& value) { value = real(); }
  void operator()(std::int64_t& value) { value = whole(); }
  void operator()(std::int32_t& value) { value = static_cast<std::int32_t>(whole()); }
  template <typename T, std::size_t N>
  void operator()(T (&array)[N]) {
    for (T& element : array) (*this)(element);
  }

 private:
  double next() { return value_ += 1.0; }
  double value_ = 100.0;
};

stance_msgs::robot_state_t distinct_state() {
  Distinct distinct;
  stance_msgs::robot_state_t m{};
  distinct(m.utime);
  distinct(m.seq);
  distinct(m.run_id);
  distinct(m.num_joints);
  distinct(m.num_contacts);
  distinct(m.sample_period);
  distinct(m.gyro);
  distinct(m.accelerometer);
  distinct(m.joint_position);
  distinct(m.joint_velocity);
  for (int s = 0; s < kStateSamples; ++s) {
    for (int c = 0; c < kMaxContacts; ++c) m.contact_switch[s][c] = (s + c) % 3 == 0 ? 1 : 0;
  }
  distinct(m.joint_torque);
  return m;
}

void check_equal(const RobotState& state, const stance_msgs::robot_state_t& m) {
  CHECK(state.utime == m.utime);
  CHECK(state.seq == m.seq);
  CHECK(state.run_id == m.run_id);
  CHECK(state.num_joints == m.num_joints);
  CHECK(state.num_contacts == m.num_contacts);
  CHECK(state.sample_period == m.sample_period);
  for (std::size_t s = 0; s < kStateSamples; ++s) {
    for (int i = 0; i < 3; ++i) {
      CHECK(state.samples[s].gyro[i] == m.gyro[s][i]);
      CHECK(state.samples[s].accelerometer[i] == m.accelerometer[s][i]);
    }
    for (int i = 0; i < kMaxJoints; ++i) {
      CHECK(state.samples[s].joint_position[i] == m.joint_position[s][i]);
      CHECK(state.samples[s].joint_velocity[i] == m.joint_velocity[s][i]);
    }
    for (std::size_t c = 0; c < kMaxContacts; ++c) {
      CHECK(state.samples[s].contact_switch[c] == (m.contact_switch[s][c] != 0));
    }
  }
  for (int i = 0; i < kMaxJoints; ++i) CHECK(state.joint_torque[i] == m.joint_torque[i]);
}

stance_msgs::user_command_t distinct_user_command() {
  Distinct distinct;
  stance_msgs::user_command_t m{};
  distinct(m.utime);
  distinct(m.seq);
  distinct(m.run_id);
  m.behaviour = 3;
  distinct(m.velocity);
  distinct(m.yaw_rate);
  distinct(m.height_offset);
  return m;
}

void check_equal(const UserCommand& command, const stance_msgs::user_command_t& m) {
  CHECK(command.utime == m.utime);
  CHECK(command.seq == m.seq);
  CHECK(static_cast<int>(command.behaviour) == m.behaviour);
  CHECK(command.velocity.x() == m.velocity[0]);
  CHECK(command.velocity.y() == m.velocity[1]);
  CHECK(command.yaw_rate == m.yaw_rate);
  CHECK(command.height_offset == m.height_offset);
}

stance_msgs::stop_t distinct_stop() {
  stance_msgs::stop_t m{};
  m.utime = 101;
  m.seq = 102;
  m.run_id = 103;
  return m;
}

void check_equal(const Stop& stop, const stance_msgs::stop_t& m) {
  CHECK(stop.utime == m.utime);
  CHECK(stop.seq == m.seq);
}

constexpr Header kHeader{.utime = 11, .seq = 12, .state_seq = 13, .run_id = 14};

stance_msgs::controller_trace_t distinct_trace_message() {
  stance_msgs::controller_trace_t m{};
  m.utime = 1;
  m.seq = 2;
  m.state_seq = 3;
  m.run_id = 4;
  m.state_is_new = 1;
  m.periods = 5;
  m.user_command_seq = 6;
  m.stop_seq = 7;
  m.consumed_hash = -8;
  return m;
}

void check_equal(const TraceKey& key, const stance_msgs::controller_trace_t& m) {
  CHECK(key.header.utime == m.utime);
  CHECK(key.header.seq == m.seq);
  CHECK(key.header.state_seq == m.state_seq);
  CHECK(key.header.run_id == m.run_id);
  CHECK(key.consumed.state_is_new == (m.state_is_new != 0));
  CHECK(key.consumed.periods == m.periods);
  CHECK(key.consumed.user_command_seq == m.user_command_seq);
  CHECK(key.consumed.stop_seq == m.stop_seq);
  CHECK(key.consumed.hash == static_cast<std::uint64_t>(m.consumed_hash));
}

template <typename Lcm>
void check_header(const Lcm& m) {
  CHECK(m.utime == kHeader.utime);
  CHECK(m.seq == kHeader.seq);
  CHECK(m.state_seq == kHeader.state_seq);
  CHECK(m.run_id == kHeader.run_id);
  for (const std::uint8_t byte : m.tag) CHECK(byte == 0);
}

/// The message of an encoder's bytes, which must be a whole one.
template <typename Lcm>
Lcm whole(const Message& message) {
  Lcm m{};
  REQUIRE(message.size == static_cast<std::size_t>(m.getEncodedSize()));
  REQUIRE(m.decode(message.data.data(), 0, static_cast<int>(message.size)) == static_cast<int>(message.size));
  return m;
}

template <typename Vector, typename T>
void check_elements(const Vector& expected, const T* values) {
  for (int i = 0; i < static_cast<int>(expected.size()); ++i) CHECK(values[i] == expected[i]);
}

/// All bytes that are no whole message of the type of `good`, tried one after the other: refused, and `out` left alone.
template <typename Lcm, typename Out>
void check_refuses_all_but_whole(const Lcm& good, Out& out, const std::vector<ByteVector>& others) {
  const ByteVector bytes = bytes_of(good);
  REQUIRE(decode(bytes, out));
  Lcm other = good;  // what would be seen of a partial write
  other.utime += 1;
  other.seq += 1;
  other.run_id += 1;
  const ByteVector other_bytes = bytes_of(other);
  for (std::size_t size = 0; size < other_bytes.size(); ++size) {
    CHECK_FALSE(decode(Bytes(other_bytes.data(), size), out));
  }
  ByteVector longer = other_bytes;
  longer.push_back(0);
  CHECK_FALSE(decode(longer, out));
  for (std::size_t i = 0; i < 8; ++i) {
    ByteVector of_another_type = other_bytes;
    of_another_type[i] ^= 1;
    CHECK_FALSE(decode(of_another_type, out));
  }
  std::mt19937 random(1);
  for (int k = 0; k < 100; ++k) {
    ByteVector garbage(bytes.size());
    for (auto& byte : garbage) byte = static_cast<std::uint8_t>(random());
    CHECK_FALSE(decode(garbage, out));
  }
  for (const ByteVector& message : others) CHECK_FALSE(decode(message, out));
  check_equal(out, good);
}

}  // namespace

TEST_CASE("EveryFieldOfARobotStateIsDecoded") {
  RobotState state;
  REQUIRE(decode(bytes_of(distinct_state()), state));
  check_equal(state, distinct_state());
}

TEST_CASE("EveryFieldOfAUserCommandIsDecoded") {
  UserCommand command;
  REQUIRE(decode(bytes_of(distinct_user_command()), command));
  check_equal(command, distinct_user_command());
}

TEST_CASE("EveryFieldOfAStopIsDecoded") {
  Stop stop;
  REQUIRE(decode(bytes_of(distinct_stop()), stop));
  check_equal(stop, distinct_stop());
}

TEST_CASE("WhatATickConsumedIsDecodedFromItsTrace") {
  TraceKey key;
  REQUIRE(decode(bytes_of(distinct_trace_message()), key));
  check_equal(key, distinct_trace_message());
}

TEST_CASE("BytesThatAreNoWholeMessageOfTheTypeAreRefusedAndLeaveTheOutputAlone") {
  const ByteVector state = bytes_of(distinct_state()), command = bytes_of(distinct_user_command()),
                   stop = bytes_of(distinct_stop()), trace = bytes_of(distinct_trace_message());
  RobotState state_out;
  check_refuses_all_but_whole(distinct_state(), state_out, {command, stop, trace});
  UserCommand command_out;
  check_refuses_all_but_whole(distinct_user_command(), command_out, {state, stop, trace});
  Stop stop_out;
  check_refuses_all_but_whole(distinct_stop(), stop_out, {state, command, trace});
  TraceKey key_out;
  check_refuses_all_but_whole(distinct_trace_message(), key_out, {state, command, stop});
}

TEST_CASE("EveryFieldOfAJointCommandIsEncoded") {
  Distinct distinct;
  JointCommand command;
  command.mode = DriveMode::kStop;
  command.num_joints = 5;
  distinct.fill(command.feedforward_torque);
  distinct.fill(command.position);
  distinct.fill(command.velocity);
  distinct.fill(command.kp);
  distinct.fill(command.kd);
  Message bytes;
  encode(kHeader, command, bytes);
  const auto m = whole<stance_msgs::joint_command_t>(bytes);
  check_header(m);
  CHECK(m.mode == 2);
  CHECK(m.num_joints == 5);
  check_elements(command.feedforward_torque, m.feedforward_torque);
  check_elements(command.position, m.position);
  check_elements(command.velocity, m.velocity);
  check_elements(command.kp, m.kp);
  check_elements(command.kd, m.kd);
}

TEST_CASE("EveryFieldOfAForcePlanIsEncoded") {
  Distinct distinct;
  ForcePlan plan;
  plan.num_contacts = 3;
  plan.num_stages = 31;
  distinct.fill(plan.stage_duration);
  for (std::size_t k = 0; k < kMaxPlanStages; ++k) {
    for (std::size_t c = 0; c < kMaxContacts; ++c) {
      plan.contact[k][c] = (k + c) % 3 == 0;
      plan.force[k][c] = distinct.vector();
    }
    plan.p_WC[k] = distinct.vector();
  }
  for (Vector3& p : plan.p_WF) p = distinct.vector();
  plan.effort = distinct.real();
  Message bytes;
  encode(kHeader, plan, bytes);
  const auto m = whole<stance_msgs::force_plan_t>(bytes);
  check_header(m);
  CHECK(m.num_contacts == 3);
  CHECK(m.num_stages == 31);
  for (std::size_t k = 0; k < kMaxPlanStages; ++k) {
    CHECK(m.stage_duration[k] == plan.stage_duration[k]);
    check_elements(plan.p_WC[k], m.p_WC[k]);
    for (std::size_t c = 0; c < kMaxContacts; ++c) {
      CHECK(m.contact[k][c] == (plan.contact[k][c] ? 1 : 0));
      check_elements(plan.force[k][c], m.force[k][c]);
    }
  }
  for (std::size_t c = 0; c < kMaxContacts; ++c) check_elements(plan.p_WF[c], m.p_WF[c]);
  CHECK(m.effort == plan.effort);
}

TEST_CASE("EveryFieldOfAnArmsMotionIsEncoded") {
  Distinct distinct;
  Arm3Motion motion;
  motion.step = distinct.whole();
  motion.time = distinct.real();
  for (Vector3* vector : {&motion.theta, &motion.given_rate, &motion.calculated_rate, &motion.v, &motion.omega,
                          &motion.dp, &motion.dphi}) {
    *vector = distinct.vector();
  }
  for (double& entry : motion.map.reshaped()) entry = distinct.real();
  for (double& entry : motion.jacobian.reshaped()) entry = distinct.real();
  Message bytes;
  encode(kHeader, motion, bytes);
  const auto m = whole<stance_msgs::arm3_motion_t>(bytes);
  check_header(m);
  CHECK(m.step == motion.step);
  CHECK(m.time == motion.time);
  check_elements(motion.theta, m.theta);
  check_elements(motion.given_rate, m.given_rate);
  check_elements(motion.calculated_rate, m.calculated_rate);
  check_elements(motion.v, m.v);
  check_elements(motion.omega, m.omega);
  check_elements(motion.dp, m.dp);
  check_elements(motion.dphi, m.dphi);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) CHECK(m.map_A3[row][column] == motion.map(row, column));
  }
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 3; ++column) CHECK(m.jacobian[row][column] == motion.jacobian(row, column));
  }
}

TEST_CASE("EveryFieldOfATraceIsEncoded") {
  Distinct distinct;
  constexpr Consumed consumed{
      .state_is_new = true, .periods = 3, .user_command_seq = 4, .stop_seq = 5, .hash = 1ULL << 63};
  Trace trace;
  trace.safety = SafetyMode::kDamp;
  trace.faults = 0xA5;
  for (auto& count : trace.fault_count) count = distinct.whole();
  trace.behaviour = Behaviour::kTrack;
  BaseEstimate& e = trace.estimate;
  e.p_WB = distinct.vector();
  const Quaternion q(0.5, -0.1, 0.7, std::sqrt(1.0 - 0.25 - 0.01 - 0.49));
  e.R_WB = q.toRotationMatrix();
  e.v_WB = distinct.vector();
  e.w_WB_W = distinct.vector();
  e.gyro_bias = distinct.vector();
  e.accelerometer_bias = distinct.vector();
  e.sigma_p = distinct.vector();
  e.sigma_v = distinct.vector();
  e.sigma_theta = distinct.vector();
  for (Vector3& p : e.p_WF) p = distinct.vector();
  e.contact = {true, false, false, true};
  e.nis = distinct.real();
  GaitTrace& g = trace.gait;
  g.phase = GaitPhase::kSingleSupport;
  g.swing_foot = 1;
  g.recovering = true;
  g.crossing = -1;
  g.steps = 44;
  g.time = distinct.real();
  g.swing_time = distinct.real();
  g.next_swing_time = distinct.real();
  for (Vector3* v : {&g.foothold, &g.swing_p, &g.swing_v, &g.velocity_wanted}) distinct.fill(*v);
  g.slope = distinct.real();
  distinct.fill(trace.x);
  distinct.fill(trace.x_ref);
  trace.qp_engine = QpEngine::kOsqpSparse;
  trace.qp_status = QpStatus::kInaccurate;
  trace.qp_iterations = 41;
  trace.qp_primal_residual = distinct.real();
  trace.qp_dual_residual = distinct.real();
  trace.qp_active = 42;
  trace.effort = distinct.real();
  trace.torques_clipped = 43;
  Message bytes;
  encode(kHeader, consumed, trace, bytes);
  const auto m = whole<stance_msgs::controller_trace_t>(bytes);
  check_header(m);
  CHECK(m.state_is_new == 1);
  CHECK(m.periods == 3);
  CHECK(m.user_command_seq == 4);
  CHECK(m.stop_seq == 5);
  CHECK(static_cast<std::uint64_t>(m.consumed_hash) == consumed.hash);
  CHECK(m.safety == 2);
  CHECK(m.faults == 0xA5);
  check_elements(trace.fault_count, m.fault_count);
  CHECK(m.behaviour == 3);
  check_elements(e.p_WB, m.p_WB);
  const std::array<double, 4> wxyz{q.w(), q.x(), q.y(), q.z()};
  for (std::size_t i = 0; i < 4; ++i) CHECK(std::abs(m.quat_WB[i] - wxyz[i]) < kQuaternionTolerance);
  check_elements(e.v_WB, m.v_WB);
  check_elements(e.w_WB_W, m.w_WB_W);
  check_elements(e.gyro_bias, m.gyro_bias);
  check_elements(e.accelerometer_bias, m.accelerometer_bias);
  check_elements(e.sigma_p, m.sigma_p);
  check_elements(e.sigma_v, m.sigma_v);
  check_elements(e.sigma_theta, m.sigma_theta);
  for (std::size_t c = 0; c < kMaxContacts; ++c) {
    check_elements(e.p_WF[c], m.p_WF[c]);
    CHECK(m.contact[c] == (e.contact[c] ? 1 : 0));
  }
  CHECK(m.nis == e.nis);
  CHECK(m.gait_phase == stance_msgs::controller_trace_t::SINGLE_SUPPORT);
  CHECK(m.swing_foot == 1);
  CHECK(m.recovering == 1);
  CHECK(m.crossing == -1);
  CHECK(m.steps == 44);
  CHECK(m.gait_time == g.time);
  CHECK(m.swing_time == g.swing_time);
  CHECK(m.next_swing_time == g.next_swing_time);
  check_elements(g.foothold, m.foothold);
  check_elements(g.swing_p, m.swing_p);
  check_elements(g.swing_v, m.swing_v);
  check_elements(g.velocity_wanted, m.velocity_wanted);
  CHECK(m.slope == g.slope);
  check_elements(trace.x, m.x);
  check_elements(trace.x_ref, m.x_ref);
  CHECK(m.qp_engine == 1);
  CHECK(m.qp_status == 5);
  CHECK(m.qp_iterations == 41);
  CHECK(m.qp_primal_residual == trace.qp_primal_residual);
  CHECK(m.qp_dual_residual == trace.qp_dual_residual);
  CHECK(m.qp_active == 42);
  CHECK(m.effort == trace.effort);
  CHECK(m.torques_clipped == 43);

  TraceKey key;
  REQUIRE(decode(bytes.bytes(), key));
  CHECK(key.header.seq == kHeader.seq);
  CHECK(key.consumed.hash == consumed.hash);
}

TEST_CASE("EveryFieldOfATimingIsEncodedAndItsTimeIsTheTicksStart") {
  Distinct distinct;
  Timing timing;
  distinct.fill(timing.stage_us);
  timing.tick_us = distinct.real();
  timing.cpu_us = distinct.real();
  timing.period_us = distinct.real();
  timing.wake_latency_us = distinct.real();
  timing.slack_us = distinct.real();
  timing.state_age_us = distinct.real();
  timing.start_utime = distinct.whole();
  timing.missed_ticks = distinct.whole();
  timing.dropped_states = distinct.whole();
  Message bytes;
  encode(kHeader, timing, bytes);
  const auto m = whole<stance_msgs::controller_timing_t>(bytes);
  CHECK(m.utime == timing.start_utime);
  CHECK(m.seq == kHeader.seq);
  CHECK(m.state_seq == kHeader.state_seq);
  CHECK(m.run_id == kHeader.run_id);
  check_elements(timing.stage_us, m.stage_us);
  CHECK(m.tick_us == timing.tick_us);
  CHECK(m.cpu_us == timing.cpu_us);
  CHECK(m.period_us == timing.period_us);
  CHECK(m.wake_latency_us == timing.wake_latency_us);
  CHECK(m.slack_us == timing.slack_us);
  CHECK(m.state_age_us == timing.state_age_us);
  CHECK(m.missed_ticks == timing.missed_ticks);
  CHECK(m.dropped_states == timing.dropped_states);
}

TEST_CASE("WhatATickWasGivenBesidesComesBack") {
  Message bytes;
  encode(kHeader, 3'500, bytes);
  const auto m = whole<stance_msgs::tick_input_t>(bytes);
  CHECK(m.utime == kHeader.utime);
  CHECK(m.seq == kHeader.seq);
  CHECK(m.state_seq == kHeader.state_seq);
  CHECK(m.run_id == kHeader.run_id);
  CHECK(m.time_left_us == 3'500);
  TickTime input;
  CHECK_FALSE(decode(bytes.bytes().first(bytes.size - 1), input));
  CHECK(input.seq == 0);
  REQUIRE(decode(bytes.bytes(), input));
  CHECK(input.seq == kHeader.seq);
  CHECK(input.time_left_us == 3'500);
}

TEST_CASE("TheTickOfAMessageIsToldOnItsOwnChannelOnly") {
  Message command, plan, motion;
  encode(kHeader, JointCommand{}, command);
  encode(kHeader, ForcePlan{}, plan);
  encode(kHeader, Arm3Motion{}, motion);
  CHECK(tick_of(channel::kJointCommand, command.bytes()) == kHeader.seq);
  CHECK(tick_of(channel::kForcePlan, plan.bytes()) == kHeader.seq);
  CHECK(tick_of(channel::kArm3Motion, motion.bytes()) == kHeader.seq);
  CHECK_FALSE(tick_of(channel::kArm3Motion, plan.bytes()).has_value());
  CHECK_FALSE(tick_of(channel::kForcePlan, command.bytes()).has_value());
  CHECK_FALSE(tick_of(channel::kJointCommand, plan.bytes()).has_value());
  CHECK_FALSE(tick_of(channel::kTrace, command.bytes()).has_value());
  CHECK_FALSE(tick_of(channel::kJointCommand, command.bytes().first(command.size - 1)).has_value());
}

TEST_CASE("TheHashIsFnv1aOf64Bits") {
  CHECK(platform::hash("") == platform::kHashSeed);
  CHECK(platform::hash("a") == 0xaf63dc4c8601ec8cULL);
  CHECK(platform::hash("foobar") == 0x85944171f73967e8ULL);
}

TEST_CASE("TheHashChangesWithEachByteAndChains") {
  const ByteVector bytes = bytes_of(distinct_state());
  std::set<std::uint64_t> seen{platform::hash(bytes)};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    ByteVector changed = bytes;
    changed[i] ^= 1;
    CHECK(seen.insert(platform::hash(changed)).second);
  }
  const Bytes all(bytes);
  CHECK(platform::hash(all.subspan(100), platform::hash(all.first(100))) == platform::hash(all));
}

TEST_CASE("ARunInfoComesBackAndAPartOfOneDoesNot") {
  const RunInfo info{"biped", "--lockstep", "<robot/>", "robot: biped\n"};
  const std::vector<std::uint8_t> bytes = encode(info);
  RunInfo out;
  REQUIRE(decode(bytes, out));
  const auto check_unchanged = [&] {
    CHECK(out.robot == info.robot);
    CHECK(out.options == info.options);
    CHECK(out.urdf == info.urdf);
    CHECK(out.configuration == info.configuration);
  };
  check_unchanged();
  const auto m = decoded<stance_msgs::run_info_t>(bytes);
  CHECK(m.program == "stance-controller");
  CHECK_FALSE(m.version.empty());
  CHECK_FALSE(m.source.empty());
  CHECK_FALSE(m.build.empty());
  CHECK(m.input_hash.size() == 16);
  CHECK(decoded<stance_msgs::run_info_t>(encode({"biped", "", "<robot />", "robot: biped\n"})).input_hash !=
        m.input_hash);

  for (std::size_t size = 0; size < bytes.size(); ++size) CHECK_FALSE(decode(Bytes(bytes.data(), size), out));
  ByteVector longer(bytes);
  longer.push_back(0);
  CHECK_FALSE(decode(longer, out));
  // Each length of a string in turn made impossible; the first stands after the fingerprint and four numbers.
  constexpr std::size_t first_length = 8 + 4 * 8;
  for (const std::uint8_t spoilt : {std::uint8_t{0x00}, std::uint8_t{0x40}}) {
    ByteVector impossible(bytes);
    impossible[first_length] = spoilt;
    impossible[first_length + 3] = 0;
    CHECK_FALSE(decode(impossible, out));
  }
  check_unchanged();
}

}  // namespace stance::io
