#include "controller/planning/swing.hpp"

#include <algorithm>
#include <cmath>

#include "controller/interface/require.hpp"

namespace stance::planning {
namespace {

/// One axis of the quintic from (p, v, a) to (target, 0, 0) in `time`, `dt` on.
void minimum_jerk(double target, double time, double dt, double& p, double& v, double& a) noexcept {
  const double T = time, T2 = T * T, d = target - p;
  const double c3 = (20.0 * d - 12.0 * v * T - 3.0 * a * T2) / (2.0 * T2 * T);
  const double c4 = (-30.0 * d + 16.0 * v * T + 3.0 * a * T2) / (2.0 * T2 * T2);
  const double c5 = (12.0 * d - 6.0 * v * T - a * T2) / (2.0 * T2 * T2 * T);
  const double s = std::min(dt, T);
  const double p1 = p + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5))));
  const double v1 = v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)));
  a = a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5));
  v = v1;
  p = p1;
}

constexpr Require require{"swing."};

}  // namespace

void SwingConfig::validate() const {
  require(height > 0.0, "height", height, "> 0 m");
  require(apex > 0.0 && apex < 1.0, "apex", apex, "in 0..1");
  require(depth >= 0.0, "depth", depth, ">= 0 m");
  require(late_speed > 0.0, "late_speed", late_speed, "> 0 m/s");
  require(late_depth >= depth, "late_depth", late_depth, "at least depth");
  require(min_time_left > 0.0, "min_time_left", min_time_left, "> 0 s");
}

void Swing::lift_off(const Vector3& p) noexcept {
  reference_ = {p, Vector3::Zero(), Vector3::Zero()};
  phase_ = 0.0;
  overdue_ = 0.0;
  lift_off_z_ = p.z();
}

void Swing::step(const Vector2& foothold, double ground_z, double time_left, double dt) noexcept {
  const double horizontal_time = std::max(time_left, config_.min_time_left);
  for (int axis = 0; axis < 2; ++axis) {
    minimum_jerk(foothold[axis], horizontal_time, dt, reference_.p[axis], reference_.v[axis], reference_.a[axis]);
  }

  const double rate = phase_ < 1.0 ? (1.0 - phase_) / std::max(time_left, dt) : 0.0;
  const double before = phase_;
  phase_ = std::min(1.0, phase_ + rate * dt);
  const double bottom = ground_z - config_.depth;
  const double top = std::max(lift_off_z_, ground_z) + config_.height;
  double& z = reference_.p.z();
  double& vz = reference_.v.z();
  if (phase_ < config_.apex) {
    const double u = phase_ / config_.apex, rise = top - lift_off_z_;
    z = lift_off_z_ + rise * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    vz = rise * 30.0 * u * u * (1.0 - u) * (1.0 - u) / config_.apex * rate;
    reference_.a.z() = rise * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * rate * rate / (config_.apex * config_.apex);
  } else if (before < 1.0) {
    // Half of it a parabola, so that the foot arrives with a speed.
    const double length = 1.0 - config_.apex, u = (phase_ - config_.apex) / length, fall = bottom - top;
    z = top + fall * (0.5 * u * u * (3.0 - 2.0 * u) + 0.5 * u * u);
    vz = fall * (3.0 * u * (1.0 - u) + u) / length * rate;
    reference_.a.z() = fall * (4.0 - 6.0 * u) * rate * rate / (length * length);
  } else {
    overdue_ += dt;
    z = bottom - std::min(config_.late_speed * overdue_, config_.late_depth - config_.depth);
    vz = -config_.late_speed;
    reference_.a.z() = 0.0;
  }
}

}  // namespace stance::planning
