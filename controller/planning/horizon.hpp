#pragma once
// The gait over the force QP's horizon: contacts, footholds, and the pendulum that rolls over them.
#include <array>
#include <vector>

#include "controller/interface/signals.hpp"
#include "controller/planning/gait.hpp"

namespace stance::planning {

/// A grid of `num_fine` stages of `fine` and then `num_coarse` of `coarse` seconds, both whole control periods.
struct HorizonConfig {
  int num_fine = 0;
  int num_coarse = 0;
  int coarse_periods = 1;  ///< control periods in a coarse stage
  int num_stages() const noexcept { return num_fine + num_coarse; }
  void validate() const;  ///< throws std::invalid_argument naming the field, its value and the range
};

/// One stage, from its start to its end.
struct HorizonStage {
  double duration = 0.0;                                          ///< s
  std::array<bool, 2> contact{};                                  ///< in the stage's middle
  std::array<Vector2, 2> foot{Vector2::Zero(), Vector2::Zero()};  ///< m, in W, in the stage's middle
  Vector2 zmp = Vector2::Zero();                                  ///< m, in W, of the pendulum in the stage's middle
  Pendulum start, middle, end;                                    ///< in W
};

class Horizon {
 public:
  explicit Horizon(const HorizonConfig& config);  ///< takes all memory

  /// From where `gait` and the pendulum are now; `velocity` [m/s, in H] is wanted, `yaw` [rad] H's.
  void roll_out(const Gait& gait, const Pendulum& com, const Vector2& velocity, double yaw) noexcept;

  const std::vector<HorizonStage>& stages() const noexcept { return stages_; }

 private:
  std::vector<HorizonStage> stages_;
};

}  // namespace stance::planning
