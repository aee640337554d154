#include "controller/planning/pendulum.hpp"

#include <catch2/catch_test_macros.hpp>

namespace stance::planning {

TEST_CASE("APendulumSwingsAsItsEquationSays") {
  constexpr double omega = 3.6, time = 0.3, exact = 1e-12, integrated = 1e-7;
  const Vector2 z(0.1, -0.2);
  const Pendulum start{{0.15, -0.1}, {0.4, -0.3}};
  // Leapfrog, in small steps.
  constexpr int steps = 20000;
  constexpr double dt = time / steps;
  Pendulum p = start;
  for (int k = 0; k < steps; ++k) {
    p.v += 0.5 * dt * omega * omega * (p.p - z);
    p.p += dt * p.v;
    p.v += 0.5 * dt * omega * omega * (p.p - z);
  }
  const Pendulum end = swung(start, z, omega, time);
  CHECK((end.p - p.p).norm() < integrated);
  CHECK((end.v - p.v).norm() < integrated);
  const Pendulum twice = swung(swung(start, z, omega, 0.4 * time), z, omega, 0.6 * time);
  CHECK((twice.p - end.p).norm() < exact);
  CHECK((twice.v - end.v).norm() < exact);
  CHECK((swung(end, z, omega, -time).p - start.p).norm() < exact);
}

}  // namespace stance::planning
