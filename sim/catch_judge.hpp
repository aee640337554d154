#pragma once
// What became of a throw, by the truth.
//
//   crossed    the ball's centre has crossed the cup's plane from the front, within the cup's radius of its axis, its
//              velocity within 60 degrees of the axis reversed
//   retained   it has stayed in the cup for kRetention
// A throw that is over is caught (crossed and retained), a bounce (crossed alone), or a miss for a reason: by what the
// last plan before its catch had of the ball and of the cup at that time, against where they were.
#include <cstdint>
#include <limits>
#include <stance_msgs/ball_truth_t.hpp>
#include <stance_msgs/catch_plan_t.hpp>
#include <string_view>

#include "controller/math/so3.hpp"

namespace stance::sim {

inline constexpr double kRetention = 0.5;           ///< s
inline constexpr double kCrossingAngle = M_PI / 3;  ///< rad

/// The cup as it is at an instant.
struct CupPose {
  Vector3 p_W = Vector3::Zero();     ///< m, the centre of its plane
  Vector3 axis_W = Vector3::Zero();  ///< out of it
};

enum class Verdict : std::int8_t {
  kOpen = 0,
  kCaught = 1,
  kBounce = 2,
  kReach = 3,
  kTime = 4,
  kEstimation = 5,
  kFacing = 6,
};
inline constexpr int kNumVerdicts = 7;
/// As summaries write it.
std::string_view name_of(Verdict verdict) noexcept;

class CatchJudge {
 public:
  /// `radius`, `depth` [m]: of the cup, from its axis and from its plane.
  CatchJudge(double radius, double depth) : radius_(radius), depth_(depth) {}

  /// The next throw.
  void begin() noexcept;
  /// The newest plan.
  void hear(const stance_msgs::catch_plan_t& plan) noexcept;
  /// A physics step on, at `utime` [us].
  void step(std::int64_t utime, const CupPose& cup, const Vector3& p_WBall, const Vector3& v_WBall) noexcept;
  /// The throw is over. Returns the verdict.
  Verdict end() noexcept;

  /// Writes what it knows of this throw.
  void tell(stance_msgs::ball_truth_t& truth) const noexcept;

 private:
  struct Throw {
    bool crossed = false, retained = false, in_cup = false;
    std::int64_t crossing_utime = 0;
    double crossing_offset = std::numeric_limits<double>::infinity();
    double crossing_angle = 0.0;
    double nearest = std::numeric_limits<double>::infinity();
    double time_in_cup = 0.0;
    bool has_plan = false, plan_due = false;
    double plan_ball_error = std::numeric_limits<double>::quiet_NaN();
    double plan_cup_error = std::numeric_limits<double>::quiet_NaN();
    double plan_short = 0.0;           ///< m, by which the plan stays short of the ball
    double height = 0.0;               ///< m, of the ball over the cup's plane, a step ago
    Vector3 offset = Vector3::Zero();  ///< m, of the ball from the cup's axis, a step ago
    bool seen = false;
    Verdict verdict = Verdict::kOpen;
  };

  double radius_, depth_;
  Throw throw_;
  stance_msgs::catch_plan_t plan_{};
};

}  // namespace stance::sim
