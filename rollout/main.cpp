// stance-rollout: simulator and controller in one process, without sockets, as fast as the machine allows. The same
// messages, in the same order, as over LCM in lockstep: the same results, bit for bit. Its log lacks what the wall
// clock says there: CONTROLLER_TIMING, and the run's information each second.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <iostream>
#include <optional>
#include <string_view>
#include <vector>

#include "controller/compose.hpp"
#include "controller/io/lcm_bytes.hpp"
#include "controller/io/log.hpp"
#include "controller/io/run_info.hpp"
#include "controller/loop/wall_clock.hpp"
#include "controller/platform/program.hpp"
#include "rollout/summary.hpp"
#include "sim/node.hpp"
#include "sim/simulator.hpp"

int main(int argc, char** argv) {
  using namespace stance;
  CLI::App app{"Stance's simulator and controller in one process: a scenario as fast as the machine allows."};
  app.set_version_flag("--version", STANCE_VERSION);
  std::string robot_name, scenario_name, engine, plant_name, log_file;
  double duration = 0.0;
  std::uint64_t seed = 1;
  std::int64_t run_id = 1;
  bool json = false;
  app.add_option("--robot", robot_name, "robots/<robot>")->required();
  app.add_option("--scenario", scenario_name, "A name below sim/scenarios/<robot>/, or a .yaml file")->required();
  app.add_option("--duration", duration, "Seconds in place of the scenario's")->check(CLI::PositiveNumber);
  app.add_option("--seed", seed, "Of the scenario's random values and of the sensors' noise")->capture_default_str();
  app.add_option("--run-id", run_id, "Stands in every message")->capture_default_str();
  app.add_option("--solver", engine, "Engine of the force QP in place of the robot's own");
  app.add_option("--plant", plant_name, "multibody or single-body, in place of the scenario's");
  app.add_option("--log", log_file, "Write every message to this LCM log");
  app.add_flag("--json", json, "The summary as JSON");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  try {
    auto robot = config::load_robot(config::share_directory() / "robots", robot_name);
    if (!engine.empty()) robot.yaml_text = with_engine(robot.yaml_text, engine);
    const sim::Scenario scenario = sim::load_scenario(robot, scenario_name, seed);
    sim::SimulatorOptions options;
    options.seed = seed;
    options.run_id = run_id;
    if (!plant_name.empty()) {
      options.plant = sim::plant_from_name(plant_name);
      if (!options.plant)
        throw std::invalid_argument("--plant is '" + plant_name + "', but must be multibody or single-body");
    }
    sim::Simulator simulator(robot, scenario, options);
    loop::Ticker ticker(compose(robot));

    std::optional<io::LogWriter> log;
    if (!log_file.empty()) log.emplace(log_file);
    const auto record = [&](const char* channel, io::Bytes bytes) {
      if (log) log->write(simulator.state().utime, channel, bytes);
    };
    std::vector<std::uint8_t> state, bytes;
    const auto record_truth = [&] {
      if (!log) return;
      io::encode(simulator.truth(), bytes);
      record("TRUTH", bytes);
      if (const auto* ball = simulator.ball_truth()) {
        io::encode(*ball, bytes);
        record("BALL_TRUTH", bytes);
      }
    };
    const std::string command_line = platform::command_line(argc, argv);
    record("RUN_INFO_SIMULATOR", sim::encode_run_info(robot, scenario, options, command_line));
    record(io::channel::kRunInfo, io::encode(io::RunInfo{robot.name, command_line, robot.urdf_text, robot.yaml_text}));

    loop::WallClock clock;
    rollout::Observer observer(robot.model, scenario, simulator);
    const auto periods =
        static_cast<std::int64_t>(std::llround((duration > 0.0 ? duration : scenario.duration) / kControlPeriod));
    const auto start = std::chrono::steady_clock::now();
    for (std::int64_t k = 0; k < periods && !simulator.fallen(); ++k) {
      if (const auto* command = simulator.user_command()) {
        io::encode(*command, bytes);
        record(io::channel::kUserCommand, bytes);
        static_cast<void>(ticker.offer_user_command(bytes));
      }
      if (const auto* points = simulator.calibration_points()) {
        io::encode(*points, bytes);
        record(io::channel::kCalibrationPoints, bytes);
        static_cast<void>(ticker.offer_calibration(bytes));
      }
      if (const auto* ball = simulator.ball_observation()) {
        io::encode(*ball, bytes);
        record(io::channel::kBallObservation, bytes);
        static_cast<void>(ticker.offer_ball(bytes));
      }
      io::encode(simulator.state(), state);
      record(io::channel::kRobotState, state);
      record_truth();
      clock.start();
      static_cast<void>(ticker.offer_state(state));
      ticker.tick(1, clock);
      clock.finish();
      for (const auto& [channel, message] : ticker.published()) {
        record(channel, message.bytes());
        if (channel == std::string_view(io::channel::kForcePlan)) {
          simulator.accept(io::decoded<stance_msgs::force_plan_t>(message.bytes()));
        } else if (channel == std::string_view(io::channel::kCatchPlan)) {
          simulator.accept(io::decoded<stance_msgs::catch_plan_t>(message.bytes()));
        }
      }
      simulator.accept(io::decoded<stance_msgs::joint_command_t>(ticker.command().bytes()));
      simulator.advance();
      observer.period(ticker, clock.timing().cpu_us);
    }
    record_truth();
    const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const rollout::Summary summary = observer.summary(seed, wall);
    std::cout << (json ? as_json(summary) : as_text(summary));
    return summary.fallen() ? 1 : 0;
  } catch (const std::exception& error) {
    std::cerr << "stance-rollout: " << error.what() << "\n";
    return 2;
  }
}
