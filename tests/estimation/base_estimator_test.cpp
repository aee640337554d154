#include "controller/estimation/base_estimator.hpp"

#include <Eigen/Cholesky>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/estimation/simulated_robot.hpp"

namespace stance::estimation::test {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr double kPeriod = kStateSamples * kSamplePeriod;  // s
constexpr std::uint32_t kSeeds = 6;

// What estimation.md asks.
constexpr double kTiltRms = 6e-3;                  // rad
constexpr double kStandingVelocityRms = 3e-3;      // m/s
constexpr double kWalkingVelocityRms = 6e-3;       // m/s
constexpr double kHeightOverFoot = 1e-3;           // m
constexpr double kOdometry = 0.02;                 // of the path
constexpr double kNeesLow = 0.4, kNeesHigh = 2.0;  // per degree of freedom
constexpr double kExactVelocity = 1e-4;            // m/s, on exact sensors

/// Roll, pitch and velocity: what the controller balances by.
using BalanceVector = Eigen::Matrix<double, 5, 1>;
using BalanceMatrix = Eigen::Matrix<double, 5, 5>;
constexpr std::array<int, 5> kBalance{kTheta, kTheta + 1, kVelocity, kVelocity + 1, kVelocity + 2};

/// Errors over a run.
class Statistics {
 public:
  void add(const BaseState& truth, const BaseEstimator& estimator) {
    // In the heading of each, since no sensor sees the yaw: the controller knows none but its own.
    BaseState aligned = truth;
    const ErrorVector whole = minus(truth, estimator.state());
    const Matrix3 unyaw = math::exp_so3(Vector3(0.0, 0.0, -whole[kTheta + 2]));
    aligned.R_WB = unyaw * truth.R_WB;
    aligned.v_WB = unyaw * truth.v_WB;
    for (Vector3& p_BF_W : aligned.p_BF_W) p_BF_W = unyaw * p_BF_W;
    const ErrorVector error = minus(aligned, estimator.state());

    BalanceVector balance;
    BalanceMatrix P;
    for (int i = 0; i < 5; ++i) {
      balance[i] = error[kBalance[i]];
      for (int j = 0; j < 5; ++j) P(i, j) = estimator.covariance()(kBalance[i], kBalance[j]);
    }
    const Vector3 velocity_error = aligned.v_WB - estimator.state().v_WB;
    tilt_squares += error.head<2>().squaredNorm() / 2.0;
    velocity_squares += velocity_error.squaredNorm() / 3.0;
    max_velocity = std::max(max_velocity, velocity_error.cwiseAbs().maxCoeff());
    max_tilt = std::max(max_tilt, error.head<2>().cwiseAbs().maxCoeff());
    for (int i = 0; i < kFeet; ++i) {
      max_height = std::max(max_height, std::abs(truth.p_BF_W[i].z() - estimator.state().p_BF_W[i].z()));
    }
    nees_sum += balance.dot(P.llt().solve(balance)) / 5.0;
    within_3_sigma += (balance.array().abs() <= 3.0 * P.diagonal().array().sqrt()).cast<double>().mean();
    ++count;
  }
  double tilt_rms() const { return std::sqrt(tilt_squares / count); }
  double velocity_rms() const { return std::sqrt(velocity_squares / count); }
  double nees() const { return nees_sum / count; }
  double share_within_3_sigma() const { return within_3_sigma / count; }

  double tilt_squares = 0.0, velocity_squares = 0.0, nees_sum = 0.0, within_3_sigma = 0.0;
  double max_velocity = 0.0, max_tilt = 0.0, max_height = 0.0;
  int count = 0;
};

template <class Plan>
Statistics run(SimulatedRobot& robot, BaseEstimator& estimator, double seconds, const Plan& plan) {
  Statistics statistics;
  BaseEstimate estimate;
  const double end = robot.time() + seconds;
  while (robot.time() < end - 0.5 * kPeriod) {
    estimator.step(robot.next(), plan(robot.time()), estimate);
    statistics.add(robot.truth(), estimator);
  }
  return statistics;
}

Statistics run(SimulatedRobot& robot, BaseEstimator& estimator, double seconds) {
  return run(robot, estimator, seconds, [](double) { return ContactPlan{}; });
}

/// Steps of 0.32 s, 0.26 s of them in swing, from 1 s on; B bobs, rolls and pitches, and goes at `speed` once it has
/// gathered it.
struct Walk {
  static constexpr double kStart = 1.0, kSwing = 0.26, kDoubleSupport = 0.06, kStep = kSwing + kDoubleSupport;  // s
  double speed;                                                                                                 // m/s

  double x(double t) const { return t < kStart ? 0.0 : speed * (t - kStart - std::tanh(t - kStart)); }
  /// Time since this foot's last lift-off, negative before the first.
  static double phase(double t, int foot) {
    const double since_first = t - kStart - foot * kStep;
    return since_first < 0.0 ? since_first : std::fmod(since_first, 2.0 * kStep);
  }
  static bool swings(double t, int foot) { return phase(t, foot) >= 0.0 && phase(t, foot) < kSwing; }

  Motion motion() const {
    const Walk walk = *this;
    Motion m;
    m.p_WB = [walk](double t) {
      const double fade = 1.0 - std::exp(-t * t);
      return Vector3(walk.x(t), 0.03 * fade * std::sin(M_PI / kStep * t),
                     0.78 + 0.01 * fade * std::cos(2.0 * M_PI / kStep * t));
    };
    m.rpy = [](double t) {
      const double fade = 1.0 - std::exp(-t * t);
      return Vector3(0.03 * fade * std::sin(M_PI / kStep * t), 0.04 * fade * std::sin(2.0 * M_PI / kStep * t), 0.0);
    };
    m.foot = [walk](double t, int foot) {
      if (!swings(t, foot)) return FootMotion{};
      constexpr double kLift = 0.06, kHalfStance = 0.5 * (2.0 * kStep - kSwing);  // m, s
      const double start = t - phase(t, foot);
      const double from = start - kStart - foot * kStep < 0.5 * kStep ? 0.0 : walk.x(start - kHalfStance);
      const double to = walk.x(start + kSwing + kHalfStance);
      const double s = phase(t, foot) / kSwing, r = 1.0 - s;
      const double forward = (to - from) * 30.0 * s * s * r * r / kSwing;
      const double upward = kLift * 192.0 * s * s * r * r * (r - s) / kSwing;
      return FootMotion{false, Vector3(forward, 0.0, upward)};
    };
    return m;
  }
  static ContactPlan plan(double t) {
    ContactPlan plan;
    for (int i = 0; i < kFeet; ++i) {
      plan.stance[i] = !swings(t, i);
      const double to_lift = phase(t, i) < 0.0 ? -phase(t, i) : 2.0 * kStep - phase(t, i);
      plan.load[i] = std::clamp(to_lift / kDoubleSupport, 0.0, 1.0);
    }
    return plan;
  }
};

}  // namespace

TEST_CASE("ExactSensorsGiveAnExactVelocity") {
  SECTION("standing") {
    SimulatedRobot robot(standing_motion(), {}, 1);
    BaseEstimator estimator = shipped_estimator();
    const Statistics s = run(robot, estimator, 20.0);
    CHECK(s.max_velocity < kExactVelocity);
    CHECK(s.max_tilt < 1e-5);
    CHECK((robot.truth().p_WB - estimator.state().p_WB).norm() < 1e-4);
  }
  SECTION("walking") {
    SimulatedRobot robot(Walk{0.4}.motion(), {}, 1);
    BaseEstimator estimator = shipped_estimator();
    const Statistics s = run(robot, estimator, 20.0, Walk::plan);
    CHECK(s.max_velocity < 5e-3);
    CHECK(s.velocity_rms() < 1e-3);
    CHECK(s.max_tilt < 1e-3);
  }
}

TEST_CASE("ConsumerSensorsGiveWhatTheSheetAsksWhileStanding") {
  double nees = 0.0, tilt_squares = 0.0;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    SimulatedRobot robot(standing_motion(), consumer_sensors(), seed);
    BaseEstimator estimator = shipped_estimator();
    run(robot, estimator, 1.0);
    const Statistics s = run(robot, estimator, 59.0);
    INFO("seed " << seed);
    tilt_squares += s.tilt_rms() * s.tilt_rms() / kSeeds;
    CHECK(s.velocity_rms() < kStandingVelocityRms);
    CHECK(s.share_within_3_sigma() > 0.99);
    CHECK(s.nees() < kNeesHigh);
    nees += s.nees() / kSeeds;

    // The gyro's bias: about the horizontal axes gravity tells it, about the vertical only the feet, slowly.
    const Vector3 bias_error = robot.truth().gyro_bias - estimator.state().gyro_bias;
    for (int i = 0; i < 3; ++i) {
      CHECK(std::abs(bias_error[i]) < 3.0 * std::sqrt(estimator.covariance()(kGyroBias + i, kGyroBias + i)));
    }
    CHECK(bias_error.head<2>().cwiseAbs().maxCoeff() < 4e-4);
  }
  CHECK(std::sqrt(tilt_squares) < kTiltRms);
  CHECK(nees > kNeesLow);
  CHECK(nees < kNeesHigh);
}

TEST_CASE("ConsumerSensorsGiveWhatTheSheetAsksWhileWalking") {
  double nees = 0.0, tilt_squares = 0.0;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    SimulatedRobot robot(Walk{0.4}.motion(), consumer_sensors(), seed);
    BaseEstimator estimator = shipped_estimator();
    run(robot, estimator, 2.0, Walk::plan);
    const Vector3 true_start = robot.truth().p_WB, start = estimator.state().p_WB;
    const Statistics s = run(robot, estimator, 58.0, Walk::plan);
    INFO("seed " << seed);
    tilt_squares += s.tilt_rms() * s.tilt_rms() / kSeeds;
    CHECK(s.velocity_rms() < kWalkingVelocityRms);
    CHECK(s.nees() < kNeesHigh);
    nees += s.nees() / kSeeds;
    const double true_path = (robot.truth().p_WB - true_start).norm(), path = (estimator.state().p_WB - start).norm();
    CHECK(std::abs(path - true_path) < kOdometry * true_path);
  }
  CHECK(std::sqrt(tilt_squares) < kTiltRms);
  CHECK(nees > kNeesLow);
  CHECK(nees < kNeesHigh);
}

TEST_CASE("FarFromItsStartThePositionGoesOnAsSmoothlyAsTheVelocity") {
  constexpr double kSmooth = 2e-3;  // m, of a control period: what a foothold in W may jump by
  SimulatedRobot robot(Walk{1.0}.motion(), consumer_sensors(), 1);
  BaseEstimator estimator = shipped_estimator();
  run(robot, estimator, 60.0, Walk::plan);
  double largest = 0.0;
  for (int k = 0; k < 500; ++k) {
    const BaseState before = estimator.state();
    run(robot, estimator, kControlPeriod, Walk::plan);
    const BaseState& after = estimator.state();
    const Vector3 path = 0.5 * kControlPeriod * (before.v_WB + after.v_WB);
    largest = std::max(largest, (after.p_WB - before.p_WB - path).norm());
  }
  CHECK(largest < kSmooth);
}

TEST_CASE("HeightOverTheFeetIsWithinAMillimetreOnCalibratedEncoders") {
  SensorErrors errors = consumer_sensors();
  errors.encoder_offset = 0.0;
  errors.accelerometer_bias = 0.0;
  SimulatedRobot robot(standing_motion(), errors, 1);
  BaseEstimator estimator = shipped_estimator();
  run(robot, estimator, 1.0);
  CHECK(run(robot, estimator, 30.0).max_height < kHeightOverFoot);
}

TEST_CASE("StatedYawSigmaGrowsWithTheYawsError") {
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    SimulatedRobot robot(standing_motion(), consumer_sensors(), seed);
    BaseEstimator estimator = shipped_estimator();
    run(robot, estimator, 60.0);
    const double yaw_error = minus(robot.truth(), estimator.state())[kTheta + 2];
    CHECK(std::abs(yaw_error) < 3.0 * std::sqrt(estimator.covariance()(kTheta + 2, kTheta + 2)));
  }
}

/// rad, by which the heading's error grows in a walk of 30 s on an exact gyro and offset encoders.
double drift_of_heading(double standing_time) {
  SensorErrors offsets;
  offsets.encoder_offset = 0.01;
  SimulatedRobot robot(Walk{0.4}.motion(), offsets, 2);
  BaseEstimatorConfig config = shipped_biped().estimator;
  config.standing_time = standing_time;
  BaseEstimator estimator(config, shipped_biped().legs, shipped_biped().foot_radius);
  run(robot, estimator, Walk::kStart, Walk::plan);
  const double before = minus(robot.truth(), estimator.state())[kTheta + 2];
  run(robot, estimator, 30.0, Walk::plan);
  return std::abs(minus(robot.truth(), estimator.state())[kTheta + 2] - before);
}

TEST_CASE("StepsOnOffsetEncodersHardlyTurnTheHeading") {
  const double drift = drift_of_heading(shipped_biped().estimator.standing_time);
  const double drift_where_every_step_tells_it = drift_of_heading(1e-3);
  CHECK(drift < 0.4 * drift_where_every_step_tells_it);
  CHECK(drift < 0.01);
}

TEST_CASE("WalkingLeavesTheGyrosBiasAboutTheVerticalAlone") {
  SimulatedRobot robot(Walk{0.4}.motion(), consumer_sensors(), 1);
  BaseEstimator estimator = shipped_estimator();
  run(robot, estimator, Walk::kStart + Walk::kSwing, Walk::plan);
  const Vector3 bias = estimator.state().gyro_bias;
  run(robot, estimator, 10.0, Walk::plan);
  CHECK(estimator.state().gyro_bias.z() == bias.z());
  CHECK(estimator.state().gyro_bias.x() != bias.x());
}

TEST_CASE("FeetThatRollAreMistakenForMotionOfTheTrunkWithoutTheRollingTerm") {
  Motion motion = standing_motion(0.0);
  motion.rpy = [](double t) { return Vector3(0.0, 0.15 * std::sin(4.0 * t) * (1.0 - std::exp(-t * t)), 0.0); };
  SimulatedRobot robot(motion, {}, 1), same(motion, {}, 1);
  BaseEstimator rolling = shipped_estimator();
  BaseEstimator gliding(shipped_biped().estimator, shipped_biped().legs, 0.0);
  CHECK(run(robot, rolling, 10.0).max_velocity < kExactVelocity);
  CHECK(run(same, gliding, 10.0).max_velocity > 50.0 * kExactVelocity);
}

/// The right foot slides forward for 0.4 s while the robot stands.
struct Slip {
  static constexpr double kStart = 5.0, kEnd = 5.4;  // s
  static Motion motion(double speed) {
    Motion motion = standing_motion();
    motion.foot = [speed](double t, int foot) {
      FootMotion result;
      if (foot == 1 && t > kStart && t < kEnd) result.velocity.x() = speed;
      return result;
    };
    return motion;
  }
};

TEST_CASE("FootThatSlipsIsRefusedAndDragsNothing") {
  constexpr double kDrag = 0.012;  // m/s
  for (const double speed : {0.15, 0.4}) {
    for (const bool noisy : {false, true}) {
      CAPTURE(speed, noisy);
      SimulatedRobot robot(Slip::motion(speed), noisy ? consumer_sensors() : SensorErrors{}, 3);
      BaseEstimator estimator = shipped_estimator();
      run(robot, estimator, Slip::kStart);
      const double tilt_before = run(robot, estimator, kPeriod).max_tilt;
      Statistics slip;
      while (robot.time() < Slip::kEnd - kPeriod) {
        const Statistics s = run(robot, estimator, kPeriod);
        slip.max_velocity = std::max(slip.max_velocity, s.max_velocity);
        slip.max_tilt = std::max(slip.max_tilt, s.max_tilt);
        CHECK(estimator.slipping(1));
        CHECK_FALSE(estimator.slipping(0));
      }
      CHECK(slip.max_velocity < kDrag);
      CHECK(slip.max_tilt < tilt_before + 1e-3);
      run(robot, estimator, 0.2);
      const Statistics after = run(robot, estimator, 2.0);
      CHECK_FALSE(estimator.slipping(1));
      CHECK(after.max_velocity < (noisy ? kDrag : 2e-3));
      // The foot stands anew where it came to rest.
      CHECK((robot.truth().p_BF_W[1] - estimator.state().p_BF_W[1]).norm() < (noisy ? 0.02 : 1e-3));
    }
  }
}

TEST_CASE("FootThatCreepsTooSlowlyForTheGateTiltsTheTrunkByLessThanFiveMillirad") {
  constexpr double kTilt = 5e-3;  // rad
  for (double speed = 0.01; speed < 0.15; speed += 0.01) {
    CAPTURE(speed);
    SimulatedRobot robot(Slip::motion(speed), {}, 1);
    BaseEstimator estimator = shipped_estimator();
    run(robot, estimator, Slip::kStart);
    CHECK(run(robot, estimator, 3.0).max_tilt < kTilt);
  }
}

TEST_CASE("VelocityThatBothFeetDenyIsForgottenAfterTheTimeout") {
  for (const double blow : {20.0, 50.0, 100.0}) {  // m/s^2, felt for one period by the accelerometer alone
    CAPTURE(blow);
    SimulatedRobot robot(standing_motion(), {}, 1);
    BaseEstimator estimator = shipped_estimator();
    run(robot, estimator, 5.0);
    BaseEstimate estimate;
    RobotState hit = robot.next();
    for (SensorSample& sample : hit.samples) sample.accelerometer.x() += blow;
    estimator.step(hit, {}, estimate);
    CHECK((robot.truth().v_WB - estimate.v_WB).norm() > 0.8 * blow * kPeriod);
    CHECK(estimator.slipping(0));
    CHECK(estimator.slipping(1));
    run(robot, estimator, shipped_biped().estimator.slip_timeout + kPeriod);
    const Statistics after = run(robot, estimator, 1.0);
    CHECK_FALSE(estimator.slipping(0));
    CHECK_FALSE(estimator.slipping(1));
    CHECK(after.max_velocity < 0.02);
    CHECK(after.max_tilt < 5e-3);
  }
}

TEST_CASE("BlowThatTheFeetDoNotDenyTiltsTheTrunkByAHundredthOfARadian") {
  constexpr double kTilt = 0.01;                       // rad
  for (double blow = 2.0; blow < 20.0; blow *= 1.1) {  // m/s^2, felt for one period by the accelerometer alone
    CAPTURE(blow);
    SimulatedRobot robot(standing_motion(), {}, 1);
    BaseEstimator estimator = shipped_estimator();
    run(robot, estimator, 3.0);
    BaseEstimate estimate;
    RobotState hit = robot.next();
    for (SensorSample& sample : hit.samples) sample.accelerometer.x() += blow;
    estimator.step(hit, {}, estimate);
    CHECK(run(robot, estimator, 1.0).max_tilt < kTilt);
  }
}

TEST_CASE("StartsFromATiltedRest") {
  Motion motion = standing_motion(0.0);
  const Vector3 rpy(0.06, -0.09, 0.0);
  motion.rpy = [rpy](double) { return rpy; };
  SimulatedRobot robot(motion, {}, 1);
  BaseEstimator estimator = shipped_estimator();
  CHECK_FALSE(estimator.initialised());
  BaseEstimate estimate;
  const RobotState& state = robot.next();
  estimator.initialise(state);
  CHECK(estimator.initialised());
  estimator.step(state, {}, estimate);
  constexpr double kTolerance = 1e-9;
  CHECK((math::rpy_from_rotation(estimate.R_WB) - rpy).norm() < kTolerance);
  CHECK((estimate.p_WB - robot.truth().p_WB).norm() < kTolerance);
  CHECK(std::abs(estimate.p_WF[0].z() - shipped_biped().foot_radius) < kTolerance);
  CHECK((estimate.p_WF[0] + estimate.p_WF[1]).head<2>().norm() < kTolerance);
  CHECK(estimate.v_WB.norm() < kTolerance);
  CHECK(estimate.w_WB_W.norm() < kTolerance);
}

TEST_CASE("GroundIsUnderTheFootThatIsOn") {
  SimulatedRobot robot(standing_motion(0.0), {}, 1);
  RobotState state = robot.next();
  // The right leg is drawn up and bears nothing.
  for (SensorSample& sample : state.samples) {
    sample.contact_switch[1] = false;
    sample.joint_position[5] -= 0.3;
    sample.joint_position[6] += 0.6;
  }
  BaseEstimator estimator = shipped_estimator();
  BaseEstimate estimate;
  estimator.step(state, {}, estimate);
  CHECK(std::abs(estimate.p_WF[0].z() - shipped_biped().foot_radius) < 1e-6);
  CHECK(estimate.p_WF[1].z() > shipped_biped().foot_radius + 0.01);
  CHECK(std::abs(estimate.p_WF[0].y() + estimate.p_WF[1].y()) < 1e-6);
  CHECK(estimate.contact[0]);
  CHECK_FALSE(estimate.contact[1]);
}

TEST_CASE("ContactNeedsTheSwitchAndThePlan") {
  SimulatedRobot robot(standing_motion(0.0), {}, 1);
  BaseEstimator estimator = shipped_estimator();
  BaseEstimate estimate;
  ContactPlan plan;
  plan.stance = {true, false};
  estimator.step(robot.next(), plan, estimate);
  CHECK(estimate.contact[0]);
  CHECK_FALSE(estimate.contact[1]);
}

TEST_CASE("SwingFootsPositionIsWhereTheJointsPutIt") {
  SimulatedRobot robot(Walk{0.4}.motion(), {}, 1);
  BaseEstimator estimator = shipped_estimator();
  BaseEstimate estimate;
  for (int k = 0; k < 500; ++k) {
    estimator.step(robot.next(), Walk::plan(robot.time()), estimate);
    for (int i = 0; i < kFeet; ++i) {
      if (estimate.contact[i]) continue;
      const Vector3 p_BF = estimate.R_WB.transpose() * (estimate.p_WF[i] - estimate.p_WB);
      CHECK((p_BF - robot.truth().R_WB.transpose() * robot.truth().p_BF_W[i]).norm() < 2e-4);
    }
  }
}

TEST_CASE("LostStatesAreBridged") {
  constexpr int kLost = 3;
  SimulatedRobot robot(standing_motion(), {}, 1);
  BaseEstimator estimator = shipped_estimator();
  run(robot, estimator, 10.3);
  for (int k = 0; k < kLost; ++k) robot.next();
  const Statistics after = run(robot, estimator, kPeriod);
  CHECK(after.max_velocity < 5e-3);
  CHECK(after.max_tilt < 1e-3);
  CHECK((robot.truth().p_WB - estimator.state().p_WB).norm() < 1e-3);
}

TEST_CASE("UtimeThatJumpsIsBridgedForABoundedTime") {
  SimulatedRobot robot(standing_motion(), {}, 1);
  BaseEstimator estimator = shipped_estimator();
  run(robot, estimator, 1.0);
  RobotState state = robot.next();
  state.utime = std::numeric_limits<std::int64_t>::max();
  BaseEstimate estimate;
  estimator.step(state, {}, estimate);
  state.utime = 0;
  state.sample_period = 0.0;
  estimator.step(state, {}, estimate);
  CHECK(estimate.R_WB.allFinite());
  CHECK(estimate.v_WB.norm() < 1.0);
}

TEST_CASE("SameInputGivesTheSameBits") {
  SimulatedRobot robot(Walk{0.4}.motion(), consumer_sensors(), 5);
  BaseEstimator one = shipped_estimator(), other = shipped_estimator();
  BaseEstimate a, b;
  for (int k = 0; k < 300; ++k) {
    const RobotState& state = robot.next();
    one.step(state, Walk::plan(robot.time()), a);
    other.step(state, Walk::plan(robot.time()), b);
  }
  CHECK(a.R_WB == b.R_WB);
  CHECK(a.p_WB == b.p_WB);
  CHECK(a.v_WB == b.v_WB);
  CHECK(a.nis == b.nis);
  CHECK(one.covariance() == other.covariance());
}

TEST_CASE("RotationAndCovarianceStaySoundOverMinutes") {
  SimulatedRobot robot(standing_motion(), consumer_sensors(), 2);
  BaseEstimator estimator = shipped_estimator();
  run(robot, estimator, 200.0);
  const Matrix3& R = estimator.state().R_WB;
  CHECK((R * R.transpose() - Matrix3::Identity()).norm() < 1e-14);
  CHECK(estimator.covariance().llt().info() == Eigen::Success);
}

TEST_CASE("EstimatorsConfigNamesTheFieldThatIsWrong") {
  BaseEstimatorConfig config = shipped_biped().estimator;
  config.slip_gate = -3.0;
  CHECK_THROWS_WITH(config.validate(), ContainsSubstring("slip_gate = -3"));
  config = shipped_biped().estimator;
  config.foot_position_sigma = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(BaseEstimator(config, shipped_biped().legs, shipped_biped().foot_radius),
                    ContainsSubstring("foot_position_sigma"));
}

}  // namespace stance::estimation::test
