#pragma once
// One ball after the other, from a camera's observations: which are believed, when a ball is another one, and the
// filter between them. No allocation, no exceptions.
//
// An observation is believed where its innovation y, of covariance S, has y^T S^-1 y / 3 <= gate. After `max_rejected`
// in a row that are not, or `max_gap` without one that is, the track starts again with the newest.
//
// A ball is thrown at the arm. Where it is nearest to `aim`, t from now or since, at p* with v*, this is a measurement
// more,
//   D (p + t v + ...) = D aim + r,     D (2 x 3) the directions across v*,     r ~ N(0, aim_sigma^2 1),
// which says little beside many observations and much beside the first ones; believed, too, up to `gate`. The filter
// itself is not told: what it publishes is what was seen.
#include "controller/behaviours/catcher_config.hpp"

namespace stance::behaviours {

class BallTrack {
 public:
  /// Throws what the filter throws.
  BallTrack(const BallTrackConfig& config, const estimation::BallFilterConfig& filter);

  /// The ball was seen at `p_A` [m] at `utime` [us], which must be after the one before it. Returns the observation's
  /// NIS per degree of freedom; NaN where nothing was compared.
  double observe(std::int64_t utime, const Vector3& p_A) noexcept;
  /// The next ball is another one.
  void reset() noexcept;

  /// Is there a ball, known well enough to plan for at `utime`?
  bool is_known(std::int64_t utime) const noexcept;
  /// At `utime` [us], not before the last observation.
  estimation::BallFilter<7>::Estimate at(std::int64_t utime) const noexcept;

  /// The same, of a ball that is thrown at `aim`.
  estimation::BallFilter<7>::Estimate thrown_at_aim(std::int64_t utime) const noexcept;

  std::int64_t observations() const noexcept { return observations_; }  ///< believed, of this ball
  std::int64_t rejected() const noexcept { return rejected_; }          ///< of the run

 private:
  void start(std::int64_t utime, const Vector3& p_A) noexcept;

  BallTrackConfig config_;
  estimation::BallFilter<7> filter_;
  std::int64_t utime_ = 0;           ///< of the filter
  std::int64_t believed_utime_ = 0;  ///< of the last observation that was believed
  std::int64_t observations_ = 0;
  int rejected_in_a_row_ = 0;
  std::int64_t rejected_ = 0;
};

}  // namespace stance::behaviours
