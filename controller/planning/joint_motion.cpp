#include "controller/planning/joint_motion.hpp"

#include <algorithm>
#include <cmath>

namespace stance::planning {
namespace {

constexpr int kSamples = 12;  // of a quintic, at which its limits are looked at

/// One joint's quintic, from (q, v, a) to (target, speed, 0) in T.
struct Quintic {
  double q, v, a, c3, c4, c5;

  Quintic(double q_0, double v_0, double a_0, double target, double end_speed, double T) noexcept
      : q(q_0), v(v_0), a(a_0) {
    const double d = target - q - v * T - 0.5 * a * T * T, dv = end_speed - v - a * T, da = -a;
    c3 = (10.0 * d - 4.0 * dv * T + 0.5 * da * T * T) / (T * T * T);
    c4 = (-15.0 * d + 7.0 * dv * T - da * T * T) / (T * T * T * T);
    c5 = (6.0 * d - 3.0 * dv * T + 0.5 * da * T * T) / (T * T * T * T * T);
  }
  double position(double t) const noexcept { return q + t * (v + t * (0.5 * a + t * (c3 + t * (c4 + t * c5)))); }
  double speed(double t) const noexcept { return v + t * (a + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))); }
  double acceleration(double t) const noexcept { return a + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)); }

  /// Does it keep to the limits from its first tenth to its end? What it has at the start it cannot help.
  bool keeps_to(double max_speed, double max_acceleration, double T) const noexcept {
    constexpr double rounding = 1.0 + 1e-9;
    for (int i = 1; i < kSamples; ++i) {
      const double t = T * (0.1 + 0.9 * i / kSamples);
      if (!(std::abs(speed(t)) <= max_speed * rounding && std::abs(acceleration(t)) <= max_acceleration * rounding)) {
        return false;
      }
    }
    return true;
  }

  bool stays_within(double lower, double upper, double T) const noexcept {
    for (int i = 1; i < kSamples; ++i) {
      const double at = position(T * i / kSamples);
      if (!(lower <= at && at <= upper)) return false;
    }
    return true;
  }
};

constexpr double kBraking = 0.75;  // of the acceleration: the rest is for steps of dt

/// The speed to have after dt on the fastest way to rest at a distance `e`.
double braking_speed(double e, double max_speed, double max_acceleration, double dt) noexcept {
  const double speed = std::min({max_speed, std::sqrt(2.0 * kBraking * max_acceleration * std::abs(e)),
                                 0.5 * std::abs(e) / dt});  // the last: no more than half the way in a step
  return std::copysign(speed, e);
}

/// far(s) of the header: towards + in T.
double farthest(double v, double s, double T, double max_speed, double a, double b) noexcept {
  const double p = std::min(max_speed, (T + v / a + s / b) / (1.0 / a + 1.0 / b));
  const double t_a = (p - v) / a, t_b = (p - s) / b;
  return 0.5 * (p + v) * t_a + 0.5 * (p + s) * t_b + p * std::max(T - t_a - t_b, 0.0);
}

/// The speed nearest to `speed` with which a joint at speed v gets a distance `e` on in T; the most that it may have
/// where none does. It must be able to stop within `above` or `below` the target.
double passing_speed(double e, double v, double speed, double T, double max_speed, double max_acceleration,
                     double above, double below) noexcept {
  constexpr int halvings = 12;
  const double b = kBraking * max_acceleration;
  const double towards = std::copysign(1.0, e - 0.5 * (v + speed) * T);
  const double room = std::max(towards > 0.0 ? above : below, 0.0);
  // Beyond what it can have in T, far(s) falls again.
  double low = towards * speed;
  double high = std::min({max_speed, std::sqrt(2.0 * b * room), towards * v + max_acceleration * T});
  const auto arrives = [&](double s) noexcept {
    return farthest(towards * v, s, T, max_speed, max_acceleration, b) >= towards * e;
  };
  if (low >= high || arrives(low)) return speed;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (low + high);
    (arrives(middle) ? high : low) = middle;
  }
  return towards * high;
}

}  // namespace

void advance(const JointMotionLimits& limits, int joints, const JointVector& target, const JointVector& speed,
             double time_left, Priority priority, double dt, JointMotion& motion) noexcept {
  for (int i = 0; i < joints; ++i) {
    double &q = motion.q[i], &v = motion.v[i], &a = motion.a[i];
    const double max_speed = limits.speed[i], max_acceleration = limits.acceleration[i];
    const double T = std::max(time_left, dt);
    const Quintic way(q, v, a, target[i], speed[i], T);
    const bool ends = dt >= T;  // past its end a quintic goes anywhere
    const double next = ends ? speed[i] : way.speed(dt);
    const bool step_keeps = std::abs(next) <= max_speed && std::abs(next - v) <= max_acceleration * dt;
    if (step_keeps && way.keeps_to(max_speed, max_acceleration, T)) {
      q = ends ? target[i] : way.position(dt);
      v = next;
      a = ends ? 0.0 : way.acceleration(dt);
      continue;
    }
    double end = speed[i];
    if (priority == Priority::kTime && time_left > dt) {
      end = passing_speed(target[i] - q, v, end, T, max_speed, max_acceleration, limits.upper[i] - target[i],
                          target[i] - limits.lower[i]);
    }
    // Where the line to the target is half a step on.
    const double e = target[i] - end * std::max(time_left - 0.5 * dt, 0.0) - q - 0.5 * v * dt;
    const double wanted = std::clamp(end + braking_speed(e, max_speed, max_acceleration, dt), -max_speed, max_speed);
    a = std::clamp((wanted - v) / dt, -max_acceleration, max_acceleration);
    q += v * dt + 0.5 * a * dt * dt;
    v += a * dt;
  }
}

bool keeps_to_limits(const JointMotionLimits& limits, int joints, const JointVector& target, const JointVector& speed,
                     double time_left, const JointMotion& motion) noexcept {
  for (int i = 0; i < joints; ++i) {
    const Quintic way(motion.q[i], motion.v[i], motion.a[i], target[i], speed[i], time_left);
    if (!way.keeps_to(limits.speed[i], limits.acceleration[i], time_left)) return false;
    if (!way.stays_within(limits.lower[i], limits.upper[i], time_left)) return false;
  }
  return true;
}

double time_needed(const JointMotionLimits& limits, int joints, const JointMotion& motion,
                   const JointVector& target) noexcept {
  constexpr double head_start = 0.12;  // s, for which a joint's present speed helps or hinders it
  constexpr double peak_speed = 15.0 / 8.0, peak_acceleration = 5.7735026918962582;
  double needed = 0.0;
  for (int i = 0; i < joints; ++i) {
    const double d = std::abs(target[i] - motion.q[i] - head_start * motion.v[i]);
    needed =
        std::max({needed, peak_speed * d / limits.speed[i], std::sqrt(peak_acceleration * d / limits.acceleration[i])});
  }
  return needed;
}

}  // namespace stance::planning
