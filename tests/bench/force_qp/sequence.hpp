#pragma once
// Ticks of a controller: force QPs as they follow one another, recorded in closed loop or read from a file.
#include <filesystem>
#include <string>
#include <vector>

#include "controller/force_qp/force_qp.hpp"

namespace stance::bench {

enum class Motion { kStand, kWalk, kFourFeet };

/// How a sequence is made.
struct Recipe {
  Motion motion = Motion::kStand;
  unsigned seed = 1;
  double push = 1.0;      ///< of up to 50 N and 1.5 N m for 60 ms
  bool often = false;     ///< pushed every 0.5 s, not once in the middle
  double friction = 0.6;  ///< mu
  bool coupled = false;   ///< with the coupling term and a dense terminal cost
};

struct Sequence {
  std::string name;
  double typical_force = 0.0;            ///< N, m g
  bool time_invariant = false;           ///< the matrices are the same in all ticks
  std::vector<force_qp::Problem> ticks;  ///< of the longest horizon

  /// Tick `tick` over its first N stages.
  void cut(std::size_t tick, int num_stages, force_qp::Problem& out) const;
};

/// 240 ticks of a rigid body (12 kg) under its own force QP over 30 stages, on noisy states: standing on two point
/// feet 0.16 m apart, walking at 0.3 m/s on one foot at a time, 0.3 s each, or standing on four feet.
Sequence record(const Recipe& recipe, int max_stages);

/// Reads a file of ticks. Throws std::runtime_error that names the file and what is wrong with it.
///
/// Little-endian. First version: int32 T, M; then float64 arrays x0 (T x 12), yaw (T x M, rad), B (T x M x 12 x 6, row
/// by row, 1/kg..), xref (T x M x 12), contact (T x M x 2, 0 or 1) and forces that are not read; mass 12 kg, mu 0.6, fz
/// <= 250 N, the weights of `record`, dt 0.01 s. Second version: controller/force_qp/tick_file.hpp.
Sequence read_sequence(const std::filesystem::path& file);

/// Writes the second version. Throws std::runtime_error where the file cannot be written.
void write_sequence(const Sequence& sequence, const std::filesystem::path& file);

}  // namespace stance::bench
