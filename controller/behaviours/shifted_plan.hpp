#pragma once
// What stands in for a force plan that could not be made: the last one, as far as time has gone on in it.
#include "controller/interface/signals.hpp"

namespace stance::behaviours {

/// Moves `plan` on by `elapsed` [s]: stages that are over go, the one that has begun keeps what is left of it, and
/// after the end the last one stays. Where the contacts of the stage that is due are not `present`, the nearest stage
/// that has them takes its place: a foot that landed early bears as planned for later, one that is late as planned
/// before. False, and `plan` as it was, where no stage has them. `effort` stays that of the stage which was first when
/// it was planned.
[[nodiscard]] bool shift_plan(ForcePlan& plan, double elapsed, const ContactFlags& present) noexcept;

}  // namespace stance::behaviours
