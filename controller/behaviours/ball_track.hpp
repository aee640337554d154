#pragma once
// One ball after the other, from a camera's observations: which are believed, when a ball is another one, and the
// filter between them. No allocation, no exceptions.
//
// An observation is believed where its innovation y, of covariance S, has y^T S^-1 y / 3 <= gate. After `max_rejected`
// in a row that are not, or `max_gap` without one that is, the track starts again with the newest.
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
