#pragma once
// The plain structs that cross the controller's edge, as the messages of lcmtypes/: fields, frames and units are
// theirs. Fixed sizes, so that nothing allocates; `num_joints` and `num_contacts` say how much is in use.
#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "controller/math/so3.hpp"

namespace stance {

inline constexpr int kMaxJoints = 8;
inline constexpr int kMaxContacts = 4;
inline constexpr int kStateSamples = 2;    ///< sensor samples in one RobotState
inline constexpr int kMaxPlanStages = 32;  ///< published stages of a force plan
inline constexpr int kMaxCalibrationPoints = 64;
inline constexpr double kControlPeriod = 0.01;  ///< s, dt of the loop and of the centroidal model

using JointVector = Eigen::Matrix<double, kMaxJoints, 1>;  ///< entries past num_joints are zero

using ContactFlags = std::array<bool, kMaxContacts>;
using ContactVectors = std::array<Vector3, kMaxContacts>;
/// All zero (Eigen's vectors are not, by default).
inline ContactVectors zero_contact_vectors() {
  ContactVectors zeros;
  zeros.fill(Vector3::Zero());
  return zeros;
}

/// What the sensors say over one part of a control period.
struct SensorSample {
  Vector3 gyro = Vector3::Zero();                    ///< rad/s, in B, mean over the sample
  Vector3 accelerometer = Vector3::Zero();           ///< m/s^2, specific force at B's origin in B, mean over the sample
  JointVector joint_position = JointVector::Zero();  ///< rad, at the sample's end
  JointVector joint_velocity = JointVector::Zero();  ///< rad/s, mean over the sample
  std::array<bool, kMaxContacts> contact_switch{};   ///< at the sample's end
};

struct RobotState {
  std::int64_t utime = 0;  ///< us, end of the last sample
  std::int64_t seq = 0;
  std::int64_t run_id = 0;
  int num_joints = 0;
  int num_contacts = 0;
  double sample_period = 0.0;                         ///< s
  std::array<SensorSample, kStateSamples> samples{};  ///< oldest first
  JointVector joint_torque = JointVector::Zero();     ///< N m, mean over the period

  const SensorSample& now() const { return samples.back(); }
};

/// Is `state` of another run than the one before it, of `run_id` and `seq`? A sender that starts again counts from 1.
inline bool starts_run(std::int64_t run_id, std::int64_t seq, const RobotState& state) {
  return state.run_id != run_id || (state.seq == 1 && seq > 1);
}

enum class Behaviour : std::int8_t { kStand = 0, kWalk = 1, kLieDown = 2, kTrack = 3, kCatch = 4, kTrackSmooth = 5 };

struct UserCommand {
  std::int64_t utime = 0;
  std::int64_t seq = 0;
  Behaviour behaviour = Behaviour::kStand;
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();  ///< m/s, in H
  double yaw_rate = 0.0;                               ///< rad/s
  double height_offset = 0.0;                          ///< m
};

/// A ball as the camera sees it.
struct BallObservation {
  std::int64_t utime = 0;  ///< us, of the exposure
  std::int64_t seq = 0;
  std::int64_t run_id = 0;
  bool valid = false;             ///< the camera saw a ball
  Vector3 p_K = Vector3::Zero();  ///< m, its centre in the camera frame K
};

/// Pairs of points that calibrate the camera against the arm's base A.
struct CalibrationPoints {
  std::int64_t utime = 0;
  std::int64_t seq = 0;
  std::int64_t run_id = 0;
  int num_points = 0;
  std::array<Vector3, kMaxCalibrationPoints> p_K;  ///< m
  std::array<Vector3, kMaxCalibrationPoints> p_A;  ///< m

  CalibrationPoints() {
    p_K.fill(Vector3::Zero());
    p_A.fill(Vector3::Zero());
  }
};

enum class DriveMode : std::int8_t { kActive = 0, kDamp = 1, kStop = 2 };

/// torque = feedforward_torque + kp (position - q) + kd (velocity - qd), closed by the drives.
struct JointCommand {
  DriveMode mode = DriveMode::kDamp;
  int num_joints = 0;
  JointVector feedforward_torque = JointVector::Zero();  ///< N m
  JointVector position = JointVector::Zero();            ///< rad
  JointVector velocity = JointVector::Zero();            ///< rad/s
  JointVector kp = JointVector::Zero();                  ///< N m/rad
  JointVector kd = JointVector::Zero();                  ///< N m s/rad
};

/// The forces of the QP and the path that they are predicted to give.
struct ForcePlan {
  int num_contacts = 0;
  int num_stages = 0;
  std::array<double, kMaxPlanStages> stage_duration{};  ///< s
  std::array<ContactFlags, kMaxPlanStages> contact{};
  ContactVectors p_WF = zero_contact_vectors();      ///< m, where the forces of stage 0 act
  std::array<ContactVectors, kMaxPlanStages> force;  ///< N, of the ground on the robot, in W
  std::array<Vector3, kMaxPlanStages> p_WC;          ///< m, predicted, at each stage's end
  double effort = 0.0;                               ///< ||f||_R of stage 0

  ForcePlan() {
    force.fill(zero_contact_vectors());
    p_WC.fill(Vector3::Zero());
  }
};

enum class SafetyMode : std::int8_t { kRun = 0, kHold = 1, kDamp = 2, kStop = 3 };

/// Bits of Trace::faults and indices of Trace::fault_count.
enum class Fault : int {
  kStateStale = 0,
  kStateInvalid = 1,
  kCommandInvalid = 2,
  kQpFailed = 3,
  kRobotFallen = 4,
  kOperatorStop = 5,
  kTorqueSaturated = 6,
  kJointLimit = 7,
};
inline constexpr int kNumFaults = 8;

enum class QpStatus : std::int8_t {
  kNotRun = 0,
  kSolved = 1,
  kMaxIterations = 2,
  kInfeasible = 3,
  kInvalidProblem = 4,
  kInaccurate = 5,
};
enum class QpEngine : std::int8_t { kOsqpCondensed = 0, kOsqpSparse = 1, kStructured = 2 };

using CentroidalState = Eigen::Matrix<double, 12, 1>;  ///< (roll pitch yaw, p_WC, omega_W, v_WC)

/// The base's state, estimated from the robot's own sensors.
struct BaseEstimate {
  Vector3 p_WB = Vector3::Zero();
  Matrix3 R_WB = Matrix3::Identity();
  Vector3 v_WB = Vector3::Zero();
  Vector3 w_WB_W = Vector3::Zero();
  Vector3 gyro_bias = Vector3::Zero();
  Vector3 accelerometer_bias = Vector3::Zero();
  Vector3 sigma_p = Vector3::Zero();
  Vector3 sigma_v = Vector3::Zero();
  Vector3 sigma_theta = Vector3::Zero();
  ContactVectors p_WF = zero_contact_vectors();  ///< foot tips
  ContactFlags contact{};                        ///< believed to bear load
  double nis = 0.0;                              ///< per degree of freedom, mean over the last step's updates
};

enum class GaitPhase : std::int8_t { kStanding = 0, kDoubleSupport = 1, kSingleSupport = 2 };

/// What the gait is doing; all 0 while there is none.
struct GaitTrace {
  GaitPhase phase = GaitPhase::kStanding;
  int swing_foot = 0;  ///< the foot that swings, or will next
  bool recovering = false;
  int crossing = 0;              ///< of the foothold: 1 in front of the standing foot to its other side, -1 behind it
  int steps = 0;                 ///< touchdowns since the gait began
  double time = 0.0;             ///< s, since the phase began
  double swing_time = 0.0;       ///< s, planned, of this swing or the next
  double next_swing_time = 0.0;  ///< s, planned, of the one after
  Vector3 foothold = Vector3::Zero();         ///< m, in W, planned, of this swing's foot tip
  Vector3 swing_p = Vector3::Zero();          ///< m, in W, reference of the swing foot's tip
  Vector3 swing_v = Vector3::Zero();          ///< m/s
  Vector3 velocity_wanted = Vector3::Zero();  ///< m/s, m/s, rad/s in the heading, ramped
  double slope = 0.0;                         ///< rise of the ground over way, forward
};

/// All that a tick decided; what it consumed stands beside it (loop/).
struct Trace {
  SafetyMode safety = SafetyMode::kRun;
  std::uint32_t faults = 0;
  std::array<std::int64_t, kNumFaults> fault_count{};
  Behaviour behaviour = Behaviour::kStand;
  BaseEstimate estimate;
  GaitTrace gait;
  CentroidalState x = CentroidalState::Zero();
  CentroidalState x_ref = CentroidalState::Zero();
  QpEngine qp_engine = QpEngine::kOsqpCondensed;
  QpStatus qp_status = QpStatus::kNotRun;
  int qp_iterations = 0;
  double qp_primal_residual = 0.0;
  double qp_dual_residual = 0.0;
  int qp_active = 0;
  double effort = 0.0;
  int torques_clipped = 0;
};

/// One step of the 3-joint arm's motion, as document 004 prints it; all in the arm's base frame A.
struct Arm3Motion {
  std::int64_t step = 0;                      ///< of the motion that is played: 1, 2, ...; 0 while there is none
  double time = 0.0;                          ///< s, from the motion's beginning to this instant
  Vector3 theta = Vector3::Zero();            ///< rad, at this instant, integrated
  Vector3 given_rate = Vector3::Zero();       ///< rad/s, what is played
  Vector3 calculated_rate = Vector3::Zero();  ///< rad/s, recovered from (v, omega)
  Vector3 v = Vector3::Zero();                ///< m/s, of the end effector
  Vector3 omega = Vector3::Zero();            ///< rad/s, the same
  Vector3 dp = Vector3::Zero();               ///< m, in this step
  Vector3 dphi = Vector3::Zero();             ///< rad, in this step
  Eigen::Matrix4d map = Eigen::Matrix4d::Identity();  ///< T_A3 after it, kept by velocities alone
  Eigen::Matrix<double, 6, 3> jacobian =
      Eigen::Matrix<double, 6, 3>::Zero();  ///< (v, omega) = J thetad at this instant
};

/// The ball as the filter has it, in the arm's base frame A.
struct BallEstimate {
  bool updated = false;    ///< an observation came in this tick
  std::int64_t utime = 0;  ///< us, of the observation
  std::int64_t observation_seq = 0;
  Vector3 p_A = Vector3::Zero();                                                 ///< m
  Vector3 v_A = Vector3::Zero();                                                 ///< m/s
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  ///< of (p, v)
  double nis = 0.0;  ///< of that observation, per degree of freedom; NaN where nothing was compared
};

enum class CatchPhase : std::int8_t { kUncalibrated = 0, kWaiting = 1, kCatching = 2, kHolding = 3, kReturning = 4 };
enum class CatchStatus : std::int8_t { kNone = 0, kPlanned = 1, kTime = 2, kReach = 3 };
enum class CalibrationState : std::int8_t {
  kNone = 0,
  kCalibrated = 1,
  kUnequal = 2,
  kTooFew = 3,
  kTooMany = 4,
  kNotFinite = 5,
  kDegenerate = 6,
  kTooRough = 7,
};

/// What the catcher means to do about the ball, in the arm's base frame A.
struct CatchPlan {
  CatchPhase phase = CatchPhase::kUncalibrated;
  CalibrationState calibration = CalibrationState::kNone;
  double calibration_rms = 0.0;  ///< m, of the last points
  CatchStatus status = CatchStatus::kNone;
  bool committed = false;
  std::int64_t catch_utime = 0;             ///< us, when ball and cup meet
  Vector3 p_ABall = Vector3::Zero();        ///< m, where the ball will be then
  Vector3 p_ACup = Vector3::Zero();         ///< m, where the cup's centre will be
  Vector3 axis_ACup = Vector3::Zero();      ///< the cup's axis then
  JointVector q = JointVector::Zero();      ///< rad
  double slack = 0.0;                       ///< s, left less needed
  JointVector q_ref = JointVector::Zero();  ///< rad, the joints' reference for this tick's command
  JointVector v_ref = JointVector::Zero();  ///< rad/s
  std::int64_t observations = 0;            ///< of this ball, believed
  std::int64_t rejected = 0;                ///< of the run, not believed
};

/// What a tick is given. Everything that a decision may depend on is here, so that a log of it replays bit for bit.
struct TickInput {
  RobotState state;                   ///< the newest, as it came: not yet validated
  bool state_is_new = false;          ///< not given to an earlier tick
  int periods = 1;                    ///< control periods since the last tick: more than 1 after a miss
  double time_left = kControlPeriod;  ///< s, from the tick's start to the next one's deadline, on a grid
  UserCommand user_command;           ///< the newest, as it came; seq 0 before the first
  bool operator_stop = false;         ///< a stop_t has arrived in this run
  BallObservation ball;               ///< the newest, as it came; seq 0 before the first
  bool ball_is_new = false;           ///< not given to an earlier tick
  CalibrationPoints calibration;      ///< the newest, as they came; seq 0 before the first
};

/// Each robot fills what it publishes (loop::Controller), and the command and the trace.
struct TickOutput {
  JointCommand command;
  ForcePlan plan;
  Arm3Motion arm3_motion;
  BallEstimate ball;
  CatchPlan catching;
  Trace trace;
};

/// Stages of a tick, in order: what the loop's `stamp` is told.
enum class Stage : int { kDecode, kValidate, kEstimate, kPlan, kModel, kForceQp, kTorque, kSafety, kEncode };
inline constexpr int kNumStages = 9;

/// Called at the end of each stage; the loop supplies it, so that no module reads the clock.
class StageClock {
 public:
  virtual ~StageClock() = default;
  virtual void stamp(Stage stage) noexcept = 0;
};

}  // namespace stance
