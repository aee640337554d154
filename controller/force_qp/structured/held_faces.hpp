#pragma once
// Whole sets of active faces at once, for the path of simd.hpp that is included before it. The mathematics stands in
// structured.hpp; names are its.
#include "controller/force_qp/structured/riccati.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

// From how many guessed constraints on sets are revised as a whole. A revision costs what the horizon costs, the active
// set the square of its constraints: they are even at about 80 (measured over 20 and 50 stages of two feet). On one
// foot at a time revisions cycle too often to pay.
constexpr int kManyGuesses = 80;
constexpr int kBoldRevisions = 6;  // after which only some contacts follow what multipliers and violations say
constexpr int kMaxRevisions = 40;  // after which the active set takes over: about what it costs itself by then

/// Moves the forces of contacts with held faces onto these.
template <int NC>
void lie_on_faces(Workspace<NC>& w) noexcept {
  double* x = w.forces;
  double* y = x + w.padded_rows;
  double* z = y + w.padded_rows;
  for (int row = 0; row < w.rows; ++row) {
    if (w.held[row] == 0) continue;
    const Held h(w.held[row], w.fz_min[row]);
    if (h.z != 0) z[row] = h.z > 0 ? w.fz_max[row] : w.fz_min[row];
    if (h.x != 0 || h.apex) x[row] = h.x * w.friction * z[row];
    if (h.y != 0 || h.apex) y[row] = h.y * w.friction * z[row];
  }
}

/// Whether contact `row` may change in this revision: all may in the first ones, then three of four, others each time
/// and the same in every run. Revisions that move all at once can go round in a circle for ever.
inline bool may_change(int row, int revision) noexcept {
  if (revision < kBoldRevisions) return true;
  std::uint32_t h = static_cast<std::uint32_t>(row) * 2654435761U + static_cast<std::uint32_t>(revision) * 2246822519U;
  h = (h ^ (h >> 15)) * 2246822519U;
  return ((h ^ (h >> 13)) & 3U) != 0;
}

/// The faces that contact `row` of stage `s` holds next: those held whose multipliers are not negative, and those that
/// its force violates.
template <int NC>
unsigned next_faces(const Workspace<NC>& w, const Stage<NC>& s, int row) noexcept {
  const double* f = w.forces + row;
  const double* d = w.gradient + row;
  const int slot = row - s.first_row;
  const double* R = s.R[slot / 2].v + 4 * (slot % 2);
  const double fx = f[0], fy = f[w.padded_rows], fz = f[2 * w.padded_rows];
  const double dx = d[0], dy = d[w.padded_rows], dz = d[2 * w.padded_rows];
  const double least = R[0] < R[1] ? (R[0] < R[2] ? R[0] : R[2]) : (R[1] < R[2] ? R[1] : R[2]);
  const double negative = -w.tolerance * least;

  const Held h(w.held[row], w.fz_min[row]);
  // At the apex every side face holds; those that -d pushes against carry the multipliers. One that carries none to
  // speak of stays as it is.
  const auto side_of = [&](int held, double gradient) noexcept {
    if (!h.apex || (held != 0 && -held * gradient >= negative)) return held;
    return gradient > 0.0 ? -1 : 1;
  };
  const int side_x = side_of(h.x, dx);
  const int side_y = side_of(h.y, dy);
  const double multiplier_x = -side_x * dx;
  const double multiplier_y = -side_y * dy;
  const double multiplier_z = h.z * (w.friction * (multiplier_x + multiplier_y) - dz);
  const double room = w.friction * fz + w.tolerance;
  const auto side = [&](int held, double multiplier, double component) noexcept -> unsigned {
    if (held != 0) return multiplier < negative ? 0U : held > 0 ? 1U : 2U;
    return component > room ? 1U : -component > room ? 2U : 0U;
  };
  unsigned z = 0;
  if (h.z != 0) {
    z = multiplier_z < negative ? 0U : h.z > 0 ? 1U : 2U;
  } else {
    z = fz > w.fz_max[row] + w.tolerance ? 1U : fz < w.fz_min[row] - w.tolerance ? 2U : 0U;
  }
  return side(side_x, multiplier_x, fx) | side(side_y, multiplier_y, fy) << 2 | z << 4;
}

/// Revises the faces that are held; returns the last stage that changed, -1 where none is to.
template <int NC>
int revise(Workspace<NC>& w, int revision) noexcept {
  int first = -1;
  int last = -1;
  for (int k = 0; k < w.num_stages; ++k) {
    const Stage<NC>& s = w.stages[k];
    for (int row = s.first_row; row < s.first_row + s.slots; ++row) {
      if (!(w.fz_max[row] > 0.0)) continue;
      const unsigned next = next_faces(w, s, row);
      if (next == w.held[row]) continue;
      if (first >= 0 && !may_change(row, revision)) continue;
      first = first < 0 ? k : first;
      last = k;
      w.held[row] = static_cast<std::uint8_t>(next);
    }
  }
  return last;
}

/// Holds the constraints to begin with.
template <int NC>
void hold_guesses(Workspace<NC>& w) noexcept {
  for (int row = 0; row < w.padded_rows; ++row) w.held[row] = 0;
  for (int i = 0; i < w.num_guesses; ++i) {
    std::uint8_t& held = w.held[w.guesses[i] / kFaces];
    held = static_cast<std::uint8_t>(held | 1U << (w.guesses[i] % kFaces));
  }
}

/// The solution from the faces in `held`, by revisions of the whole set; false where they do not end.
template <int NC>
bool solve_held(Workspace<NC>& w) noexcept {
  for (int k = 0; k < w.num_stages; ++k) {
    const Stage<NC>& s = w.stages[k];
    with_slots(s, [&]<int M>() noexcept {
      Vec f[Stage<NC>::kPairs];
      for (int pair = 0; 2 * pair < M; ++pair) f[pair] = load(s.f_ref[pair]);
      scatter<M>(f, w.forces, w.padded_rows, s.first_row);
    });
  }
  int last = w.num_stages - 1;
  for (int revision = 0; revision < kMaxRevisions && w.iterations < w.max_iterations; ++revision) {
    lie_on_faces(w);
    if (!factor_held(w, last)) return false;
    sweep<NC>(w, w.held_gains, w.forces, nullptr, w.forces);
    gradient_at<NC>(w, w.forces, w.gradient);
    last = revise(w, revision);
    if (last < 0) {
      w.ends_held = true;
      return true;
    }
    ++w.iterations;
  }
  return false;
}

}  // namespace stance::force_qp::structured::STANCE_ISA
