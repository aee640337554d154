#include "controller/planning/horizon.hpp"

#include <algorithm>
#include <cmath>

#include "controller/interface/require.hpp"
#include "controller/planning/heading.hpp"

namespace stance::planning {
namespace {

constexpr double kRounding = 1e-6;  // s
constexpr Require require{"horizon."};

/// A gait that goes on without a robot, a control period at a time.
struct Imagined {
  const Gait& gait;
  Vector2 velocity;
  double yaw;
  GaitPhase phase;
  int swing;
  double time, double_support, swing_time, next_swing_time;
  std::array<Vector2, 2> foot;
  Vector2 foothold;
  bool planned;

  Imagined(const Gait& from, const Vector2& wanted, double heading) noexcept
      : gait(from), velocity(wanted), yaw(heading) {
    const GaitState& now = from.state();
    phase = now.phase;
    swing = now.swing;
    time = now.time;
    double_support = now.double_support;
    const double steady = from.config().footholds.swing_time;
    swing_time = phase == GaitPhase::kSingleSupport ? now.swing_time : now.next_swing_time;
    next_swing_time = phase == GaitPhase::kSingleSupport ? now.next_swing_time : steady;
    for (std::size_t i = 0; i < 2; ++i) foot[i] = now.p_WF[i].head<2>();
    foothold = now.foothold;
    planned = phase == GaitPhase::kSingleSupport;
  }

  Vector2& swing_foot() noexcept { return foot[static_cast<std::size_t>(swing)]; }
  const Vector2& support_foot() const noexcept { return foot[static_cast<std::size_t>(1 - swing)]; }

  void plan(const Pendulum& com) noexcept {
    if (phase == GaitPhase::kDoubleSupport || planned) return;
    FootholdProblem problem = gait.problem(com, support_foot(), swing_foot(), swing, velocity, yaw);
    problem.time = time;
    const Vector2 u = foothold_at(gait.config().footholds, problem, swing_time, 0);
    foothold = support_foot() + in_world(yaw, u);
    planned = true;
  }

  Vector2 zmp() noexcept {
    if (phase == GaitPhase::kSingleSupport) return support_foot();
    const double shifted = std::clamp((time + 0.5 * kControlPeriod) / double_support, 0.0, 1.0);
    // From the foot that lifts next to the other one.
    return swing_foot() + shifted * (support_foot() - swing_foot());
  }

  void advance() noexcept {
    time += kControlPeriod;
    if (phase == GaitPhase::kSingleSupport && time >= swing_time - kRounding) {
      swing_foot() = foothold;
      phase = GaitPhase::kDoubleSupport;
      time = 0.0;
      double_support = gait.double_support();
      swing = 1 - swing;
      // The search knows two swings; a steady gait comes after.
      swing_time = next_swing_time;
      next_swing_time = gait.config().footholds.swing_time;
    } else if (phase == GaitPhase::kDoubleSupport && time >= double_support - kRounding) {
      phase = GaitPhase::kSingleSupport;
      time = 0.0;
      planned = false;
    }
  }
};

}  // namespace

void HorizonConfig::validate() const {
  require(num_fine >= 1, "num_fine", num_fine, ">= 1");
  require(num_coarse >= 0, "num_coarse", num_coarse, ">= 0");
  require(coarse_periods >= 1 && coarse_periods <= 10, "coarse_periods", coarse_periods, "in 1..10");
}

Horizon::Horizon(const HorizonConfig& config) {
  config.validate();
  stages_.resize(static_cast<std::size_t>(config.num_stages()));
  for (std::size_t k = 0; k < stages_.size(); ++k) {
    const bool fine = k < static_cast<std::size_t>(config.num_fine);
    stages_[k].duration = kControlPeriod * (fine ? 1 : config.coarse_periods);
  }
}

void Horizon::roll_out(const Gait& gait, const Pendulum& start, const Vector2& velocity, double yaw) noexcept {
  Imagined imagined(gait, velocity, yaw);
  Pendulum com = start;
  for (HorizonStage& stage : stages_) {
    const auto periods = static_cast<int>(std::lround(stage.duration / kControlPeriod));
    stage.start = com;
    for (int i = 0; i < periods; ++i) {
      imagined.plan(com);
      const Vector2 zmp = imagined.zmp();
      if (i == periods / 2) {
        for (int foot = 0; foot < 2; ++foot) {
          stage.contact[static_cast<std::size_t>(foot)] =
              imagined.phase == GaitPhase::kDoubleSupport || foot != imagined.swing;
        }
        stage.foot = imagined.foot;
        stage.zmp = zmp;
        stage.middle = com;
      }
      com = swung(com, zmp, gait.omega(), kControlPeriod);
      imagined.advance();
    }
    stage.end = com;
  }
}

}  // namespace stance::planning
