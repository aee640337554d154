// Nothing that a control tick calls allocates. malloc itself is interposed: Eigen's own guard is off in release builds.
#include <catch2/catch_test_macros.hpp>
#include <cstddef>
#include <vector>

#include "controller/rigid_body/chain_dynamics.hpp"
#include "controller/rigid_body/inverse_kinematics.hpp"
#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/support/heap_calls.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::rigid_body;

TEST_CASE("HeapCallsAreCounted") {
  const long before = heap_calls;
  const volatile std::size_t size = 1000;  // so that the compiler cannot do without
  const std::vector<double> block(size);
  CHECK(block.size() == size);
  CHECK(heap_calls > before);
}

TEST_CASE("ChainsDoNotAllocate") {
  const Biped biped;
  Random random(7);
  const State state = random_state(biped.model, random);
  const ScrewTree tree = screw_tree(biped.model);
  const Tip tip = tip_on_link(biped.model, 4, {});
  PoseTask task;
  task.posture_weight.setOnes();
  task.weight << 0, 0, 0, 1, 1, 1;
  const JointVector seed = JointVector::Constant(0.2);
  task.target = tip_pose(tree, tip, 1.5 * seed);

  const long before = heap_calls;
  JointJacobian J;
  space_jacobian(tree, tip, state.q, J);
  const Vector6 V = J * state.qd;
  const auto least = inverse_velocity(J, V);
  const auto damped = inverse_velocity(J, V, 0.1);
  JointMatrix M, C;
  joint_mass_matrix(tree, state.q, M);
  coriolis_matrix(tree, state.q, state.qd, C);
  JointVector thetadd;
  const bool moved = forward_dynamics(tree, state.q, state.qd, state.q, {}, thetadd);
  const InverseKinematics found = inverse_kinematics(tree, tip, task, joint_limits(biped.model), {&seed, 1});
  const long after = heap_calls;

  CHECK(after == before);
  CHECK((moved && least.allFinite() && damped.allFinite() && C.allFinite()));
  CHECK(found.status == InverseKinematicsStatus::kReached);
}

TEST_CASE("KinematicsAndDynamicsDoNotAllocate") {
  const Biped biped;
  Random random(5);
  const State state = random_state(biped.model, random);
  const VectorNu nud = random_acceleration(biped.model, random);
  const kinematics::LegVector q = state.q.head<4>();

  const long before = heap_calls;
  Kinematics kinematics;
  forward_kinematics(biped.model, state, kinematics);
  Jacobian J;
  geometric_jacobian(biped.model, state, kinematics, 4, kinematics.com_W[4], J);
  VectorNu tau;
  inverse_dynamics(biped.model, state, nud, tau);
  gravity_torques(biped.model, state, tau);
  MatrixNu M;
  mass_matrix(biped.model, state, M);
  Centroidal c;
  centroidal(biped.model, kinematics, c);
  Matrix6Nu A_G;
  centroidal_momentum_matrix(biped.model, kinematics, A_G);
  // Products, as callers write them.
  const VectorNu momentum = M * velocity_of(biped.model, state);
  const MatrixNu square = M * M.transpose() - J.transpose() * A_G;
  for (const std::array<bool, 2> held : {std::array{true, true}, std::array{true, false}}) {
    (void)kinematics::biped_effective_inertia(biped.model, biped.feet, state, kinematics, held);
  }
  kinematics::LegKinematics leg;
  kinematics::leg_kinematics(biped.legs[0], q, leg);
  Vector3 p_BF;
  Eigen::Matrix<double, 3, 4> J_BF;
  kinematics::foot_in_base(biped.legs[0], q, p_BF, J_BF);
  kinematics::LegVector inverse;
  (void)kinematics::leg_ik(biped.legs[0], leg.foot, -0.25, inverse);
  const kinematics::LegVector null = kinematics::null_direction(leg.J_foot);
  const long after = heap_calls;

  CHECK(after == before);
  CHECK((momentum.allFinite() && square.allFinite() && null.allFinite()));
}
