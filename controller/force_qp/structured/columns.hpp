#pragma once
// Columns of the structured engine, for the path of simd.hpp that is included before it. The mathematics stands in
// structured.hpp; names are its.
#include "controller/force_qp/structured/riccati.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

/// Where the gradients begin in a state: the length of a vector of forces.
template <int NC>
inline int gradients_of_state(const Workspace<NC>& w) noexcept {
  return 3 * w.padded_rows;
}
/// How many numbers a state has.
template <int NC>
inline int length_of_state(const Workspace<NC>& w) noexcept {
  return (w.holds ? 2 : 1) * gradients_of_state(w);
}
template <int NC>
inline Columns& columns_of(Workspace<NC>& w) noexcept {
  return w.holds ? w.held_columns : w.free_columns;
}

inline void forget(Columns& columns) noexcept {
  for (int i = 0; i < columns.num; ++i) columns.of[columns.constraint[i]] = -1;
  columns.num = 0;
}

constexpr int kColumnRoom = 64;  // for the columns that a step may ask for

/// Whether there may soon be no room for columns that are wanted.
template <int NC>
inline bool is_short_of_room(const Workspace<NC>& w, const Columns& columns, int wanted) noexcept {
  return columns.max < kFaces * w.rows && columns.num + wanted > columns.max;
}

/// c_i of constraint i at its own contact.
inline void normal(int i, double friction, double (&c)[3]) noexcept {
  const int face = i % kFaces;
  c[0] = face == 0 ? 1.0 : face == 1 ? -1.0 : 0.0;
  c[1] = face == 2 ? 1.0 : face == 3 ? -1.0 : 0.0;
  c[2] = face < 4 ? -friction : face == 4 ? 1.0 : -1.0;
}

/// The way off face i of a contact along all others that are held: c_i t = 1, c_j t = 0.
inline void way_off(int i, const Held& h, double friction, double (&t)[3]) noexcept {
  const int face = i % kFaces;
  t[0] = face < 2 ? h.x : face < 4 ? 0 : h.z * h.x * friction;
  t[1] = face < 2 ? 0 : face < 4 ? h.y : h.z * h.y * friction;
  t[2] = face < 4 ? 0 : h.z;
}

template <int NC>
inline bool is_held(const Workspace<NC>& w, int i) noexcept {
  return w.holds && (w.held[i / kFaces] >> (i % kFaces) & 1) != 0;
}

constexpr Lanes kLane[8] = {{{1}},
                            {{0, 1}},
                            {{0, 0, 1}},
                            {{0, 0, 0, 1}},
                            {{0, 0, 0, 0, 1}},
                            {{0, 0, 0, 0, 0, 1}},
                            {{0, 0, 0, 0, 0, 0, 1}},
                            {{0, 0, 0, 0, 0, 0, 0, 1}}};

/// A right-hand side in its lane: the normal of a free constraint, or a way off a held one.
struct Right {
  int stage, slot, lane;
  bool off;
  double n[3];  ///< at its contact
};
/// What those of one stage add: n to su; off a held face also t to the forces, -Quu t to su and -Qux't to p.
template <typename V, int NC>
struct Beginning {
  V off[3 * NC], su[3 * NC], p[12];
  bool any_off;
};

/// The right-hand sides of `ids`, the latest first.
template <int NC>
inline void take_rights(const Workspace<NC>& w, const int* ids, int count, Right (&rights)[8]) noexcept {
  for (int j = 0; j < count; ++j) {
    const int row = ids[j] / kFaces;
    Right r;
    r.stage = w.row_stage[row];
    r.slot = row - w.stages[r.stage].first_row;
    r.lane = j;
    r.off = is_held(w, ids[j]);
    if (r.off) {
      way_off(ids[j], Held(w.held[row], w.fz_min[row]), w.friction, r.n);
    } else {
      normal(ids[j], w.friction, r.n);
    }
    int at = j;
    for (; at > 0 && rights[at - 1].stage < r.stage; --at) rights[at] = rights[at - 1];
    rights[at] = r;
  }
}

template <typename V, int NC>
inline void sum_up(const Stage<NC>& s, const Right* rights, int from, int to, Beginning<V, NC>& begins) noexcept {
  begins.any_off = false;
  for (int c = 0; c < 3 * s.slots; ++c) begins.su[c] = begins.off[c] = zeros<V>();
  for (int i = from; i < to; ++i) {
    const Right& r = rights[i];
    V* sum = (r.off ? begins.off : begins.su) + 3 * r.slot;
    for (int d = 0; d < 3; ++d) sum[d] = add_product(sum[d], all<V>(r.n[d]), load<V>(kLane[r.lane]));
    begins.any_off = begins.any_off || r.off;
  }
}
template <typename V, int NC>
inline void begin_at(const Stage<NC>& s, const Gain<NC>& gain, const Right* rights, int from, int to,
                     Beginning<V, NC>& begins) noexcept {
  sum_up(s, rights, from, to, begins);
  if (!begins.any_off) return;
  const int U = 3 * s.slots;
  for (int c = 0; c < U; ++c) {
    for (int e = 0; e < U; ++e) {
      begins.su[c] = subtract_product(begins.su[c], entry<V>(gain.Quu[c / 6][e], c % 6), begins.off[e]);
    }
  }
  for (int i = 0; i < 6; ++i) {
    begins.p[i] = begins.p[6 + i] = zeros<V>();
    for (int c = 0; c < U; ++c) {
      begins.p[i] = subtract_product(begins.p[i], entry<V>(gain.Qux_pose[c], i), begins.off[c]);
      begins.p[6 + i] = subtract_product(begins.p[6 + i], entry<V>(gain.Qux_rate[c], i), begins.off[c]);
    }
  }
}

/// The costates, and from them what `sweep_forth` needs of each stage.
template <typename V, bool kWithin, int NC>
inline void sweep_back(Workspace<NC>& w, const Right* rights, int count) noexcept {
  const Gain<NC>* gains = kWithin ? w.held_gains : w.gains;
  const int last = rights[0].stage;
  Beginning<V, NC> begins;
  V p[12];
  for (V& a : p) a = zeros<V>();
  int next = 0;
  for (int k = last; k >= 0; --k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = gains[k];
    const int begin = next;
    while (next < count && rights[next].stage == k) ++next;
    const bool any_begins = begin < next;
    if (any_begins) begin_at(s, gain, rights, begin, next, begins);
    with_slots(s, [&]<int M>() noexcept {
      constexpr int U = 3 * M;
      V su[U];
      for (int c = 0; c < U; ++c) {
        V a = entry<V>(s.B[c], 0) * p[6];
        for (int i = 1; i < 6; ++i) a = add_product(a, entry<V>(s.B[c], i), p[6 + i]);
        su[c] = a;
      }
      if (any_begins) {
        for (int c = 0; c < U; ++c) su[c] = su[c] + begins.su[c];
      }
      for (int c = 0; c < U; ++c) {
        V a = zeros<V>();
        for (int e = 0; e < U; ++e) a = add_product(a, entry<V>(gain.Quu_inverse[c / 6][e], c % 6), su[e]);
        store(w.lane_feedforward[k * 3 * NC + c], a);
      }
      for (int c = 0; c < U && kWithin; ++c) store(w.lane_right[k * 3 * NC + c], su[c]);
      if (k == 0) return;
      V h[12];
      for (int i = 0; i < 6; ++i) {
        const int block = i / 3 * 3;
        h[i] = p[i];
        V a = p[6 + i];
        for (int j = 0; j < 3; ++j) a = add_product(a, all<V>(s.D[i - block].v[lane_of(block + j)]), p[block + j]);
        h[6 + i] = a;
      }
      if (s.coupled) {
        for (int j = 0; j < 3; ++j) {
          for (int i = 0; i < 3; ++i) h[3 + j] = add_product(h[3 + j], all<V>(s.C[j].v[i]), p[6 + i]);
        }
      }
      for (int i = 0; i < 6; ++i) {
        for (int c = 0; c < U; ++c) {
          h[i] = subtract_product(h[i], entry<V>(gain.K_pose[c], i), su[c]);
          h[6 + i] = subtract_product(h[6 + i], entry<V>(gain.K_rate[c], i), su[c]);
        }
      }
      if (any_begins && begins.any_off) {
        for (int i = 0; i < 12; ++i) h[i] = h[i] + begins.p[i];
      }
      for (int i = 0; i < 12; ++i) p[i] = h[i];
    });
  }
}

/// The states, into lane_states.
template <typename V, bool kWithin, int NC>
inline void sweep_forth(Workspace<NC>& w, const Right* rights, int count) noexcept {
  const Gain<NC>* gains = kWithin ? w.held_gains : w.gains;
  const int last = rights[0].stage;
  const int padded = w.padded_rows;
  Beginning<V, NC> begins;
  V x[12];
  for (V& a : x) a = zeros<V>();
  int next = count;
  for (int k = 0; k < w.num_stages; ++k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = gains[k];
    const int end = next;
    while (next > 0 && rights[next - 1].stage == k) --next;
    const bool any_begins = kWithin && next < end;
    if (any_begins) sum_up(s, rights, next, end, begins);
    with_slots(s, [&]<int M>() noexcept {
      constexpr int U = 3 * M;
      V f[U];
      for (int c = 0; c < U; ++c) {
        V a = k <= last ? load<V>(w.lane_feedforward[k * 3 * NC + c]) : zeros<V>();
        V b = zeros<V>();
        for (int i = 0; i < 6; ++i) {
          a = subtract_product(a, entry<V>(gain.K_pose[c], i), x[i]);
          b = add_product(b, entry<V>(gain.K_rate[c], i), x[6 + i]);
        }
        f[c] = a - b;
      }
      if constexpr (kWithin) {
        unsigned any = 0;
        for (int slot = 0; slot < M; ++slot) any |= w.held[s.first_row + slot];
        for (int c = 0; c < U; ++c) {
          V d = zeros<V>();
          if (any != 0) {
            V e = zeros<V>();
            if (k <= last) d = d - load<V>(w.lane_right[k * 3 * NC + c]);
            for (int j = 0; j < U; ++j) d = add_product(d, entry<V>(gain.Quu[c / 6][j], c % 6), f[j]);
            for (int i = 0; i < 6; ++i) {
              d = add_product(d, entry<V>(gain.Qux_pose[c], i), x[i]);
              e = add_product(e, entry<V>(gain.Qux_rate[c], i), x[6 + i]);
            }
            d = d + e;
          }
          store(w.lane_states[(3 + c % 3) * padded + s.first_row + c / 3], d);
        }
        if (any_begins) {
          for (int c = 0; c < U; ++c) f[c] = f[c] + begins.off[c];
        }
      }
      for (int c = 0; c < U; ++c) store(w.lane_states[c % 3 * padded + s.first_row + c / 3], f[c]);
      V y[12];
      for (int i = 0; i < 6; ++i) {
        const int block = i / 3 * 3;
        V a = x[i];
        for (int j = 0; j < 3; ++j) a = add_product(a, all<V>(s.D[j].v[lane_of(i)]), x[6 + block + j]);
        y[i] = a;
        V b = x[6 + i];
        for (int c = 0; c < U; ++c) b = add_product(b, entry<V>(s.B[c], i), f[c]);
        y[6 + i] = b;
      }
      if (s.coupled) {
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) y[6 + i] = add_product(y[6 + i], all<V>(s.C[j].v[i]), x[3 + j]);
        }
      }
      for (int i = 0; i < 12; ++i) x[i] = y[i];
    });
  }
}

/// Columns of at most as many constraints as V has lanes: sweeps with the constraints in the lanes. Of a free
/// constraint the states that answer to su = c_i at its own stage; of one that is held those that answer to one newton
/// off it, gradients included.
template <typename V, bool kWithin, int NC>
void columns_in_lanes(Workspace<NC>& w, const int* ids, int count, double* const* out) noexcept {
  Right rights[8];
  take_rights(w, ids, count, rights);
  sweep_back<V, kWithin>(w, rights, count);
  sweep_forth<V, kWithin>(w, rights, count);
  const int length = length_of_state(w);
  for (int at = 0; at < length; at += w.padded_rows) {
    for (int row = w.rows; row < w.padded_rows; ++row) store(w.lane_states[at + row], zeros());
  }
  for (int at = 0; at < length; at += 8) {
    const Lanes* rows = w.lane_states + at;
    if constexpr (sizeof(V) == sizeof(Half)) {
      Vec t[4];
      for (int i = 0; i < 4; ++i) t[i] = join(load<Half>(rows[i]), load<Half>(rows[4 + i]));
      transpose_halves(t);
      for (int j = 0; j < count; ++j) store(out[j] + at, t[j]);
    } else {
      Vec t[8];
      for (int i = 0; i < 8; ++i) t[i] = load(rows[i]);
      transpose(t);
      for (int j = 0; j < count; ++j) store(out[j] + at, t[j]);
    }
  }
}
/// Takes the columns of `ids` that there are not yet, four or eight at a time. False where there is no room for all.
template <int NC>
bool take_columns(Workspace<NC>& w, const int* ids, int count) noexcept {
  Columns& columns = columns_of(w);
  const int lanes = w.holds ? 4 : 8;
  const auto take = w.holds ? &columns_in_lanes<Half, true, NC> : &columns_in_lanes<Vec, false, NC>;
  int batch[8];
  double* out[8];
  int pending = 0;
  bool room = true;
  for (int i = 0; i < count && room; ++i) {
    if (columns.of[ids[i]] >= 0) continue;
    room = columns.num < columns.max;
    if (!room) break;
    batch[pending] = ids[i];
    out[pending++] = columns.values + static_cast<std::int64_t>(columns.num) * length_of_state(w);
    columns.of[ids[i]] = columns.num;
    columns.constraint[columns.num++] = ids[i];
    if (pending == lanes) {
      take(w, batch, pending, out);
      pending = 0;
    }
  }
  if (pending > 0) take(w, batch, pending, out);
  return room;
}

template <int NC>
void take_ahead(Workspace<NC>& w) noexcept {
  w.holds = false;
  if (!w.factor_stands && !factor(w)) return;
  int ids[8];
  int count = 0;
  const Columns& columns = w.free_columns;
  const int room = is_short_of_room(w, columns, kColumnRoom + 8) ? 0 : columns.max - columns.num;
  for (; w.ahead < kFaces * w.rows && count < 8 && count < room; ++w.ahead) {
    const int row = w.ahead / kFaces;
    const bool can_bind = w.fz_max[row] > 0.0 && (w.ahead % kFaces < kFaces - 1 || w.fz_min[row] > 0.0);
    if (can_bind && columns.of[w.ahead] < 0) ids[count++] = w.ahead;
  }
  take_columns(w, ids, count);
}

}  // namespace stance::force_qp::structured::STANCE_ISA
