#include "rollout/summary.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "controller/platform/text.hpp"

namespace stance::rollout {
namespace {

using kinematics::Fall;

constexpr double kSettling = 3.0;  // s of a segment that its means leave out, at most

bool same_wish(const sim::ScheduledCommand& a, const sim::ScheduledCommand& b) {
  if (a.silent || b.silent) return a.silent == b.silent;
  return a.behaviour == b.behaviour && a.velocity == b.velocity && a.yaw_rate == b.yaw_rate &&
         a.height_offset == b.height_offset;
}

/// The smallest of `sorted` that a share of them does not exceed.
double percentile(const std::vector<double>& sorted, double share) {
  const double rank = std::ceil(share * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

std::string number(double value) { return std::isfinite(value) ? platform::to_text(value) : "null"; }

std::string quoted(const std::string& text) {
  std::ostringstream out;
  out << '"';
  for (const char c : text) {
    if (c == '"' || c == '\\') out << '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      out << "\\u" << std::hex << std::setw(4) << std::setfill('0') << static_cast<int>(c);
    } else {
      out << c;
    }
  }
  out << '"';
  return out.str();
}

/// A drawn value: a number where it is one, else a text.
std::string value_of(const std::string& drawn) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(drawn.data(), drawn.data() + drawn.size(), value);
  const bool whole = error == std::errc() && end == drawn.data() + drawn.size();
  return whole ? number(value) : quoted(drawn);
}

template <typename Values>
std::string list(const Values& values) {
  std::string out;
  for (const auto value : values) out += (out.empty() ? "" : ", ") + number(static_cast<double>(value));
  return "[" + out + "]";
}

const char* name_of(Fall fall) {
  switch (fall) {
    case Fall::kTilt:
      return "tilt";
    case Fall::kHeight:
      return "height";
    case Fall::kBodyOnGround:
      return "body_on_ground";
    case Fall::kNone:
      break;
  }
  return "none";
}

std::string as_json(const Segment& s) {
  std::ostringstream out;
  out << "{\"start_s\": " << number(s.start) << ", \"end_s\": " << number(s.end)
      << ", \"behaviour\": " << quoted(std::string(sim::behaviour_name(s.wanted)))
      << ", \"velocity_m_s\": " << list(s.wanted.velocity) << ", \"yaw_rate_rad_s\": " << number(s.wanted.yaw_rate)
      << ", \"height_offset_m\": " << number(s.wanted.height_offset)
      << ", \"measured_from_s\": " << number(s.measured_from) << ", \"mean_velocity_m_s\": " << list(s.mean_velocity)
      << ", \"mean_yaw_rate_rad_s\": " << number(s.mean_yaw_rate) << ", \"distance_m\": " << number(s.distance) << "}";
  return out.str();
}

std::string as_json(const TickCpu& cpu) {
  std::ostringstream out;
  out << "{\"p50_us\": " << number(cpu.p50) << ", \"p99_us\": " << number(cpu.p99)
      << ", \"p99_9_us\": " << number(cpu.p99_9) << ", \"max_us\": " << number(cpu.max)
      << ", \"first_edge_us\": 1, \"bins_per_decade\": " << TickCpu::kBinsPerDecade
      << ", \"counts\": " << list(cpu.counts) << "}";
  return out.str();
}

/// How many there are, how many did well, and why the others did not.
std::string as_json(const std::vector<ThrowOutcome>& throws) {
  std::array<int, sim::kNumVerdicts> counts{};
  int crossed = 0, retained = 0;
  std::string each, verdicts;
  for (const ThrowOutcome& one : throws) {
    ++counts[static_cast<std::size_t>(one.verdict)];
    crossed += one.crossed ? 1 : 0;
    retained += one.retained ? 1 : 0;
    std::ostringstream entry;
    entry << "{\"time_s\": " << number(one.time) << ", \"verdict\": " << quoted(std::string(name_of(one.verdict)))
          << ", \"crossed\": " << (one.crossed ? "true" : "false")
          << ", \"retained\": " << (one.retained ? "true" : "false")
          << ", \"crossing_offset_m\": " << number(one.crossing_offset)
          << ", \"crossing_angle_rad\": " << number(one.crossing_angle) << ", \"nearest_m\": " << number(one.nearest)
          << ", \"plan_ball_error_m\": " << number(one.plan_ball_error)
          << ", \"plan_cup_error_m\": " << number(one.plan_cup_error) << "}";
    each += (each.empty() ? "" : ", ") + entry.str();
  }
  for (std::size_t i = 1; i < counts.size(); ++i) {
    verdicts += (verdicts.empty() ? "" : ", ") + quoted(std::string(name_of(static_cast<sim::Verdict>(i)))) + ": " +
                std::to_string(counts[i]);
  }
  const auto share = [&](int count) {
    return throws.empty() ? std::string("null")
                          : number(static_cast<double>(count) / static_cast<double>(throws.size()));
  };
  std::ostringstream out;
  out << "{\"throws\": " << throws.size() << ", \"crossed\": " << share(crossed)
      << ", \"retained\": " << share(retained) << ", \"verdicts\": {" << verdicts << "}, \"each\": [" << each << "]}";
  return out.str();
}

}  // namespace

std::vector<Segment> segments(const std::vector<sim::ScheduledCommand>& commands, std::span<const Place> path) {
  std::vector<Segment> found;
  const int last = static_cast<int>(path.size()) - 1;
  for (std::size_t first = 0; first < commands.size();) {
    std::size_t next = first + 1;
    while (next < commands.size() && same_wish(commands[next], commands[first])) ++next;
    const int start = commands[first].period;
    const int end = next < commands.size() ? std::min(commands[next].period, last) : last;
    if (start < end) {
      const int settled = start + std::min(static_cast<int>(kSettling / kControlPeriod), (end - start) / 2);
      const double measured = (end - settled) * kControlPeriod;
      Segment segment{start * kControlPeriod, end * kControlPeriod, commands[first], settled * kControlPeriod};
      for (int k = settled; k < end; ++k) {
        const Place &before = path[static_cast<std::size_t>(k)], &after = path[static_cast<std::size_t>(k + 1)];
        const double yaw = 0.5 * (before.yaw + after.yaw);
        segment.mean_velocity += Eigen::Rotation2Dd(-yaw) * (after.p_WC - before.p_WC) / measured;
      }
      const Place &from = path[static_cast<std::size_t>(start)], &to = path[static_cast<std::size_t>(end)];
      segment.mean_yaw_rate = (to.yaw - path[static_cast<std::size_t>(settled)].yaw) / measured;
      segment.distance = (to.p_WC - from.p_WC).norm();
      found.push_back(segment);
    }
    first = next;
  }
  return found;
}

TickCpu tick_cpu(std::vector<double> times) {
  TickCpu cpu;
  if (times.empty()) return cpu;
  for (const double time : times) {
    const double bin = std::floor(TickCpu::kBinsPerDecade * std::log10(std::max(time, 1.0)));
    ++cpu.counts[static_cast<std::size_t>(std::min(bin, TickCpu::kBins - 1.0))];
  }
  std::sort(times.begin(), times.end());
  cpu.p50 = percentile(times, 0.5);
  cpu.p99 = percentile(times, 0.99);
  cpu.p99_9 = percentile(times, 0.999);
  cpu.max = times.back();
  return cpu;
}

std::string as_json(const Summary& s) {
  std::string drawn, parts;
  for (const auto& value : s.drawn) {
    drawn += (drawn.empty() ? "" : ", ") + quoted(value.path) + ": " + value_of(value.value);
  }
  for (const Segment& segment : s.segments) parts += (parts.empty() ? "" : ", ") + as_json(segment);
  std::ostringstream out;
  out << "{\"seed\": " << s.seed << ", \"drawn\": {" << drawn << "}, \"duration_s\": " << number(s.duration)
      << ", \"wall_s\": " << number(s.wall) << ", \"times_real_time\": " << number(s.duration / s.wall);
  if (s.has_feet) {
    out << ", \"fallen\": " << (s.fallen() ? "true" : "false")
        << ", \"first_fall_s\": " << (s.fallen() ? number(s.duration) : "null")
        << ", \"fall_reason\": " << (s.fallen() ? quoted(name_of(s.fall)) : "null")
        << ", \"fallen_on\": " << (s.fallen_on.empty() ? "null" : quoted(s.fallen_on))
        << ", \"lying\": " << (s.lying ? "true" : "false") << ", \"max_tilt_rad\": " << number(s.max_tilt)
        << ", \"qp_failures\": " << s.qp_failures << ", \"qp_iterations_max\": " << s.qp_iterations_max
        << ", \"steps\": " << s.steps << ", \"p_WB\": " << list(s.p_WB) << ", \"segments\": [" << parts << "]";
  }
  if (s.has_cup) out << ", \"catch\": " << as_json(s.throws);
  out << ", \"max_torque_share\": " << number(s.max_torque_share) << ", \"torques_saturated\": " << s.torques_saturated
      << ", \"drives_damped_s\": " << number(s.drives_damped) << ", \"tick_cpu\": " << as_json(s.tick_cpu)
      << ", \"command_hash\": \"" << std::hex << s.command_hash << "\"}\n";
  return out.str();
}

std::string as_text(const Summary& s) {
  constexpr double degrees = 180.0 / M_PI, percent = 100.0;
  std::ostringstream out;
  if (s.fallen()) {
    out << "fell at " << s.duration << " s (" << name_of(s.fall) << (s.fallen_on.empty() ? "" : ": ") << s.fallen_on
        << ")";
  } else {
    out << (s.lying ? "lay down, " : "") << (s.has_feet ? "no fall in " : "") << s.duration << " s";
  }
  if (s.has_feet) {
    out << "; largest tilt of the trunk " << s.max_tilt * degrees << " deg; " << s.steps << " steps; " << s.qp_failures
        << " failed QPs";
  }
  out << std::setprecision(3) << "; at most " << percent * s.max_torque_share << " % of a joint's torque; ticks of "
      << s.tick_cpu.p50 << " us (median), " << s.tick_cpu.p99_9 << " us (99.9%); " << s.duration / s.wall
      << " times real time; joint commands " << std::hex << s.command_hash << std::dec << "\n";
  out << std::fixed << std::setprecision(2);
  for (const ThrowOutcome& one : s.throws) {
    out << "  thrown at " << one.time << " s: " << name_of(one.verdict) << "; it passed "
        << 1000.0 * one.crossing_offset << " mm from the cup's axis at " << degrees * one.crossing_angle << " deg\n";
  }
  for (const Segment& segment : s.segments) {
    if (segment.wanted.silent || segment.wanted.behaviour != Behaviour::kWalk) continue;
    out << "  " << segment.start << " to " << segment.end << " s: wanted (" << segment.wanted.velocity.x() << ", "
        << segment.wanted.velocity.y() << ") m/s, " << segment.wanted.yaw_rate << " rad/s; walked ("
        << segment.mean_velocity.x() << ", " << segment.mean_velocity.y() << ") m/s, " << segment.mean_yaw_rate
        << " rad/s, " << segment.distance << " m\n";
  }
  return out.str();
}

Observer::Observer(const rigid_body::Model& model, const sim::Scenario& scenario, const sim::Simulator& simulator)
    : model_(model), scenario_(scenario), simulator_(simulator) {
  so_far_.has_feet = simulator.truth().num_contacts > 0;
  look();
}

void Observer::look() {
  const auto& truth = simulator_.truth();
  const auto& q = truth.quat_WB;
  so_far_.max_tilt =
      std::max(so_far_.max_tilt, std::acos(std::clamp(1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]), -1.0, 1.0)));
  const double yaw = std::atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]));
  path_.push_back({{truth.p_WC[0], truth.p_WC[1]}, path_.empty() ? yaw : math::unwrap(yaw, path_.back().yaw)});
}

void Observer::period(const loop::Ticker& ticker, double cpu_us) {
  const TickOutput& out = ticker.output();
  so_far_.command_hash = platform::hash(ticker.command().bytes(), so_far_.command_hash);
  const auto& truth = simulator_.truth();
  for (int i = 0; i < model_.num_joints; ++i) {
    const double limit = model_.joints[static_cast<std::size_t>(i)].max_torque;
    so_far_.max_torque_share = std::max(so_far_.max_torque_share, std::abs(truth.joint_torque[i]) / limit);
  }
  if (truth.drives_damped != 0) so_far_.drives_damped += kControlPeriod;
  so_far_.torques_saturated = out.trace.fault_count[static_cast<std::size_t>(Fault::kTorqueSaturated)];
  so_far_.qp_failures = out.trace.fault_count[static_cast<std::size_t>(Fault::kQpFailed)];
  so_far_.qp_iterations_max = std::max(so_far_.qp_iterations_max, out.trace.qp_iterations);
  for (std::size_t i = 0; i < static_cast<std::size_t>(out.plan.num_contacts); ++i) {
    const bool stance = out.plan.num_stages > 0 && out.plan.contact[0][i];
    if (stance && was_swinging_[i]) ++so_far_.steps;
    was_swinging_[i] = out.plan.num_stages > 0 && !stance;
  }
  cpu_us_.push_back(cpu_us);
  look();
}

Summary Observer::summary(std::uint64_t seed, double wall) const {
  Summary summary = so_far_;
  const auto& truth = simulator_.truth();
  summary.seed = seed;
  summary.drawn = scenario_.drawn;
  summary.duration = simulator_.time();
  summary.wall = wall;
  summary.fall = simulator_.fall();
  summary.fallen_on = simulator_.fallen_on();
  summary.lying = simulator_.lying();
  summary.p_WB = {truth.p_WB[0], truth.p_WB[1], truth.p_WB[2]};
  summary.has_cup = simulator_.ball_truth() != nullptr;
  for (const auto& ball : simulator_.throws()) {
    summary.throws.push_back({scenario_.throws[static_cast<std::size_t>(ball.throw_number - 1)].time,
                              static_cast<sim::Verdict>(ball.verdict), ball.crossed != 0, ball.retained != 0,
                              ball.crossing_offset, ball.crossing_angle, ball.nearest, ball.plan_ball_error,
                              ball.plan_cup_error});
  }
  if (summary.has_feet) summary.segments = segments(scenario_.commands, path_);
  summary.tick_cpu = tick_cpu(cpu_us_);
  return summary;
}

}  // namespace stance::rollout
