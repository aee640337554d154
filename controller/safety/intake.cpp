#include "controller/safety/intake.hpp"

#include <cmath>

#include "controller/interface/require.hpp"

namespace stance::safety {

void IntakeConfig::validate() const {
  validation.validate();
  Require{""}(user_command_timeout >= kControlPeriod, "user_command_timeout", user_command_timeout, ">= 0.01 s");
}

bool Offer::includes(const UserCommand& command) const noexcept {
  const int behaviour = static_cast<int>(command.behaviour);
  return behaviour >= 0 && behaviour < 32 && (behaviours >> behaviour & 1U) != 0 &&
         command.height_offset >= height_offset[0] && command.height_offset <= height_offset[1];
}

Intake::Intake(const IntakeConfig& config, const rigid_body::Model& model, int num_contacts, const Offer& offer)
    : config_(config), model_(model), num_contacts_(num_contacts), offer_(offer) {
  config_.validate();
}

void Intake::start_run(std::int64_t run_id) noexcept {
  run_id_ = run_id;
  state_seq_ = 0;
  state_utime_ = -1;
  command_ = UserCommand{};
  command_age_ = 0;
}

bool Intake::accept(const TickInput& input, FaultLadder& ladder) noexcept {
  if (input.operator_stop) ladder.report(Fault::kOperatorStop);
  take_command(input, ladder);
  if (!input.state_is_new) {
    ladder.report(Fault::kStateStale);
    return false;
  }
  const RobotState& state = input.state;
  if (!follows(state) || !state_is_plausible(config_.validation, model_, num_contacts_, state)) {
    ladder.report(Fault::kStateInvalid);
    return false;
  }
  state_seq_ = state.seq;
  state_utime_ = state.utime;
  return true;
}

void Intake::take_command(const TickInput& input, FaultLadder& ladder) noexcept {
  const UserCommand& command = input.user_command;
  command_age_ += input.periods;
  if (command.seq != command_.seq) {
    if (command_is_plausible(command) && offer_.includes(command)) {
      command_ = command;
      command_age_ = 0;
    } else {
      command_.seq = command.seq;
      ladder.report(Fault::kCommandInvalid);
    }
  }
  // An operator who is heard no more wants nothing: not what was wanted last. A robot on its way down goes on.
  const bool silent = kControlPeriod * static_cast<double>(command_age_) > config_.user_command_timeout;
  if (silent && command_.behaviour != Behaviour::kLieDown) command_.behaviour = Behaviour::kStand;
  if (command_.behaviour != Behaviour::kWalk) {
    command_.velocity.setZero();
    command_.yaw_rate = 0.0;
  }
}

bool Intake::follows(const RobotState& state) const noexcept {
  if (state.seq <= state_seq_ || state.utime <= state_utime_) return false;
  if (state_seq_ == 0) return true;
  // A number or a stamp far off would make every later state one out of order.
  constexpr double period_us = kControlPeriod * 1e6;
  const double periods = static_cast<double>(state.seq) - static_cast<double>(state_seq_);
  const double elapsed_us = static_cast<double>(state.utime) - static_cast<double>(state_utime_);
  return std::abs(elapsed_us - periods * period_us) < 0.5 * period_us;
}

}  // namespace stance::safety
