#include "controller/behaviours/catcher_config.hpp"

#include <cmath>

#include "controller/interface/require.hpp"

namespace stance::behaviours {

void CatcherConfig::validate() const {
  filter.validate();
  planner.validate();
  fault_ladder.validate();
  validation.validate();
  const Require require{""};
  const auto above = [&](double value, const char* field, double least, const char* range) {
    require(std::isfinite(value) && value > least, field, value, range);
  };
  require(user_command_timeout >= kControlPeriod, "user_command_timeout", user_command_timeout, ">= 0.01 s");
  above(max_calibration_rms, "calibration.max_rms", 0.0, "> 0 m");
  above(track.gate, "filter.gate", 1.0, "> 1, the mean of the NIS");
  require(track.max_rejected >= 1, "filter.max_rejected", track.max_rejected, ">= 1");
  above(track.max_gap, "filter.max_gap", 0.0, "> 0 s");
  require(track.min_observations >= 2, "filter.min_observations", track.min_observations, ">= 2");
  require(track.clear_of_cup >= 0.0, "filter.clear_of_cup", track.clear_of_cup, ">= 0 m");
  require(course.arrive_early >= 0.0 && course.arrive_early < planner.commit, "catch.arrive_early", course.arrive_early,
          "in 0 .. planner.commit");
  require(course.settle >= 0.0, "catch.settle", course.settle, ">= 0 s");
  above(course.upright_time, "catch.upright_time", 0.0, "> 0 s");
  require(course.hold_time >= course.settle, "catch.hold_time", course.hold_time, ">= catch.settle");
  above(course.return_time, "catch.return_time", 0.0, "> 0 s");
  above(computed_torque.kp, "computed_torque.kp", 0.0, "> 0");
  above(computed_torque.kd, "computed_torque.kd", 0.0, "> 0");
  require(computed_torque.lead >= 0.0 && computed_torque.lead < 0.05, "computed_torque.lead", computed_torque.lead,
          "in 0..0.05 s");
}

}  // namespace stance::behaviours
