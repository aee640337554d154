#pragma once
// The minimiser within held faces, for the path of simd.hpp that is included before it. The mathematics stands in
// structured.hpp; names are its.
#include "controller/force_qp/structured/columns.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

constexpr int kManyNegative = 48;  // contacts with negative multipliers: so many are let go at once

/// Faces as they can be held. Opposite ones that are both active meet at fz = 0: one of them and the lower bound can
/// pull back as they do, -d = C'y, and nothing is lost where the bound is higher.
inline std::uint8_t holdable(unsigned faces, double dx, double dy) noexcept {
  const bool x_meet = (faces & 3U) == 3U;
  const bool y_meet = (faces >> 2 & 3U) == 3U;
  if (x_meet) faces ^= dx > 0.0 ? 1U : 2U;
  if (y_meet) faces ^= dy > 0.0 ? 4U : 8U;
  if (x_meet || y_meet) faces = (faces & ~16U) | 32U;
  if ((faces >> 4 & 3U) == 3U) faces ^= 16U;
  return static_cast<std::uint8_t>(faces);
}

/// fz = 0 is held, with the sides whose multipliers a gradient makes positive.
inline std::uint8_t apex_with_sides(double dx, double dy) noexcept {
  return static_cast<std::uint8_t>((dx > 0.0 ? 2 : 1) | (dy > 0.0 ? 8 : 4) | 32);
}

/// Moves the forces of contacts with held faces onto these.
template <int NC>
void lie_on_faces(Workspace<NC>& w) noexcept {
  double* x = w.state;
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

/// Multipliers of the faces that a contact holds, from its gradient.
inline void held_multipliers(const Held& h, double friction, int stride, const double* d, double (&y)[3]) noexcept {
  y[0] = -h.x * d[0];
  y[1] = -h.y * d[stride];
  y[2] = h.z * (friction * (y[0] + y[1]) - d[2 * stride]);
}

/// Of what is held, what the gradient in `state` does not push away, into `next_held`. Returns how many contacts let
/// go. At the apex all sides hold: there fz alone may be let go, and the sides that it leaves are named.
template <int NC>
int keep_positive(Workspace<NC>& w) noexcept {
  int changes = 0;
  for (int row = 0; row < w.rows; ++row) {
    w.next_held[row] = w.held[row];
    if (w.held[row] == 0) continue;
    const double* d = w.state + gradients_of_state(w) + row;
    if (Held(w.held[row], w.fz_min[row]).apex) w.held[row] = apex_with_sides(d[0], d[w.padded_rows]);
    const Held h(w.held[row], w.fz_min[row]);
    double y[3];
    held_multipliers(h, w.friction, w.padded_rows, d, y);
    unsigned kept = w.held[row];
    for (int axis = 0; axis < 3; ++axis) {
      if (y[axis] < 0.0) kept &= ~(3U << (2 * axis));
    }
    w.next_held[row] = static_cast<std::uint8_t>(kept);
    changes += w.next_held[row] != w.held[row];
  }
  return changes;
}

/// Holds `next_held`: the factor, and the state of the minimiser within them from the forces in `state`. False where
/// the factor cannot be had.
template <int NC>
bool hold(Workspace<NC>& w) noexcept {
  int last = w.held_factor_stands ? -1 : w.num_stages - 1;
  for (int row = 0; row < w.rows; ++row) {
    if (w.next_held[row] == w.held[row]) continue;
    w.held[row] = w.next_held[row];
    last = w.row_stage[row] > last ? w.row_stage[row] : last;
  }
  w.held_factor_stands = factor_held(w, last);
  if (!w.held_factor_stands) return false;
  lie_on_faces(w);
  sweep<true>(w, w.state, nullptr, w.state);
  gradient_at<NC>(w, w.state, w.state + gradients_of_state(w));
  return true;
}

}  // namespace stance::force_qp::structured::STANCE_ISA
