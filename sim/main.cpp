// stance-sim: the simulator as a program, in place of the robot.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>

#include "controller/platform/program.hpp"
#include "controller/platform/real_time.hpp"
#include "sim/node.hpp"

namespace {

void print_summary(const stance::sim::Simulator& simulator, const stance::sim::NodeReport& report, bool real_time) {
  const auto& refused = simulator.refused();
  std::fprintf(stderr, "stance-sim: %.2f s simulated; ", simulator.time());
  if (simulator.truth().num_contacts > 0) {
    const char* fate = simulator.fallen() ? "fell" : simulator.lying() ? "lay down" : "did not fall";
    std::fprintf(stderr, "the robot %s; ", fate);
  }
  std::fprintf(stderr, "%lld commands refused", static_cast<long long>(refused.total()));
  if (refused.total() > 0) {
    std::fprintf(stderr, " (stale %lld, not finite %lld, order %lld, run %lld)", static_cast<long long>(refused.stale),
                 static_cast<long long>(refused.not_finite), static_cast<long long>(refused.order),
                 static_cast<long long>(refused.run));
  }
  std::fprintf(stderr, "; drives damped %lld times", static_cast<long long>(report.times_damped));
  if (real_time) {
    std::fprintf(stderr, "; %lld instants late, worst by %.2f ms; %lld periods slipped",
                 static_cast<long long>(report.late_instants), report.worst_lateness * 1e3,
                 static_cast<long long>(report.slipped_periods));
  }
  std::fprintf(stderr, "\n");
}

}  // namespace

int main(int argc, char** argv) {
  using namespace stance;
  CLI::App app{"Stance's simulator: a robot in Bullet, that speaks as the robot would over LCM."};
  app.set_version_flag("--version", STANCE_VERSION);
  std::string robot_name, scenario_name, plant_name, url = platform::kDefaultLcmUrl;
  bool lockstep = false, real_time = false;
  double duration = 0.0;
  int priority = 60, cpu = -1;
  sim::SimulatorOptions options;
  options.run_id =
      std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
          .count();
  app.add_option("--robot", robot_name, "robots/<robot>")->required();
  app.add_option("--scenario", scenario_name, "A name below sim/scenarios/<robot>/, or a .yaml file")->required();
  auto* lockstep_flag = app.add_flag("--lockstep", lockstep, "Wait for the command that answers each state");
  app.add_flag("--realtime", real_time, "On the clock's grid, waiting for nobody (default)")->excludes(lockstep_flag);
  app.add_option("--duration", duration, "Seconds in place of the scenario's")->check(CLI::PositiveNumber);
  app.add_option("--seed", options.seed, "Of the scenario's random values and of the sensors' noise")
      ->capture_default_str();
  app.add_option("--plant", plant_name, "multibody or single-body, in place of the scenario's")
      ->check(CLI::IsMember({"multibody", "single-body"}));
  auto* run_id =
      app.add_option("--run-id", options.run_id, "Stands in every message (default: the time of day; 1 in lockstep)");
  app.add_option("--lcm-url", url, "LCM's network")->capture_default_str();
  app.add_option("--priority", priority, "SCHED_FIFO priority")->check(CLI::Range(1, 99))->capture_default_str();
  app.add_option("--cpu", cpu, "Core to pin to");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  if (lockstep && run_id->count() == 0) options.run_id = 1;  // the same bits each time

  try {
    const auto robot = config::load_robot(config::share_directory() / "robots", robot_name);
    const sim::Scenario scenario = sim::load_scenario(robot, scenario_name, options.seed);
    if (!plant_name.empty()) options.plant = sim::plant_from_name(plant_name);
    const auto periods =
        static_cast<std::int64_t>(std::llround((duration > 0.0 ? duration : scenario.duration) / kControlPeriod));
    if (!lockstep) {
      const std::string refused = platform::enter_real_time(priority, cpu);
      if (!refused.empty()) std::cerr << "stance-sim: without real-time privileges (" << refused << ")\n";
    }
    lcm::LCM lcm(url);
    if (!lcm.good()) {
      std::cerr << "stance-sim: no LCM on " << url
                << ": give this machine a multicast route, as 'ip link set lo multicast on; ip route add 224.0.0.0/4 "
                   "dev lo'\n";
      return 2;
    }
    const std::atomic<bool>& stop = platform::stop_on_signals();

    constexpr std::int64_t settle_ns = 100'000'000;  // from here to the first instant
    constexpr std::int64_t us_ns = 1000;
    const std::int64_t start_utime = (platform::monotonic_ns() + settle_ns) / us_ns;
    if (!lockstep) options.start_utime = start_utime;
    sim::Simulator simulator(robot, scenario, options);
    sim::Node node(lcm, simulator, sim::encode_run_info(robot, scenario, options, platform::command_line(argc, argv)));
    const sim::NodeReport report = lockstep ? node.run_lockstep(periods, sim::LockstepTiming{}, stop)
                                            : node.run_real_time(periods, start_utime * us_ns, stop);
    if (report.ending == sim::Ending::kSilence) {
      std::cerr << "stance-sim: nobody answered state " << simulator.state().seq
                << ": is a controller running with --lockstep on " << url << "?\n";
    }
    print_summary(simulator, report, !lockstep);
    return simulator.fallen() || report.ending == sim::Ending::kSilence ? 1 : 0;
  } catch (const std::exception& error) {
    std::cerr << "stance-sim: " << error.what() << "\n";
    return 2;
  }
}
