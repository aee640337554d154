#include "controller/planning/interception.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "controller/interface/require.hpp"

namespace stance::planning {
namespace {

constexpr int kJoints = 5;
constexpr double kStaysCommitted = 1.5;  // of `commit`: an estimate that moves the meeting a little starts no new plan

Vector3 acceleration(double drag, const Vector3& v) noexcept {
  return Vector3(0.0, 0.0, -kGravity) - drag * v.norm() * v;
}

JointVector joints_of(const kinematics::Arm5Vector& t) noexcept {
  JointVector q = JointVector::Zero();
  q.head<kJoints>() = t;
  return q;
}

/// Motion between two postures by the joint that it takes longest [s].
double motion_between(const JointMotionLimits& limits, const JointVector& from, const JointVector& to) noexcept {
  return ((to - from).head<kJoints>().array() / limits.speed.head<kJoints>().array()).abs().maxCoeff();
}

}  // namespace

void InterceptionConfig::validate() const {
  const Require require{"planner."};
  const auto at_least = [&](double value, const char* field, double least, const char* range) {
    require(std::isfinite(value) && value >= least, field, value, range);
  };
  at_least(earliest, "earliest", kControlPeriod, "at least 0.01 s");
  require(latest > earliest && latest <= 5.0, "latest", latest, "above earliest, at most 5 s");
  require(step >= 0.001 && step <= 0.1, "step", step, "in 0.001..0.1 s");
  require(pitch_offsets[0] == 0.0, "pitch_offsets' first", pitch_offsets[0], "0 rad");
  for (const double offset : pitch_offsets) {
    require(std::abs(offset) < 1.5, "pitch_offsets", offset, "within 1.5 rad of zero");
  }
  require(std::isfinite(min_height), "min_height", min_height, "finite");
  require(limit_margin >= 0.0 && limit_margin < 0.2, "limit_margin", limit_margin, "in 0..0.2 rad");
  require(reach_slack >= 0.0 && reach_slack <= 0.2, "reach_slack", reach_slack, "in 0..0.2 m");
  at_least(commit, "commit", 0.0, "at least 0 s");
  at_least(spare_time, "spare_time", 0.0, "at least 0 s");
  require(max_facing > 0.0 && max_facing < 1.5, "max_facing", max_facing, "in 0..1.5 rad");
  at_least(facing_cost, "facing_cost", 0.0, "at least 0");
  at_least(turned_away_cost, "turned_away_cost", 0.0, "at least 0");
  at_least(lateness_cost, "lateness_cost", 0.0, "at least 0");
  at_least(reach_cost, "reach_cost", 0.0, "at least 0");
  at_least(time_change_cost, "time_change_cost", 0.0, "at least 0");
  at_least(posture_change_cost, "posture_change_cost", 0.0, "at least 0");
}

void BallState::coast(double dt) noexcept {
  const Vector3 v_m = v_A + 0.5 * dt * acceleration(drag, v_A);
  p_A += dt * v_m;
  v_A += dt * acceleration(drag, v_m);
}

double BallState::coast_to_nearest(const Vector3& point_A, double from, double to) noexcept {
  constexpr double longest = 0.02, soon = 1e-9;  // s: of a step, and of one that is none
  constexpr int most = 200;                      // steps
  double t = 0.0;
  for (int i = 0; i < most; ++i) {
    // On a straight way it would be nearest after this.
    const double left = (point_A - p_A).dot(v_A) / std::max(v_A.squaredNorm(), 1e-9);
    const double dt =
        std::clamp(left, std::min(std::max(from - t, -longest), 0.0), std::max(std::min(to - t, longest), 0.0));
    if (!(std::abs(dt) > soon)) break;
    coast(dt);
    t += dt;
  }
  return t;
}

Eigen::Matrix<double, 2, 3> BallState::across() const noexcept {
  const double speed = v_A.norm();
  const Vector3 along = speed > 0.0 ? Vector3(v_A / speed) : Vector3::UnitX();
  const Vector3 first = along.unitOrthogonal();
  Eigen::Matrix<double, 2, 3> D;
  D << first.transpose(), along.cross(first).transpose();
  return D;
}

Interception::Interception(const InterceptionConfig& config, const kinematics::Arm5Geometry& arm,
                           const JointMotionLimits& motion_limits)
    : config_(config),
      arm_(arm),
      limits_{motion_limits.lower.head<kJoints>(), motion_limits.upper.head<kJoints>()},
      motion_limits_(motion_limits),
      farthest_(std::hypot(std::abs(arm.a1) + arm.a2 + arm.a3 + std::abs(arm.d5), arm.d2) + config.reach_slack) {
  config_.validate();
  for (int i = 0; i < kJoints; ++i) {
    if (!(std::isfinite(limits_.lower(i)) && std::isfinite(limits_.upper(i)) && limits_.lower(i) < limits_.upper(i))) {
      throw std::invalid_argument("joint " + std::to_string(i + 1) +
                                  " has no range: give it finite limits, and make planner.limit_margin smaller");
    }
    if (!(motion_limits_.speed(i) > 0.0 && motion_limits_.acceleration(i) > 0.0)) {
      throw std::invalid_argument("planner.speed and planner.acceleration must be > 0 for every joint");
    }
  }
}

double Interception::bearing(const Vector3& p_A) const noexcept {
  const double along = std::sqrt(std::max(p_A.head<2>().squaredNorm() - arm_.d2 * arm_.d2, 0.0));
  return std::atan2(p_A.y(), p_A.x()) - std::atan2(-arm_.d2, along);
}

double Interception::in_plane(const BallState& ball) const noexcept {
  const double t1 = bearing(ball.p_A);
  const double v_r = std::cos(t1) * ball.v_A.x() + std::sin(t1) * ball.v_A.y();
  return std::hypot(v_r, ball.v_A.z()) / std::max(ball.v_A.norm(), 1e-9);
}

/// Closes the wrist's circle where the ball is barely out of reach. Returns by how much [m], infinity where that is too
/// much.
double Interception::short_of_reach(const Vector3& p_A, double bearing, double pitch,
                                    Vector3& p_reached) const noexcept {
  // The wrist from the shoulder, in the arm's plane.
  const double x = std::sqrt(std::max(p_A.head<2>().squaredNorm() - arm_.d2 * arm_.d2, 0.0));
  const double k1 = x - arm_.d5 * std::sin(pitch) - arm_.a1;
  const double k2 = p_A.z() - arm_.d1 + arm_.d5 * std::cos(pitch);
  const double distance = std::hypot(k1, k2);
  constexpr double inside = 1.0 - 1e-9;  // a hair within the circle, where rounding does no harm
  const double missing = distance - (arm_.a2 + arm_.a3) * inside;
  p_reached = p_A;
  if (missing <= 0.0) return 0.0;
  if (!(missing <= config_.reach_slack)) return std::numeric_limits<double>::infinity();
  const double along = missing * k1 / distance, up = missing * k2 / distance;
  p_reached -= Vector3(along * std::cos(bearing), along * std::sin(bearing), up);
  return missing;
}

template <typename Take>
void Interception::postures(const BallState& ball, double offset, const Take& take) const noexcept {
  const Vector3& p = ball.p_A;
  if (!(p.head<2>().squaredNorm() > arm_.d2 * arm_.d2)) return;
  const double near_t1 = bearing(p);
  const double v_r = std::cos(near_t1) * ball.v_A.x() + std::sin(near_t1) * ball.v_A.y();
  const double pitch = std::atan2(-v_r, ball.v_A.z()) + offset;
  Vector3 p_reached;
  const double missing = short_of_reach(p, near_t1, pitch, p_reached);
  if (!std::isfinite(missing)) return;
  // The arm as it faces the ball, and reaching over its own back.
  for (const double facing : {1.0, -1.0}) {
    const auto found = kinematics::arm5_ik(arm_, p_reached, facing * pitch, 0.0, limits_);
    for (int i = 0; i < found.count; ++i) {
      if (facing * std::cos(found.t[i](0) - near_t1) > 0.0) take(joints_of(found.t[i]), missing);
    }
  }
}

const InterceptionPlan& Interception::update(double now, const BallState& ball, const JointMotion& motion) noexcept {
  const double commit = plan_.committed ? kStaysCommitted * config_.commit : config_.commit;
  plan_.committed = plan_.exists() && plan_.time - now < commit;
  if (plan_.committed) {
    follow(now, ball, motion);
    return plan_;
  }
  InterceptionPlan best;
  double least = std::numeric_limits<double>::infinity();
  // Candidates stand on a grid of the clock, so that the same one stays from tick to tick.
  double time = std::ceil((now + config_.earliest) / config_.step) * config_.step;
  BallState then = ball;
  for (then.coast(time - now); time - now <= config_.latest; then.coast(config_.step), time += config_.step) {
    const Vector3 from_shoulder = then.p_A - Vector3(0.0, 0.0, arm_.d1);
    if (then.p_A.z() < config_.min_height && then.v_A.z() < 0.0) break;  // it only gets lower
    if (then.p_A.z() < config_.min_height || from_shoulder.norm() > farthest_) continue;
    const double left = time - now;
    const double time_change = plan_.exists() ? config_.time_change_cost * std::abs(time - plan_.time) : 0.0;
    const double share_in_plane = in_plane(then);
    for (const double offset : config_.pitch_offsets) {
      const double angle = std::acos(std::min(std::cos(offset) * share_in_plane, 1.0));
      const double known = config_.facing_cost * angle * angle +
                           config_.turned_away_cost * std::max(0.0, angle - config_.max_facing) + time_change;
      if (known >= least) continue;
      postures(then, offset, [&](const JointVector& q, double missing) noexcept {
        const double slack = left - time_needed(motion_limits_, kJoints, motion, q);
        double cost = known + motion_between(motion_limits_, motion.q, q) +
                      config_.lateness_cost * std::max(0.0, config_.spare_time - slack) + config_.reach_cost * missing;
        if (plan_.exists()) cost += config_.posture_change_cost * motion_between(motion_limits_, plan_.q, q);
        if (cost >= least) return;
        least = cost;
        best.status = slack >= 0.0 ? InterceptionStatus::kPlanned : InterceptionStatus::kTime;
        best.time = time;
        best.p_ABall = then.p_A;
        best.v_ABall = then.v_A;
        best.q = q;
        best.slack = slack;
      });
    }
  }
  plan_ = best;
  return plan_;
}

/// Newton's iterations of the header's step, each about the time at which the ball passes the cup.
void Interception::follow(double now, BallState ball, const JointMotion& motion) noexcept {
  constexpr int iterations = 3;     // from the plan before: the last one moves the cup by far less than a millimetre
  constexpr double damping = 1e-4;  // of the trace, mu
  double left = plan_.time - now;
  if (!(left > 0.0)) return;
  for (double done = 0.0; done < left; done += config_.step) ball.coast(std::min(config_.step, left - done));
  /// A posture, and the ball as it passes the cup there.
  struct Meeting {
    kinematics::Arm5Vector q;
    BallState ball;
    double left;  // s
    Eigen::Matrix<double, 2, 3> D;
    Eigen::Vector2d e;  // m, across the way
  };
  const auto meeting = [&](const kinematics::Arm5Vector& q, BallState then, double time_left) noexcept {
    const Vector3 p_cup = kinematics::arm5_forward(arm_, q).p;
    time_left += then.coast_to_nearest(p_cup, -time_left, std::max(config_.latest - time_left, 0.0));
    const Eigen::Matrix<double, 2, 3> D = then.across();
    return Meeting{q, then, time_left, D, D * (then.p_A - p_cup)};
  };
  Meeting met = meeting(plan_.q.head<kJoints>(), ball, left);
  const auto w = motion_limits_.acceleration.head<kJoints>().cwiseAbs2().asDiagonal();
  for (int i = 0; i < iterations; ++i) {
    const Eigen::Matrix<double, 2, 5> DJ = met.D * kinematics::arm5_position_jacobian(arm_, met.q);
    const Eigen::Matrix<double, 5, 2> WJD = w * DJ.transpose();
    Eigen::Matrix2d A = DJ * WJD;
    A.diagonal().array() += damping * A.trace();
    const kinematics::Arm5Vector step = WJD * A.llt().solve(met.e);
    const double longest = (step.array() / motion_limits_.speed.head<kJoints>().array()).abs().maxCoeff();  // s
    const double share = longest > met.left ? met.left / longest : 1.0;
    const kinematics::Arm5Vector q = (met.q + share * step).cwiseMax(limits_.lower).cwiseMin(limits_.upper);
    const Meeting next = meeting(q, met.ball, met.left);
    if (!(next.e.squaredNorm() < met.e.squaredNorm())) break;
    met = next;
  }
  plan_.q.head<kJoints>() = met.q;
  plan_.time = now + met.left;
  plan_.p_ABall = met.ball.p_A;
  plan_.v_ABall = met.ball.v_A;
  plan_.slack = met.left - time_needed(motion_limits_, kJoints, motion, plan_.q);
  plan_.status = plan_.slack >= 0.0 ? InterceptionStatus::kPlanned : InterceptionStatus::kTime;
}

}  // namespace stance::planning
