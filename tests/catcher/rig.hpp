#pragma once
// The catcher in the loop with its simulator, one control period at a time.
#include <functional>
#include <stance_msgs/ball_observation_t.hpp>
#include <string>
#include <vector>

#include "controller/compose.hpp"
#include "controller/io/lcm_bytes.hpp"
#include "controller/loop/wall_clock.hpp"
#include "sim/simulator.hpp"

namespace stance::test {

inline config::RobotDescription catcher() {
  return config::load_robot(config::share_directory() / "robots", "catcher");
}

/// One ball through the middle of the arm's reach, seen without noise.
inline sim::Scenario quiet() { return sim::load_scenario(catcher(), "quiet", 1); }

class CatcherRig {
 public:
  /// What the controller is told, changed on its way; an empty message is not told.
  std::function<void(stance_msgs::robot_state_t&)> spoil_state;
  std::function<void(stance_msgs::ball_observation_t&)> spoil_ball;
  bool told_state = true;

  explicit CatcherRig(const sim::Scenario& scenario = quiet(), const config::RobotDescription& robot = catcher())
      : simulator(robot, scenario, {.seed = 1, .run_id = 7, .start_utime = 0, .plant = {}}), ticker(compose(robot)) {}

  void tick() {
    if (const auto* command = simulator.user_command()) {
      static_cast<void>(ticker.offer_user_command(io::bytes_of(*command)));
    }
    if (const auto* points = simulator.calibration_points()) {
      static_cast<void>(ticker.offer_calibration(io::bytes_of(*points)));
    }
    if (const auto* seen = simulator.ball_observation()) {
      auto ball = *seen;
      if (spoil_ball) spoil_ball(ball);
      static_cast<void>(ticker.offer_ball(io::bytes_of(ball)));
    }
    auto state = simulator.state();
    if (spoil_state) spoil_state(state);
    if (told_state) static_cast<void>(ticker.offer_state(io::bytes_of(state)));
    ticker.tick(1, clock);
    for (const auto& [channel, message] : ticker.published()) {
      if (channel == std::string_view(io::channel::kCatchPlan)) {
        simulator.accept(io::decoded<stance_msgs::catch_plan_t>(message.bytes()));
      }
    }
    simulator.accept(io::decoded<stance_msgs::joint_command_t>(ticker.command().bytes()));
    simulator.advance();
  }
  void tick_until(double time) {
    while (simulator.time() < time - 1e-9) tick();
  }

  const CatchPlan& plan() const { return ticker.output().catching; }
  const BallEstimate& ball() const { return ticker.output().ball; }
  const Trace& trace() const { return ticker.output().trace; }
  JointVector true_q() const { return Eigen::Map<const JointVector>(simulator.truth().joint_position); }

  sim::Simulator simulator;
  loop::Ticker ticker;
  loop::NoClock clock;
};

}  // namespace stance::test
