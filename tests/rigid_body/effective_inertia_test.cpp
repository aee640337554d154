// The inertia that a standing robot's trunk shows.
#include <catch2/catch_test_macros.hpp>
#include <cmath>

#include "tests/rigid_body/biped_fixture.hpp"
#include "tests/support/golden.hpp"

using namespace stance;
using namespace stance::test;
using namespace stance::rigid_body;

namespace {

constexpr double kExact = 1e-10;
constexpr double kPrototype = 1e-7;  ///< kg m^2: the step of the prototype's finite differences
constexpr unsigned kSeed = 41;

/// Feet 0.62 m below the hips' pitch axes, under the centre of mass.
State nominal() {
  State state;
  state.q << 0.0, -0.590794906086, 1.441123125144, -1.100328219057, 0.0, -0.590794906086, 1.441123125144,
      -1.100328219057;
  return state;
}

Matrix3 effective(const Biped& biped, const State& state, const std::array<bool, 2>& held) {
  return kinematics::biped_effective_inertia(biped.model, biped.feet, state, kinematics_of(biped.model, state), held);
}

/// The same by finite differences of poses: the trunk turns by +-step, the leg's inverse kinematics holds the feet, and
/// the base is shifted until the centre of mass is where it was.
Matrix3 effective_by_differences(const Biped& biped, const State& state, const std::array<bool, 2>& held) {
  constexpr double step = 1e-5;
  const Kinematics start = kinematics_of(biped.model, state);
  Centroidal at_start;
  centroidal(biped.model, start, at_start);
  const auto turned = [&](const Vector3& angle) {
    State out = state;
    const Vector3 angle_B = state.R_WB.transpose() * angle;
    out.R_WB = math::exp_so3(angle) * state.R_WB;
    for (int iteration = 0; iteration < 60; ++iteration) {
      for (int leg = 0; leg < 2; ++leg) {
        if (!held[leg]) continue;
        const Foot& foot = biped.feet[leg];
        const Vector3 p_WF = start.p_W[foot.body] + start.R_W[foot.body] * foot.tip;
        const Vector3 p_LF =
            kinematics::leg_rotation().transpose() * (out.R_WB.transpose() * (p_WF - out.p_WB) - biped.legs[leg].p_BL);
        kinematics::LegVector q;
        // The last link keeps its pitch in W: its angle in the leg takes the trunk's turn back.
        const double q0 = state.q(4 * leg);
        const double pitch =
            state.q.segment<3>(4 * leg + 1).sum() - Vector3(0.0, std::cos(q0), std::sin(q0)).dot(angle_B);
        REQUIRE(kinematics::leg_ik(biped.legs[leg], p_LF, pitch, q) == kinematics::LegIkStatus::kOk);
        out.q.segment<4>(4 * leg) = q;
      }
      Centroidal c;
      centroidal(biped.model, kinematics_of(biped.model, out), c);
      out.p_WB += at_start.p_WC - c.p_WC;
    }
    return out;
  };
  Matrix3 inertia;
  for (int axis = 0; axis < 3; ++axis) {
    const State after = turned(step * Vector3::Unit(axis)), before = turned(-step * Vector3::Unit(axis));
    State moving = state;
    moving.w_WB_W = Vector3::Unit(axis);
    moving.v_WB = (after.p_WB - before.p_WB) / (2.0 * step);
    moving.qd = (after.q - before.q) / (2.0 * step);
    Centroidal c;
    centroidal(biped.model, kinematics_of(biped.model, moving), c);
    inertia.col(axis) = c.L_C_W;
  }
  return inertia;
}

}  // namespace

TEST_CASE("ABipedWhoseLastLinksTurnWithItsTrunkShowsThePrototypesInertia") {
  const Biped biped;
  const State state = nominal();
  const auto inertia = [&](const std::array<bool, 2>& held) {
    std::vector<Foot> feet;
    ConstraintRows rows;
    rows.setZero(2 + 3 * (2 - (held[0] + held[1])), 14);
    int row = 0;
    for (int leg = 0; leg < 2; ++leg) {
      if (held[leg]) {
        feet.push_back(biped.feet[leg]);
        rows.row(row++).segment<3>(7 + 4 * leg).setOnes();
      } else {
        rows.block<4, 4>(row, 6 + 4 * leg).setIdentity();
        row += 4;
      }
    }
    return effective_inertia(biped.model, state, kinematics_of(biped.model, state), feet, rows);
  };
  // By an independent finite-difference program, with the links' inertias turned with the links.
  Matrix3 both, left;
  both << 0.1509871698, 0.0, 0.0347836922, 0.0, 0.2857137497, 0.0, 0.0113386167, 0.0, 0.3823971914;
  left << 0.277711149, 0.0151955743, 0.0329820374, 0.0094194304, 0.4646032783, -0.0222943444, 0.02172059, -0.0389847377,
      0.3872462329;
  const Matrix3 mirror = Vector3(1.0, -1.0, 1.0).asDiagonal();
  const Matrix3 right = mirror * left * mirror;
  CHECK(max_difference(inertia({true, true}), both) < kPrototype);
  CHECK(max_difference(inertia({true, false}), left) < kPrototype);
  CHECK(max_difference(inertia({false, true}), right) < kPrototype);
}

TEST_CASE("EffectiveInertiaIsTheDerivativeOfAngularMomentumWithTheFeetHeld") {
  constexpr double kDifference = 1e-7;
  const Biped biped;
  Random random(kSeed);
  for (int k = 0; k < 20; ++k) {
    State state = nominal();
    state.p_WB = random.vector(1.0);
    state.R_WB = math::exp_so3(random.vector(0.4));
    for (int i = 0; i < 8; ++i) state.q(i) += random.number(-0.25, 0.25);
    for (const std::array<bool, 2> held : {std::array{true, true}, std::array{true, false}, std::array{false, true}}) {
      CHECK(max_difference(effective(biped, state, held), effective_by_differences(biped, state, held)) < kDifference);
    }
  }
}

TEST_CASE("EffectiveInertiaTurnsWithTheRobot") {
  const Biped biped;
  Random random(kSeed);
  State state = nominal();
  state.q(0) = 0.2;
  const Matrix3 before = effective(biped, state, {true, true});
  const Matrix3 R = math::exp_so3(random.vector(2.0));
  state.R_WB = R;
  state.p_WB = random.vector(3.0);
  CHECK(max_difference(effective(biped, state, {true, true}), R * before * R.transpose()) < kExact);
}

TEST_CASE("EffectiveInertiaWithoutFeetIsTheCompositeInertia") {
  const Biped biped;
  State state = nominal();
  state.q(0) = 0.2;
  Centroidal c;
  centroidal(biped.model, kinematics_of(biped.model, state), c);
  CHECK(max_difference(effective(biped, state, {false, false}), c.inertia_W) < kExact);
}

TEST_CASE("EffectiveInertiaStaysFiniteWithStraightLegs") {
  const Biped biped;
  CHECK(effective(biped, State{}, {true, true}).allFinite());
}
