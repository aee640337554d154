#include "controller/behaviours/catcher_config.hpp"

#include <cmath>

#include "controller/interface/require.hpp"

namespace stance::behaviours {

void CatcherConfig::validate() const {
  filter.validate();
  planner.validate();
  fault_ladder.validate();
  intake.validate();
  const Require require{""};
  const auto above = [&](double value, const char* field, double least, const char* range) {
    require(std::isfinite(value) && value > least, field, value, range);
  };
  above(max_calibration_rms, "calibration.max_rms", 0.0, "> 0 m");
  above(track.gate, "filter.gate", 1.0, "> 1, the mean of the NIS");
  require(track.max_rejected >= 1, "filter.max_rejected", track.max_rejected, ">= 1");
  above(track.max_gap, "filter.max_gap", 0.0, "> 0 s");
  require(track.min_observations >= 2, "filter.min_observations", track.min_observations, ">= 2");
  require(track.clear_of_cup >= 0.0, "filter.clear_of_cup", track.clear_of_cup, ">= 0 m");
  require(track.aim.allFinite(), "filter.aim's norm", track.aim.norm(), "finite");
  above(track.aim_sigma, "filter.aim_sigma", 0.0, "> 0 m");
  require(course.give >= 0.0 && course.give < 1.0, "catch.give", course.give, "in 0..1");
  require(course.max_give >= 0.0, "catch.max_give", course.max_give, ">= 0 m/s");
  require(course.give_sigma >= 0.0, "catch.give_sigma", course.give_sigma, ">= 0 m");
  above(course.settle, "catch.settle", 0.0, "> 0 s");
  above(course.upright_time, "catch.upright_time", 0.0, "> 0 s");
  require(course.hold_time >= course.settle, "catch.hold_time", course.hold_time, ">= catch.settle");
  above(course.return_time, "catch.return_time", 0.0, "> 0 s");
  above(computed_torque.kp, "computed_torque.kp", 0.0, "> 0");
  above(computed_torque.kd, "computed_torque.kd", 0.0, "> 0");
  require(computed_torque.lead >= 0.0 && computed_torque.lead < 0.05, "computed_torque.lead", computed_torque.lead,
          "in 0..0.05 s");
}

}  // namespace stance::behaviours
