#pragma once
// Force QPs as they followed one another, for benchmarks. Little-endian: the 8 bytes "STANCEQ2", int32 n, T, N,
// terminal (0 or 1); float64 mu, typical force (N); then per tick x0 (12) and per stage A (12 x 12), B (12 x 3n), g,
// xref, Q (12 each), fref, R (3n each), fz_min, fz_max (n each), matrices row by row; and at the tick's end P (12 x 12)
// where terminal is 1. Units as in force_qp.hpp.
#include <ostream>

#include "controller/force_qp/force_qp.hpp"

namespace stance::force_qp {

inline constexpr char kTickFileMagic[] = "STANCEQ2";

class TickWriter {
 public:
  /// `out` must be seekable, opened as binary, and outlive the writer; `typical_force` [N].
  TickWriter(std::ostream& out, double typical_force) : out_(out), typical_force_(typical_force) {}
  /// Throws std::invalid_argument where `problem` differs from the first in sizes, mu or in having P.
  void write(const Problem& problem);
  /// To be called after the last one: the number of ticks stands in the header. False where `out` took not all.
  [[nodiscard]] bool finish();
  int ticks() const noexcept { return ticks_; }

 private:
  void write_header();

  std::ostream& out_;
  double typical_force_;
  Sizes sizes_;
  double friction_ = 0.0;
  bool has_terminal_cost_ = false;
  std::int32_t ticks_ = 0;
};

}  // namespace stance::force_qp
