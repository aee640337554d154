#pragma once
// The biped of robots/biped as the tests of this folder use it, and seeded random states of it.
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "controller/kinematics/leg.hpp"
#include "controller/rigid_body/dynamics.hpp"

namespace stance::test {

inline std::string read_file(const std::string& path_in_source) {
  std::ifstream file(STANCE_SOURCE_DIR "/" + path_in_source);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

struct Biped {
  std::string urdf = read_file("robots/biped/biped.urdf");
  rigid_body::Model model =
      rigid_body::model_from_urdf(urdf, {"q0_l", "q1_l", "q2_l", "q3_l", "q0_r", "q1_r", "q2_r", "q3_r"});
  std::vector<rigid_body::Foot> feet = rigid_body::feet_from_urdf(urdf, model, {"tarsus_l", "tarsus_r"});
  std::array<kinematics::LegGeometry, 2> legs = kinematics::leg_geometries(model, feet);
};

/// A tree whose bodies have their masses off their axes, full inertias, skew joint axes and a fork: nothing is zero by
/// luck.
inline const std::string kSkewTreeUrdf = R"(<robot name="skew_tree">
  <link name="root"><inertial><origin xyz="0.1 -0.2 0.05" rpy="0.1 0.2 0.3"/><mass value="3"/>
    <inertia ixx="0.05" iyy="0.06" izz="0.07" ixy="0.004" ixz="-0.003" iyz="0.002"/></inertial></link>
  <link name="a"><inertial><origin xyz="0.02 0.1 -0.03" rpy="0.3 -0.2 0.1"/><mass value="1.5"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.002" ixz="0.001" iyz="-0.003"/></inertial></link>
  <link name="b"><inertial><origin xyz="-0.05 0.06 0.07"/><mass value="0.8"/>
    <inertia ixx="0.01" iyy="0.012" izz="0.011" ixy="0.001" ixz="0.0005" iyz="0.0007"/></inertial></link>
  <link name="c"><inertial><origin xyz="0.03 -0.04 0.08"/><mass value="0.6"/>
    <inertia ixx="0.008" iyy="0.007" izz="0.009" ixy="-0.0006" ixz="0.0004" iyz="0.0003"/></inertial></link>
  <joint name="j_a" type="revolute"><parent link="root"/><child link="a"/><origin xyz="0.1 0.2 0.3" rpy="0.5 -0.4 0.3"/>
    <axis xyz="0.3 0.5 -0.8"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
  <joint name="j_b" type="revolute"><parent link="a"/><child link="b"/><origin xyz="-0.1 0.15 0.2" rpy="-0.7 0.2 0.9"/>
    <axis xyz="1 0.2 0.1"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
  <joint name="j_c" type="revolute"><parent link="a"/><child link="c"/><origin xyz="0.2 -0.1 0.1" rpy="0.3 0.8 -0.2"/>
    <axis xyz="-0.2 1 0.4"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
</robot>)";

inline rigid_body::Model skew_tree() { return rigid_body::model_from_urdf(kSkewTreeUrdf, {"j_a", "j_b", "j_c"}); }

/// Uniform numbers from a fixed seed.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vector3 vector(double size) { return {number(-size, size), number(-size, size), number(-size, size)}; }

 private:
  std::mt19937 engine_;
};

/// Any attitude, joints anywhere, everything in motion.
inline rigid_body::State random_state(const rigid_body::Model& model, Random& random) {
  rigid_body::State state;
  state.p_WB = random.vector(2.0);
  state.R_WB = math::exp_so3(random.vector(2.0));
  state.v_WB = random.vector(2.0);
  state.w_WB_W = random.vector(3.0);
  for (int i = 0; i < model.num_joints; ++i) {
    state.q(i) = random.number(-2.0, 2.0);
    state.qd(i) = random.number(-5.0, 5.0);
  }
  return state;
}

inline rigid_body::VectorNu random_acceleration(const rigid_body::Model& model, Random& random) {
  rigid_body::VectorNu nud(6 + model.num_joints);
  for (int i = 0; i < nud.size(); ++i) nud(i) = random.number(-10.0, 10.0);
  return nud;
}

/// (w_WB_W, v_WB, qd).
inline rigid_body::VectorNu velocity_of(const rigid_body::Model& model, const rigid_body::State& state) {
  rigid_body::VectorNu nu(6 + model.num_joints);
  nu << state.w_WB_W, state.v_WB, state.qd.head(model.num_joints);
  return nu;
}

/// The position that the velocity nu reaches from `state` in time t, all else unchanged.
inline rigid_body::State moved(const rigid_body::Model& model, const rigid_body::State& state,
                               const rigid_body::VectorNu& nu, double t) {
  rigid_body::State out = state;
  out.R_WB = math::exp_so3(nu.head<3>() * t) * state.R_WB;
  out.p_WB += nu.segment<3>(3) * t;
  out.q.head(model.num_joints) += nu.tail(model.num_joints) * t;
  return out;
}

/// The state a time t later (t small) under the acceleration nud: positions to second order, velocities to first.
inline rigid_body::State accelerated(const rigid_body::Model& model, const rigid_body::State& state,
                                     const rigid_body::VectorNu& nud, double t) {
  rigid_body::State out = moved(model, state, velocity_of(model, state) + nud * (0.5 * t), t);
  out.w_WB_W += nud.head<3>() * t;
  out.v_WB += nud.segment<3>(3) * t;
  out.qd.head(model.num_joints) += nud.tail(model.num_joints) * t;
  return out;
}

inline rigid_body::Kinematics kinematics_of(const rigid_body::Model& model, const rigid_body::State& state) {
  rigid_body::Kinematics kinematics;
  rigid_body::forward_kinematics(model, state, kinematics);
  return kinematics;
}

}  // namespace stance::test
