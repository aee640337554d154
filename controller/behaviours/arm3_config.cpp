#include "controller/behaviours/arm3_config.hpp"

#include "controller/interface/require.hpp"

namespace stance::behaviours {

void Arm3Config::validate() const {
  constexpr Require require{"track."};
  constexpr double longest = 1000.0;  // s
  require(track.smooth_duration > 0.0 && track.smooth_duration <= longest, "smooth.duration", track.smooth_duration,
          "in 0..1000 s");
  require(track.limit_margin >= 0.0, "limit_margin", track.limit_margin, ">= 0 rad");
  require(track.kp >= 0.0, "kp", track.kp, ">= 0");
  require(track.kd >= 0.0, "kd", track.kd, ">= 0");
  require(track.lead >= 0.0 && track.lead <= 2.0 * kControlPeriod, "lead", track.lead, "in 0..0.02 s");
  intake.validate();
  fault_ladder.validate();
}

}  // namespace stance::behaviours
