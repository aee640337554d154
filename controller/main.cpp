// stance-controller: arguments -> configuration -> loop.
#include <CLI/CLI.hpp>
#include <atomic>
#include <iomanip>
#include <iostream>

#include "controller/compose.hpp"
#include "controller/io/run_info.hpp"
#include "controller/loop/loop.hpp"
#include "controller/platform/program.hpp"
#include "controller/platform/real_time.hpp"
#include "controller/rigid_body/dynamics.hpp"

namespace {

/// The robot as this program reads it, as JSON: what a contract with other readers is checked against.
void describe(const stance::config::RobotDescription& robot) {
  const auto& model = robot.model;
  std::cout << std::setprecision(17) << "{\"robot\": \"" << robot.name << "\", \"total_mass\": " << model.total_mass
            << ", \"joints\": [";
  for (int i = 0; i < model.num_joints; ++i) {
    const auto& joint = model.joints[static_cast<std::size_t>(i)];
    std::cout << (i > 0 ? ", " : "") << "{\"name\": \"" << joint.name << "\", \"lower\": " << joint.lower
              << ", \"upper\": " << joint.upper << ", \"max_velocity\": " << joint.max_velocity
              << ", \"max_torque\": " << joint.max_torque << ", \"nominal\": " << robot.nominal_joint_position[i]
              << "}";
  }
  stance::rigid_body::State state;
  state.q = robot.nominal_joint_position;
  stance::rigid_body::Kinematics kinematics;
  stance::rigid_body::forward_kinematics(model, state, kinematics);
  std::cout << "], \"feet\": [";
  for (std::size_t i = 0; i < robot.feet.size(); ++i) {
    const auto link = static_cast<std::size_t>(robot.feet[i].body);
    const stance::Vector3 p_BF = kinematics.p_W[link] + kinematics.R_W[link] * robot.feet[i].tip;
    std::cout << (i > 0 ? ", " : "") << "{\"link\": \"" << robot.foot_links[i]
              << "\", \"radius\": " << robot.feet[i].radius << ", \"nominal_p_BF\": [" << p_BF.x() << ", " << p_BF.y()
              << ", " << p_BF.z() << "]}";
  }
  std::cout << "]}\n";
}

}  // namespace

int main(int argc, char** argv) {
  using namespace stance;
  CLI::App app{"Stance's controller: answers ROBOT_STATE with JOINT_COMMAND over LCM, every 10 ms."};
  app.set_version_flag("--version", STANCE_VERSION);
  std::string robot_name, url = platform::kDefaultLcmUrl, engine;
  bool lockstep = false, real_time = false, describe_only = false;
  int priority = 80, cpu = -1;
  loop::RealTimeConfig config;
  app.add_option("--robot", robot_name, "robots/<robot>")->required();
  auto* lockstep_flag = app.add_flag("--lockstep", lockstep, "Answer each state once, as fast as they come");
  app.add_flag("--realtime", real_time, "Tick on absolute deadlines (default)")->excludes(lockstep_flag);
  app.add_option("--solver", engine,
                 "Engine of the force QP in place of the robot's own: structured, osqp-condensed or osqp-sparse");
  app.add_option("--lcm-url", url, "LCM's network")->capture_default_str();
  app.add_option("--priority", priority, "SCHED_FIFO priority")->check(CLI::Range(1, 99))->capture_default_str();
  app.add_option("--cpu", cpu, "Core to pin to");
  app.add_option("--phase", config.phase, "Seconds from a state's stamp to the tick that takes it")
      ->check(CLI::Range(0.0, 0.009))
      ->capture_default_str();
  app.add_option("--state-wait", config.state_wait, "Seconds that a tick waits for a state that is late")
      ->check(CLI::Range(0.0, 0.008))
      ->capture_default_str();
  app.add_flag("--describe", describe_only, "Print the robot as it was read, as JSON, and end");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  try {
    auto robot = config::load_robot(config::share_directory() / "robots", robot_name);
    if (describe_only) {
      describe(robot);
      return 0;
    }
    if (!engine.empty()) robot.yaml_text = with_engine(robot.yaml_text, engine);
    loop::Ticker ticker(compose(robot));
    const auto run_info =
        io::encode(io::RunInfo{robot.name, platform::command_line(argc, argv), robot.urdf_text, robot.yaml_text});

    const std::atomic<bool>& stop = platform::stop_on_signals();
    if (lockstep) {
      io::Transport transport(url);
      loop::run_lockstep(ticker, transport, run_info, stop);
    } else {
      const std::string refused = platform::enter_real_time(priority, cpu);
      if (!refused.empty()) std::cerr << "stance-controller: without real-time privileges (" << refused << ")\n";
      io::Transport transport(url);
      loop::run_real_time(ticker, transport, run_info, config, stop);
    }
  } catch (const std::exception& error) {
    std::cerr << "stance-controller: " << error.what() << "\n";
    return 2;
  }
  return 0;
}
