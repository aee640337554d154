#include "sim/catch_judge.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/world.hpp"

namespace stance::sim {
namespace {

using stance_msgs::ball_truth_t;
using stance_msgs::catch_plan_t;

Vector3 vector(const double (&v)[3]) noexcept { return {v[0], v[1], v[2]}; }

}  // namespace

static_assert(static_cast<int>(Verdict::kFacing) == ball_truth_t::FACING &&
              static_cast<int>(Verdict::kCaught) == ball_truth_t::CAUGHT);

std::string_view name_of(Verdict verdict) noexcept {
  constexpr std::array<std::string_view, kNumVerdicts> names = {"open", "caught",     "bounce", "reach",
                                                                "time", "estimation", "facing"};
  return names[static_cast<std::size_t>(verdict)];
}

void CatchJudge::begin() noexcept { throw_ = Throw{}; }

void CatchJudge::hear(const catch_plan_t& plan) noexcept {
  if (throw_.plan_due || plan.phase != catch_plan_t::CATCHING) return;
  throw_.has_plan = plan.status == catch_plan_t::PLANNED || plan.status == catch_plan_t::TIME;
  plan_ = plan;
}

void CatchJudge::step(std::int64_t utime, const CupPose& cup, const Vector3& p_WBall, const Vector3& v_WBall) noexcept {
  const Vector3 from_cup = p_WBall - cup.p_W;
  const double height = from_cup.dot(cup.axis_W);
  const Vector3 offset = from_cup - height * cup.axis_W;
  throw_.nearest = std::min(throw_.nearest, from_cup.norm());
  if (throw_.seen && throw_.height > 0.0 && height <= 0.0) {
    const double share = throw_.height / (throw_.height - height);
    const double across = (throw_.offset + share * (offset - throw_.offset)).norm();
    const double angle = std::acos(std::clamp(-v_WBall.normalized().dot(cup.axis_W), -1.0, 1.0));
    if (across < throw_.crossing_offset) {
      throw_.crossing_utime = utime;
      throw_.crossing_offset = across;
      throw_.crossing_angle = angle;
    }
    throw_.crossed = throw_.crossed || (across <= radius_ && angle <= kCrossingAngle);
  }
  throw_.seen = true;
  throw_.height = height;
  throw_.offset = offset;
  throw_.in_cup = height <= 0.0 && height >= -depth_ && offset.norm() <= radius_;
  throw_.time_in_cup = throw_.in_cup ? throw_.time_in_cup + kPhysicsStep : 0.0;
  throw_.retained = throw_.retained || throw_.time_in_cup >= kRetention;
  if (throw_.has_plan && !throw_.plan_due && utime >= plan_.catch_utime) {
    throw_.plan_due = true;
    throw_.plan_ball_error = (p_WBall - vector(plan_.p_ABall)).norm();  // A is W: the arm's base stands in W's origin
    throw_.plan_cup_error = (cup.p_W - vector(plan_.p_ACup)).norm();
    throw_.plan_short = (vector(plan_.p_ABall) - vector(plan_.p_ACup)).norm();
  }
}

Verdict CatchJudge::end() noexcept {
  Throw& t = throw_;
  if (t.crossed) {
    t.verdict = t.retained ? Verdict::kCaught : Verdict::kBounce;
  } else if (!t.plan_due) {
    t.verdict = Verdict::kReach;
  } else if (t.crossing_offset <= radius_) {
    t.verdict = Verdict::kFacing;
  } else if (t.plan_short > std::max(t.plan_ball_error, t.plan_cup_error)) {
    t.verdict = Verdict::kReach;
  } else {
    t.verdict = t.plan_cup_error > t.plan_ball_error ? Verdict::kTime : Verdict::kEstimation;
  }
  return t.verdict;
}

void CatchJudge::tell(ball_truth_t& truth) const noexcept {
  truth.in_cup = throw_.in_cup ? 1 : 0;
  truth.crossed = throw_.crossed ? 1 : 0;
  truth.retained = throw_.retained ? 1 : 0;
  truth.crossing_utime = throw_.crossing_utime;
  truth.crossing_offset = throw_.crossing_offset;
  truth.crossing_angle = throw_.crossing_angle;
  truth.nearest = throw_.nearest;
  truth.plan_ball_error = throw_.plan_ball_error;
  truth.plan_cup_error = throw_.plan_cup_error;
  truth.verdict = static_cast<std::int8_t>(throw_.verdict);
}

}  // namespace stance::sim
