// What a tick acts on, and what it refuses.
#include "controller/safety/intake.hpp"

#include <catch2/catch_test_macros.hpp>

#include "tests/loop/arm3_rig.hpp"

namespace stance::safety {
namespace {

constexpr IntakeConfig kConfig{{1.0, 50.0, 0.1, 2.0}, 0.05};

constexpr Offer kAll{behaviour_bits({Behaviour::kStand, Behaviour::kWalk, Behaviour::kLieDown, Behaviour::kTrack})};
constexpr Offer kStanding{behaviour_bits({Behaviour::kStand}), {-0.2, 0.1}};

struct Bench {
  explicit Bench(const Offer& offer = kAll) : intake(kConfig, model, 0, offer) { intake.start_run(7); }

  /// One tick, a period after the last.
  bool tick(std::int64_t seq, bool is_new = true) {
    input.state.seq = seq;
    input.state.utime = seq * 10'000;
    input.state.run_id = 7;
    input.state.num_joints = model.num_joints;
    input.state.sample_period = 0.005;
    input.state_is_new = is_new;
    const bool taken = intake.accept(input, ladder);
    ladder.step(1);
    return taken;
  }
  bool told(Fault fault) const { return (ladder.faults() & (1U << static_cast<int>(fault))) != 0; }

  rigid_body::Model model = test::arm3().model;
  FaultLadder ladder{{0.03, 3.0}};
  Intake intake;
  TickInput input;
};

}  // namespace

TEST_CASE("StatesAreTakenOnceAndInOrder") {
  Bench bench;
  CHECK(bench.tick(1));
  CHECK(bench.tick(2));
  CHECK_FALSE(bench.tick(2));
  CHECK(bench.told(Fault::kStateInvalid));
  CHECK_FALSE(bench.tick(1));
  CHECK_FALSE(bench.tick(3, false));
  CHECK(bench.told(Fault::kStateStale));
  CHECK(bench.tick(5));
  CHECK(bench.ladder.faults() == 0);
}

TEST_CASE("AStateFarFromItsStampIsRefusedAndTheNextGoodOneTaken") {
  Bench bench;
  REQUIRE(bench.tick(1));
  bench.input.state.seq = 1'000'000;
  bench.input.state.utime = 20'000;
  CHECK_FALSE(bench.intake.accept(bench.input, bench.ladder));
  CHECK(bench.tick(2));
}

TEST_CASE("AStateThatIsNotThisRobotsIsRefused") {
  Bench bench;
  bench.input.state.num_contacts = 2;
  CHECK_FALSE(bench.tick(1));
  CHECK(bench.told(Fault::kStateInvalid));
}

TEST_CASE("AWishLastsUntilItsTimeoutAndThenNothingIsWanted") {
  Bench bench;
  bench.input.user_command.seq = 1;
  bench.input.user_command.behaviour = Behaviour::kWalk;
  bench.input.user_command.velocity = {0.2, 0.1};
  for (int k = 1; k <= 6; ++k) {  // 0.05 s after it came
    bench.tick(k);
    CHECK(bench.intake.user_command().behaviour == Behaviour::kWalk);
    CHECK(bench.intake.user_command().velocity.x() == 0.2);
  }
  bench.tick(7);
  CHECK(bench.intake.user_command().behaviour == Behaviour::kStand);
  CHECK(bench.intake.user_command().velocity.isZero());
  bench.input.user_command.seq = 2;
  bench.tick(8);
  CHECK(bench.intake.user_command().behaviour == Behaviour::kWalk);
}

TEST_CASE("TheWishToLieDownOutlastsItsOperatorAndHasNoVelocity") {
  Bench bench;
  bench.input.user_command.seq = 1;
  bench.input.user_command.behaviour = Behaviour::kLieDown;
  bench.input.user_command.velocity = {0.2, 0.1};
  for (int k = 1; k <= 20; ++k) {
    bench.tick(k);
    CHECK(bench.intake.user_command().behaviour == Behaviour::kLieDown);
    CHECK(bench.intake.user_command().velocity.isZero());
  }
}

TEST_CASE("AWishThatIsNotOfferedIsToldOnceAndTheLastOneStays") {
  Bench bench(kStanding);
  bench.input.user_command.seq = 1;
  bench.input.user_command.height_offset = 0.1;
  bench.tick(1);
  bench.input.user_command.seq = 2;
  bench.input.user_command.behaviour = Behaviour::kWalk;
  bench.tick(2);
  CHECK(bench.told(Fault::kCommandInvalid));
  CHECK(bench.intake.user_command().height_offset == 0.1);
  bench.tick(3);
  CHECK_FALSE(bench.told(Fault::kCommandInvalid));
  bench.input.user_command.seq = 3;
  bench.input.user_command.behaviour = Behaviour::kStand;
  bench.input.user_command.height_offset = 0.11;
  bench.tick(4);
  CHECK(bench.told(Fault::kCommandInvalid));
  bench.intake.offer({behaviour_bits({Behaviour::kWalk}), {0.11, 0.11}});
  bench.input.user_command.seq = 4;
  bench.input.user_command.behaviour = Behaviour::kWalk;
  bench.tick(5);
  CHECK(bench.ladder.faults() == 0);
  CHECK(bench.intake.user_command().behaviour == Behaviour::kWalk);
}

TEST_CASE("ANewRunIsSeenAndForgetsWhatWasTaken") {
  Bench bench;
  bench.input.user_command.seq = 4;
  bench.input.user_command.behaviour = Behaviour::kTrack;
  bench.tick(9);
  RobotState other = bench.input.state;
  CHECK_FALSE(bench.intake.starts_run(other));
  other.run_id = 8;
  CHECK(bench.intake.starts_run(other));
  bench.intake.start_run(8);
  CHECK(bench.intake.user_command().behaviour == Behaviour::kStand);
  bench.input.user_command = UserCommand{};
  CHECK(bench.tick(1));
}

TEST_CASE("AnOperatorsStopIsReported") {
  Bench bench;
  bench.input.operator_stop = true;
  bench.tick(1);
  CHECK(bench.told(Fault::kOperatorStop));
}

TEST_CASE("ATimeoutShorterThanAPeriodIsRefusedByName") {
  IntakeConfig config = kConfig;
  config.user_command_timeout = 0.001;
  CHECK_THROWS_AS(config.validate(), std::invalid_argument);
}

}  // namespace stance::safety
