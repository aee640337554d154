// Times of the rigid-body core and of the closed-form arms on random states, beside pinocchio's where it has the like.
//
// Each figure is the fastest of many passes over the same states, ours and pinocchio's in turn, so that it is the
// algorithm's and not the machine's. What both compute is compared first: times of different answers say nothing.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "controller/config/catcher_config_yaml.hpp"
#include "controller/kinematics/arm3.hpp"
#include "controller/kinematics/arm5.hpp"
#include "controller/rigid_body/chain.hpp"
#include "controller/rigid_body/chain_dynamics.hpp"
#include "tests/bench/pinocchio_robot.hpp"

namespace {

using namespace stance;
using namespace stance::rigid_body;

constexpr int kStates = 1000;
constexpr int kPasses = 300;
constexpr double kAgreement = 1e-9;

/// What keeps the compiler from leaving a computation out.
double sink = 0.0;

/// ns a call, the fastest pass, of two works in turn. The second may be empty.
template <typename Ours, typename Theirs>
void measure(const char* name, const Ours& ours, const Theirs& theirs, bool has_peer) {
  using Clock = std::chrono::steady_clock;
  const auto pass = [](const auto& work) {
    const Clock::time_point start = Clock::now();
    for (int i = 0; i < kStates; ++i) sink += work(i);
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / kStates;
  };
  double best = std::numeric_limits<double>::infinity(), peer = best;
  for (int k = 0; k < kPasses; ++k) {
    best = std::min(best, pass(ours));
    if (has_peer) peer = std::min(peer, pass(theirs));
  }
  if (has_peer) {
    std::printf("%-44s %9.0f %9.0f %9.2f\n", name, best, peer, best / peer);
  } else {
    std::printf("%-44s %9.0f\n", name, best);
  }
}

template <typename Ours>
void measure(const char* name, const Ours& ours) {
  measure(
      name, ours, [](int) { return 0.0; }, false);
}

std::string read(const char* path) {
  std::ifstream file(std::string(STANCE_SOURCE_DIR "/") + path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::vector<JointVector> random_vectors(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> angle(-2.5, 2.5);
  std::vector<JointVector> out(kStates, JointVector::Zero());
  for (JointVector& v : out) {
    for (int i = 0; i < n; ++i) v(i) = angle(random);
  }
  return out;
}

bool agrees(const char* what, const Eigen::MatrixXd& ours, const Eigen::MatrixXd& theirs) {
  const double difference = (ours - theirs).cwiseAbs().maxCoeff();
  const bool good = difference <= kAgreement * (1.0 + theirs.cwiseAbs().maxCoeff());
  if (!good) std::printf("%s differs from pinocchio's by %g\n", what, difference);
  return good;
}

bool chain(const char* name, const Model& model) {
  const int n = model.num_joints;
  const ScrewTree tree = screw_tree(model);
  const Tip tip = tip_on_link(model, n, {});
  const std::vector<JointVector> q = random_vectors(n, 1), qd = random_vectors(n, 2), qdd = random_vectors(n, 3);
  bench::PinocchioRobot peer(model);

  const RigidTransform root{Matrix3::Identity(), model.bodies[0].com};
  JointJacobian J;
  JointMatrix M;
  const Load load;
  bool good = true;
  for (int i = 0; i < 20; ++i) {
    good = good && agrees("tip position", (root * tip_pose(tree, tip, q[i])).p, peer.tip_position(q[i]));
    good = good &&
           agrees("tau", inverse_dynamics(tree, q[i], qd[i], qdd[i], load).head(n), peer.rnea(q[i], qd[i], qdd[i]));
    joint_mass_matrix(tree, q[i], M);
    good = good && agrees("M", M, peer.mass_matrix(q[i]));
  }
  if (!good) return false;

  std::printf("%s, %d joints\n", name, n);
  measure(
      "  forward kinematics of the tip", [&](int i) { return tip_pose(tree, tip, q[i]).p.x(); },
      [&](int i) { return peer.tip_position(q[i]).x(); }, true);
  measure(
      "  body Jacobian of the tip",
      [&](int i) {
        body_jacobian(tree, tip, q[i], J);
        return J(3, 0);
      },
      [&](int i) { return peer.tip_jacobian(q[i]); }, true);
  measure(
      "  Newton-Euler", [&](int i) { return inverse_dynamics(tree, q[i], qd[i], qdd[i], load)(0); },
      [&](int i) { return peer.rnea(q[i], qd[i], qdd[i])(0); }, true);
  measure(
      "  mass matrix",
      [&](int i) {
        joint_mass_matrix(tree, q[i], M);
        return M(0, 0);
      },
      [&](int i) { return peer.mass_matrix(q[i])(0, 0); }, true);
  return true;
}

/// The catcher's planning of one tick.
void interception() {
  const auto robot = config::robot_from_texts(read("robots/catcher/catcher.yaml"), read("robots/catcher/catcher.urdf"));
  const behaviours::CatcherConfig config = config::catcher_config(robot);
  const kinematics::Arm5Geometry arm = kinematics::arm5_geometry(robot.model, config.tool);
  planning::Interception planner(config.planner, arm, config.motion);
  planning::JointMotion motion;
  motion.q = config.place;
  std::mt19937 random(6);
  std::uniform_real_distribution<double> aside(-0.2, 0.2), distance(2.5, 4.5), time(0.3, 0.9);
  std::vector<planning::BallState> balls;
  for (int i = 0; i < kStates; ++i) {
    const Vector3 from(distance(random), aside(random), 1.2);
    const Vector3 aim(0.55 + aside(random), aside(random), 0.8 + aside(random));
    const double flight = time(random);
    balls.push_back({from, (aim - from) / flight + 0.5 * flight * Vector3(0.0, 0.0, kGravity), 0.0});
  }
  std::printf("catcher\n");
  measure("  interception of a ball, planned", [&](int i) {
    planner.reset();
    return planner.update(0.0, balls[i], motion).time;
  });
}

}  // namespace

int main() {
  std::printf("%-44s %9s %9s %9s\n", "ns", "ours", "pinocchio", "ratio");
  const Model arm5 = model_from_urdf(read("tests/golden/arm5.urdf"), {"j1", "j2", "j3", "j4", "j5"});
  const Model biped = model_from_urdf(read("robots/biped/biped.urdf"),
                                      {"q0_l", "q1_l", "q2_l", "q3_l", "q0_r", "q1_r", "q2_r", "q3_r"});
  if (!chain("5-joint arm", arm5) || !chain("biped on a fixed trunk", biped)) return 1;

  const kinematics::Arm5Geometry geometry = kinematics::arm5_geometry(arm5, 0.251);
  const std::vector<JointVector> q = random_vectors(5, 4);
  std::vector<RigidTransform> pose, vertical;
  for (JointVector t : q) {
    pose.push_back(kinematics::arm5_forward(geometry, t.head<5>()));
    t(3) = std::numbers::pi - t(1) - t(2);  // the tool up: four solutions
    vertical.push_back(kinematics::arm5_forward(geometry, t.head<5>()));
  }
  std::printf("5-joint arm in closed form\n");
  measure("  forward kinematics", [&](int i) { return kinematics::arm5_forward(geometry, q[i].head<5>()).p.x(); });
  measure("  inverse kinematics, all 2 solutions",
          [&](int i) { return kinematics::arm5_ik(geometry, pose[i]).t[0](0); });
  measure("  the same of a vertical tool, all 4",
          [&](int i) { return kinematics::arm5_ik(geometry, vertical[i]).t[0](0); });
  measure("  by position, pitch and roll, up to 4",
          [&](int i) { return kinematics::arm5_ik(geometry, pose[i].p, q[i](0), 0.0).t[0](0); });
  interception();
  std::printf("3-joint arm in closed form\n");
  const kinematics::Arm3Geometry arm3;
  measure("  Jacobian and least-squares joint rates", [&](int i) {
    return kinematics::arm3_inverse_velocity(kinematics::arm3_jacobian(arm3, q[i].head<3>()), q[i].tail<6>())(0);
  });
  return sink == 0.5 ? 1 : 0;
}
