#pragma once
// Where and when to step: two steps ahead, by the divergent component of motion.
//
// In the heading frame H, origin at the stance foot, s = +1 where the left foot swings, omega = sqrt(g/h). At
// touchdown, t_e from now (half the double support included), E = exp(omega t_e):
//   Xi = xi E,  X = (xi E + q / E) / 2                       divergent component and centre of mass
//   b  = v T/(e^(omega T) - 1) + (0, -s W/(1 + e^(omega T)))  the offset of a steady gait of period T
//   U  = clamp(Xi - b)                                        first foothold
// and the same again from U, after a second swing of T2: Xi2, X2, U2. The durations T1 and T2 are searched on a grid
// for the least sum of squares of: the deviations |Xi - U - b|, |Xi2 - U2 - b2| that the clamps leave, foot travel
// beyond what its speed allows, the stance leg's reach beyond its limit, and the durations' own deviations. A foothold
// lies on the foot's own side, or, where that costs much, crosses in front of or behind the stance foot; paths keep
// clear of the stance foot.
#include "controller/planning/pendulum.hpp"

namespace stance::planning {

struct FootholdConfig {
  double step_width = 0.0;          ///< m, W
  double swing_time = 0.0;          ///< s, of a steady gait
  double double_support = 0.0;      ///< s
  double min_swing_time = 0.0;      ///< s, of the first swing
  double max_swing_time = 0.0;      ///< s
  double min_second_time = 0.0;     ///< s, of the second swing
  double max_second_time = 0.0;     ///< s
  double min_time_left = 0.0;       ///< s, to the touchdown of a swing under way
  double max_forward = 0.0;         ///< m, |x| of a foothold from the stance foot
  double min_lateral = 0.0;         ///< m, of a foothold on its own side
  double max_lateral = 0.0;         ///< m
  double crossing_forward = 0.0;    ///< m, least |x| of one that crosses
  double crossing_lateral = 0.0;    ///< m, farthest to the other side
  double hip_reach = 0.0;           ///< m, of a foothold from below its hip, horizontally
  double centre_reach = 0.0;        ///< m, of a foothold from below the centre of mass
  double foot_speed = 0.0;          ///< m/s
  double path_clearance = 0.0;      ///< m, of a foot's path from the stance foot
  double crossing_cost = 0.0;       ///< added to what a crossing costs
  double crossing_threshold = 0.0;  ///< cost of the own side above which crossing is tried
  void validate() const;            ///< throws std::invalid_argument naming the field, its value and the range
};

/// In H, from the stance foot.
struct FootholdProblem {
  Pendulum com;
  Vector2 swing_foot = Vector2::Zero();  ///< m
  double side = 1.0;                     ///< s: +1 where the left foot swings, -1 the right
  double time = 0.0;                     ///< s since lift-off
  double swing_time = 0.0;               ///< s, the swing's duration as planned last
  double double_support = 0.0;           ///< s, that follows
  Vector2 velocity = Vector2::Zero();    ///< m/s, wanted
  double omega = 0.0;                    ///< 1/s
  double hip_lateral = 0.0;              ///< m, of a hip from the trunk's middle
};

struct FootholdPlan {
  Vector2 foothold = Vector2::Zero();  ///< m, in H, from the stance foot
  double swing_time = 0.0;             ///< s, T1
  double next_swing_time = 0.0;        ///< s, T2
  double deviation = 0.0;              ///< m, |Xi - U - b|: what the first step leaves
  double next_deviation = 0.0;         ///< m, what the second one leaves
  double cost = 0.0;
  int crossing = 0;  ///< 0 own side, +1 in front of the stance foot, -1 behind it
};

/// Lateral distance [m] between the feet's lines of a steady gait: sideways, the foot that follows keeps path_clearance
/// from the other one.
double steady_width(const FootholdConfig& config, const Vector2& velocity) noexcept;

/// b [m] of a steady gait with swing foot's side `side`, per swing of `config.swing_time`.
Vector2 steady_offset(const FootholdConfig& config, double omega, const Vector2& velocity, double side) noexcept;

FootholdPlan plan_footholds(const FootholdConfig& config, const FootholdProblem& problem) noexcept;

/// The foothold of a swing whose time and crossing stand.
Vector2 foothold_at(const FootholdConfig& config, const FootholdProblem& problem, double swing_time,
                    int crossing) noexcept;

}  // namespace stance::planning
