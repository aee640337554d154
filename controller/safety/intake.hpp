#pragma once
// What a tick acts on: states that are plausible and come in order, and the operator's last word for as long as it
// counts. What is refused becomes a fault of the ladder.
#include <array>
#include <cstdint>
#include <initializer_list>
#include <limits>

#include "controller/safety/fault_ladder.hpp"
#include "controller/safety/validation.hpp"

namespace stance::safety {

struct IntakeConfig {
  ValidationConfig validation;
  double user_command_timeout =
      0.0;                ///< s without a user command, after which kStand is wanted, unless it was kLieDown
  void validate() const;  ///< throws std::invalid_argument naming the field, its value and the range
};

/// What an operator may ask the robot for.
struct Offer {
  static constexpr double kAny = std::numeric_limits<double>::max();

  std::uint32_t behaviours = 0;                      ///< bit i: Behaviour i
  std::array<double, 2> height_offset{-kAny, kAny};  ///< m, least and most

  bool includes(const UserCommand& command) const noexcept;
};
constexpr std::uint32_t behaviour_bits(std::initializer_list<Behaviour> behaviours) noexcept {
  std::uint32_t bits = 0;
  for (const Behaviour behaviour : behaviours) bits |= 1U << static_cast<int>(behaviour);
  return bits;
}

class Intake {
 public:
  /// `model` outlives the intake. Throws std::invalid_argument.
  Intake(const IntakeConfig& config, const rigid_body::Model& model, int num_contacts, const Offer& offer);

  /// Is the state of another run than the last one? Then start_run comes before accept.
  bool starts_run(const RobotState& state) const noexcept { return stance::starts_run(run_id_, state_seq_, state); }
  /// Forgets what was taken.
  void start_run(std::int64_t run_id) noexcept;
  /// From now on, until it is told otherwise.
  void offer(const Offer& offer) noexcept { offer_ = offer; }

  /// Takes what came: false where there is no state to act on.
  bool accept(const TickInput& input, FaultLadder& ladder) noexcept;

  /// What is wanted; a velocity only with kWalk.
  const UserCommand& user_command() const noexcept { return command_; }

 private:
  void take_command(const TickInput& input, FaultLadder& ladder) noexcept;
  bool follows(const RobotState& state) const noexcept;

  IntakeConfig config_;
  const rigid_body::Model& model_;
  int num_contacts_;
  Offer offer_;
  std::int64_t run_id_ = 0;
  std::int64_t state_seq_ = 0;     ///< last state taken
  std::int64_t state_utime_ = -1;  ///< us
  UserCommand command_;
  std::int64_t command_age_ = 0;  ///< control periods since it came, by the ticks
};

}  // namespace stance::safety
