// Another project's use of the installed libraries: one force QP, and the biped's controller composed.
#include <controller/compose.hpp>
#include <controller/force_qp/force_qp.hpp>
#include <cstdio>

int main() {
  const auto qp = stance::force_qp::make_force_qp({}, {1, 2}, 130.0);
  const auto robot = stance::config::load_robot(stance::config::share_directory() / "robots", "biped");
  const auto controller = stance::compose(robot);
  std::printf("%.6f\n", robot.model.total_mass);
  return qp && controller.tick ? 0 : 1;
}
