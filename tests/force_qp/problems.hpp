#pragma once
// Force QPs of a made-up biped of the real one's size, for tests and benchmarks: standing on n feet, and walking.
#include <random>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp::test {

inline constexpr double kMass = 13.2;                // kg
inline constexpr double kWeight = kMass * kGravity;  // N
inline constexpr double kHeight = 0.62;              // m, of C over the feet
inline constexpr double kHalfWidth = 0.1;            // m, from the middle to a foot
inline constexpr double kFrictionStand = 0.6;
inline constexpr double kFrictionWalk = 0.55;

centroidal::Parameters body();
StateVector stand_weights();
StateVector walk_weights();

/// Standing model about C over the middle of `num_contacts` feet on a ring (two: left and right).
centroidal::Linearisation stand_linearisation(int num_contacts, bool coupling);

/// Standing over N stages, with the Riccati terminal cost (two contacts or more).
Problem standing(int num_stages, int num_contacts = 2, double friction = kFrictionStand);

/// Walking forward from tick `tick` of the gait: 0.26 s of single, 0.06 s of double support, footholds 0.1 m apart;
/// contacts, arms and references change over the horizon.
Problem walking(int num_stages, int tick, double friction = kFrictionWalk);

/// Any problem of the structure: every matrix, weight, bound and contact differs from stage to stage.
Problem any_problem(Sizes sizes, std::mt19937_64& random);

/// Moves x0 by a random deviation; `severity` 1 is what a standing robot sees, 10 a hard push.
void disturb(Problem& problem, double severity, std::mt19937_64& random);

}  // namespace stance::force_qp::test
