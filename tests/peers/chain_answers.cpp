// What the rigid-body core says of a fixed-base robot, for test_rigid_body.py to compare with other libraries:
//   chain_answers URDF LINK x y z JOINT...   the tip at (x, y, z) m of LINK's frame
// Each line of stdin holds theta, thetad, thetadd (n each) and F_tip (6, angular first, in the tip's frame); each line
// of stdout, rows of matrices one after the other, in the root link's frame where nothing else is said:
//   T (12: R, p)   J_b (6 n)   J_s of the tip (6 n)   tau (n)   M (n n)   C thetad (n)   g (n)   thetadd of tau (n)
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "controller/rigid_body/chain.hpp"
#include "controller/rigid_body/chain_dynamics.hpp"

using namespace stance;
using namespace stance::rigid_body;

namespace {

template <typename Derived>
void put(const Eigen::MatrixBase<Derived>& values) {
  for (Eigen::Index r = 0; r < values.rows(); ++r) {
    for (Eigen::Index c = 0; c < values.cols(); ++c) std::printf("%.17g ", values(r, c));
  }
}

bool read(Eigen::Ref<Eigen::VectorXd> values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (!(std::cin >> values(i))) return false;
  }
  return true;
}

void answer(const std::vector<std::string>& words) {
  std::ifstream file(words.at(0));
  const std::string urdf{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const Model model = model_from_urdf(urdf, {words.begin() + 5, words.end()});
  const int n = model.num_joints;
  const Vector3 tip_L(std::stod(words.at(2)), std::stod(words.at(3)), std::stod(words.at(4)));
  const ScrewTree tree = screw_tree(model);
  const Tip tip = tip_on_link(model, model.body_index(words.at(1)), {Matrix3::Identity(), tip_L});
  // The tree's base frame is at the root's centre of mass.
  const RigidTransform root{Matrix3::Identity(), model.bodies[0].com};

  JointVector theta = JointVector::Zero(), thetad = theta, thetadd = theta;
  Load load;
  load.tip = tip;
  while (read(theta.head(n)) && read(thetad.head(n)) && read(thetadd.head(n)) && read(load.F_tip)) {
    JointJacobian J_b, J_s;
    const RigidTransform T = root * body_jacobian(tree, tip, theta, J_b);
    space_jacobian(tree, tip, theta, J_s);
    for (int i = 0; i < n; ++i) J_s.col(i) = math::adjoint_times(root, J_s.col(i));
    const JointVector tau = inverse_dynamics(tree, theta, thetad, thetadd, load);
    JointMatrix M, C;
    joint_mass_matrix(tree, theta, M);
    coriolis_matrix(tree, theta, thetad, C);
    JointVector found;
    if (!forward_dynamics(tree, theta, thetad, tau, load, found)) found.setConstant(NAN);
    put(T.R);
    put(T.p);
    put(J_b);
    put(J_s);
    put(tau.head(n));
    put(M);
    put(C * thetad.head(n));
    put(joint_gravity(tree, theta, load.gravity).head(n));
    put(found.head(n));
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    answer({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "chain_answers: %s\n", error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
