#pragma once
// Columns and active set of the structured engine, for the path of simd.hpp that is included before it. The mathematics
// stands in structured.hpp; names are its.
#include "controller/force_qp/structured/held_faces.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

constexpr int kMaxPasses = 6;            // of appending constraints in blocks
constexpr int kMaxBlock = 16;            // constraints in one block
constexpr int kPerContact = 3;           // active constraints of a contact, at most, when appended in blocks
constexpr double kDependent = 1e-11;     // of a constraint's own curvature: what is left of it below this is nothing
constexpr double kNoMultiplier = 1e-13;  // change of a multiplier that counts as none
constexpr double kExactlyActive = 1e-4;  // of the tolerance: an active constraint is met to this, or refined

// ---- Columns ------------------------------------------------------------------------------------------------------

/// c_i of constraint i at its own contact.
inline void normal(int i, double friction, double (&c)[3]) noexcept {
  const int face = i % kFaces;
  c[0] = face == 0 ? 1.0 : face == 1 ? -1.0 : 0.0;
  c[1] = face == 2 ? 1.0 : face == 3 ? -1.0 : 0.0;
  c[2] = face < 4 ? -friction : face == 4 ? 1.0 : -1.0;
}

/// H^-1 c for up to eight constraints at once: a sweep with the constraints in the lanes.
template <int NC>
void eight_columns(Workspace<NC>& w, const int* ids, int count, double* const* out) noexcept {
  const int N = w.num_stages;
  const int padded = w.padded_rows;
  int last = 0;
  int stage_of[8];
  for (int j = 0; j < count; ++j) {
    stage_of[j] = w.row_stage[ids[j] / kFaces];
    last = stage_of[j] > last ? stage_of[j] : last;
  }

  Vec p[12];
  for (Vec& a : p) a = zeros();
  for (int k = last; k >= 0; --k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = w.gains[k];
    bool begins = false;
    for (int j = 0; j < count; ++j) begins = begins || stage_of[j] == k;
    with_slots(s, [&]<int M>() noexcept {
      constexpr int U = 3 * M;
      Vec su[U];
      for (int c = 0; c < U; ++c) {
        Vec a = entry(s.B[c], 0) * p[6];
        for (int i = 1; i < 6; ++i) a = add_product(a, entry(s.B[c], i), p[6 + i]);
        su[c] = a;
      }
      if (begins) {
        Lanes t[U] = {};
        for (int j = 0; j < count; ++j) {
          if (stage_of[j] != k) continue;
          double n[3];
          normal(ids[j], w.friction, n);
          const int slot = ids[j] / kFaces - s.first_row;
          for (int d = 0; d < 3; ++d) t[3 * slot + d].v[j] = n[d];
        }
        for (int c = 0; c < U; ++c) su[c] = su[c] + load(t[c]);
      }
      for (int c = 0; c < U; ++c) {
        Vec a = zeros();
        for (int e = 0; e < U; ++e) a = add_product(a, entry(gain.Quu_inverse[c / 6][e], c % 6), su[e]);
        store(w.eight_feedforward[k * 3 * NC + c], a);
      }
      if (k == 0) return;
      Vec h[12];
      for (int i = 0; i < 6; ++i) {
        const int block = i / 3 * 3;
        h[i] = p[i];
        Vec a = p[6 + i];
        for (int j = 0; j < 3; ++j) a = add_product(a, all(s.D[i - block].v[lane_of(block + j)]), p[block + j]);
        h[6 + i] = a;
      }
      if (s.coupled) {
        for (int j = 0; j < 3; ++j) {
          for (int i = 0; i < 3; ++i) h[3 + j] = add_product(h[3 + j], all(s.C[j].v[i]), p[6 + i]);
        }
      }
      for (int i = 0; i < 6; ++i) {
        for (int c = 0; c < U; ++c) {
          h[i] = subtract_product(h[i], entry(gain.K_pose[c], i), su[c]);
          h[6 + i] = subtract_product(h[6 + i], entry(gain.K_rate[c], i), su[c]);
        }
      }
      for (int i = 0; i < 12; ++i) p[i] = h[i];
    });
  }

  Vec x[12];
  for (Vec& a : x) a = zeros();
  for (int k = 0; k < N; ++k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = w.gains[k];
    with_slots(s, [&]<int M>() noexcept {
      constexpr int U = 3 * M;
      Vec f[U];
      for (int c = 0; c < U; ++c) {
        Vec a = k <= last ? load(w.eight_feedforward[k * 3 * NC + c]) : zeros();
        Vec b = zeros();
        for (int i = 0; i < 6; ++i) {
          a = subtract_product(a, entry(gain.K_pose[c], i), x[i]);
          b = add_product(b, entry(gain.K_rate[c], i), x[6 + i]);
        }
        f[c] = a - b;
        store(w.eight_forces[c % 3 * padded + s.first_row + c / 3], f[c]);
      }
      Vec y[12];
      for (int i = 0; i < 6; ++i) {
        const int block = i / 3 * 3;
        Vec a = x[i];
        for (int j = 0; j < 3; ++j) a = add_product(a, all(s.D[j].v[lane_of(i)]), x[6 + block + j]);
        y[i] = a;
        Vec b = x[6 + i];
        for (int c = 0; c < U; ++c) b = add_product(b, entry(s.B[c], i), f[c]);
        y[6 + i] = b;
      }
      if (s.coupled) {
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) y[6 + i] = add_product(y[6 + i], all(s.C[j].v[i]), x[3 + j]);
        }
      }
      for (int i = 0; i < 12; ++i) x[i] = y[i];
    });
  }
  for (int d = 0; d < 3; ++d) {
    for (int row = w.rows; row < padded; ++row) store(w.eight_forces[d * padded + row], zeros());
  }

  for (int at = 0; at < 3 * padded; at += 8) {
    Vec t[8];
    for (int i = 0; i < 8; ++i) t[i] = load(w.eight_forces[at + i]);
    transpose(t);
    for (int j = 0; j < count; ++j) store(out[j] + at, t[j]);
  }
}

/// Takes the columns of `ids` that there are not yet, eight at a time. False where there is no room for all.
template <int NC>
bool take_columns(Workspace<NC>& w, const int* ids, int count) noexcept {
  int batch[8];
  double* out[8];
  int pending = 0;
  bool room = true;
  for (int i = 0; i < count && room; ++i) {
    if (w.column_of[ids[i]] >= 0) continue;
    room = w.num_columns < w.max_columns;
    if (!room) break;
    batch[pending] = ids[i];
    out[pending++] = w.columns + static_cast<std::int64_t>(w.num_columns) * 3 * w.padded_rows;
    w.column_of[ids[i]] = w.num_columns;
    w.column_constraint[w.num_columns++] = ids[i];
    if (pending == 8) {
      eight_columns(w, batch, pending, out);
      pending = 0;
    }
  }
  if (pending > 0) eight_columns(w, batch, pending, out);
  return room;
}

template <int NC>
void take_ahead(Workspace<NC>& w) noexcept {
  int ids[8];
  int count = 0;
  const int room = w.max_columns - w.num_columns;
  for (; w.ahead < kFaces * w.rows && count < 8 && count < room; ++w.ahead) {
    const int row = w.ahead / kFaces;
    const bool can_bind = w.fz_max[row] > 0.0 && (w.ahead % kFaces < kFaces - 1 || w.fz_min[row] > 0.0);
    if (can_bind && w.column_of[w.ahead] < 0) ids[count++] = w.ahead;
  }
  take_columns(w, ids, count);
}

// ---- Active set ---------------------------------------------------------------------------------------------------

/// The dual active set over the columns; see structured.hpp.
template <int NC>
class ActiveSet {
 public:
  explicit ActiveSet(Workspace<NC>& workspace) noexcept : w(workspace) {}

  Outcome solve() noexcept {
    w.iterations = 0;
    w.ends_held = false;
    clear();
    if (w.num_guesses > kManyGuesses && w.rows >= 2 * w.num_stages) {
      hold_guesses(w);
      if (solve_held<NC>(w)) return Outcome::kSolved;
    }
    sweep<NC>(w, w.gains, nullptr, nullptr, w.free_forces);
    begin_with_guesses();
    combine();
    int passes = 0;
    for (;;) {
      const double worst = scan();
      if (!(worst > w.tolerance)) break;  // a number that is none is caught by the independent check
      if (w.iterations == w.max_iterations) return Outcome::kOutOfBudget;
      ++w.iterations;
      if (passes < kMaxPasses) {
        ++passes;
        if (append_block()) {
          settle();
          combine();
          continue;
        }
      }
      const Outcome outcome = step(most_violated(worst), worst);
      if (outcome != Outcome::kSolved) return outcome;
      combine();
    }
    correct_rounding();
    return Outcome::kSolved;
  }

  void refine() noexcept {
    if (w.ends_held) {
      sweep<NC>(w, w.held_gains, w.forces, nullptr, w.forces);
      return;
    }
    // pull = C_A' y, in the place of the violations' candidates' forces
    double* pull = w.free_forces;
    for (int i = 0; i < 3 * w.padded_rows; ++i) pull[i] = 0.0;
    for (int a = 0; a < w.active; ++a) {
      const Constraint& c = w.constraint[a];
      pull[c.side_at] += c.side * w.multiplier[a];
      pull[c.up_at] += c.up * w.multiplier[a];
    }
    sweep<NC>(w, w.gains, w.forces, pull, w.forces);
    correct_rounding();
  }

 private:
  Constraint constraint_of(int id) const noexcept {
    static constexpr double kSide[kFaces] = {1.0, -1.0, 1.0, -1.0, 0.0, 0.0};
    const int row = id / kFaces;
    const int face = id % kFaces;
    Constraint c;
    c.id = id;
    c.side = kSide[face];
    c.side_at = (face == 2 || face == 3 ? w.padded_rows : 0) + row;
    c.up = face < 4 ? -w.friction : face == 4 ? 1.0 : -1.0;
    c.up_at = 2 * w.padded_rows + row;
    c.bound = face < 4 ? 0.0 : face == 4 ? w.fz_max[row] : -w.fz_min[row];
    return c;
  }
  /// c v
  static double along(const Constraint& c, const double* v) noexcept {
    return c.side * v[c.side_at] + c.up * v[c.up_at];
  }
  const double* column_of(int i) const noexcept {
    return w.columns + static_cast<std::int64_t>(w.column_of[i]) * 3 * w.padded_rows;
  }
  double* row_of_L_inverse(int a) noexcept { return w.L_inverse + static_cast<std::int64_t>(a) * w.stride; }
  int blocks() const noexcept { return (w.active + 7) / 8; }

  void clear() noexcept {
    for (int a = 0; a < w.active; ++a) {
      double* row = row_of_L_inverse(a);
      for (int b = 0; b <= a / 8; ++b) store(row + 8 * b, zeros());
      w.is_active[w.constraint[a].id] = 0;
      w.active_in_row[w.constraint[a].id / kFaces] = 0;
    }
    w.active = 0;
  }

  /// direction = L^-T L^-1 right, right padded with zeros; returns |L^-1 right|^2.
  double solve_small() noexcept {
    const int n = blocks();
    for (int a = w.active; a < 8 * n; ++a) w.right[a] = 0.0;
    Vec squares = zeros();
    for (int b = 0; b < n; ++b) {
      Vec partial[8];
      const Vec first = load(w.right);
      for (int i = 0; i < 8; ++i) partial[i] = load(row_of_L_inverse(8 * b + i)) * first;
      for (int c = 1; c <= b; ++c) {
        const Vec r = load(w.right + 8 * c);
        for (int i = 0; i < 8; ++i) partial[i] = add_product(partial[i], load(row_of_L_inverse(8 * b + i) + 8 * c), r);
      }
      const Vec l = sums(partial);
      store(w.half + 8 * b, l);
      squares = add_product(squares, l, l);
    }
    for (int b = 0; b < n; ++b) {
      Vec partial[4] = {zeros(), zeros(), zeros(), zeros()};
      for (int a = 8 * b; a < 8 * n; a += 4) {
        for (int i = 0; i < 4; ++i) {
          partial[i] = add_product(partial[i], all(w.half[a + i]), load(row_of_L_inverse(a + i) + 8 * b));
        }
      }
      store(w.direction + 8 * b, (partial[0] + partial[1]) + (partial[2] + partial[3]));
    }
    return sum(squares);
  }

  /// direction = M^-1 C_A v; returns the curvature c v that the active set leaves to constraint c, v = H^-1 c.
  double curvature_left(const Constraint& c, const double* v) noexcept {
    for (int a = 0; a < w.active; ++a) w.right[a] = along(w.constraint[a], v);
    return along(c, v) - solve_small();
  }

  /// Appends constraint c; `left` and direction as curvature_left gave them.
  void append(const Constraint& c, const double* v, double left) noexcept {
    const int k = w.active;
    double* row = row_of_L_inverse(k);
    const double scale = 1.0 / __builtin_sqrt(left);
    for (int a = 0; a < k; ++a) row[a] = -w.direction[a] * scale;
    row[k] = scale;
    for (int a = k + 1; a < 8 * (k / 8 + 1); ++a) row[a] = 0.0;
    w.constraint[k] = c;
    w.column[k] = v;
    w.excess[k] = along(c, w.free_forces) - c.bound;
    w.is_active[c.id] = 1;
    ++w.active_in_row[c.id / kFaces];
    ++w.active;
  }

  /// Appends i where it depends on none that is active and there is room.
  bool try_append(int i) noexcept {
    if (w.active == w.max_active) return false;
    const double* v = column_of(i);
    const Constraint c = constraint_of(i);
    const double left = curvature_left(c, v);
    if (!(left > kDependent * along(c, v))) return false;
    append(c, v, left);
    return true;
  }

  /// Drops the j-th active constraint: rotations of neighbouring rows gather column j of L^-1 in the last row, which
  /// goes with it.
  void drop(int j) noexcept {
    const int k = w.active;
    w.is_active[w.constraint[j].id] = 0;
    --w.active_in_row[w.constraint[j].id / kFaces];
    // half: column j from row j on; right: the norms of its first entries
    double squares = 0.0;
    for (int i = j; i < k; ++i) {
      const double x = row_of_L_inverse(i)[j];
      squares += x * x;
      w.half[i] = x;
      w.right[i] = __builtin_sqrt(squares);
    }
    const double begin = w.half[j];
    for (int i = j; i + 1 < k; ++i) {
      const double r = 1.0 / w.right[i + 1];
      w.direction[i] = w.half[i + 1] * r;             // cosine
      w.half[i] = (i == j ? begin : w.right[i]) * r;  // sine
    }
    for (int i = j; i + 1 < k; ++i) {
      double* a = row_of_L_inverse(i);
      double* b = row_of_L_inverse(i + 1);
      const Vec cosine = all(w.direction[i]);
      const Vec sine = all(w.half[i]);
      const int n = (i + 1) / 8 + 1;
      if (n > i / 8 + 1) store(a + 8 * (n - 1), zeros());
      for (int q = 0; q < n; ++q) {
        const Vec x = load(a + 8 * q);
        const Vec y = load(b + 8 * q);
        store(a + 8 * q, cosine * x - sine * y);
        store(b + 8 * q, sine * x + cosine * y);
      }
      for (int q = j; q <= i; ++q) a[q] = a[q + 1];  // column j is gone
      a[i + 1] = 0.0;
    }
    for (int q = 0; q <= (k - 1) / 8; ++q) store(row_of_L_inverse(k - 1) + 8 * q, zeros());
    for (int i = j; i + 1 < k; ++i) {
      w.constraint[i] = w.constraint[i + 1];
      w.multiplier[i] = w.multiplier[i + 1];
      w.excess[i] = w.excess[i + 1];
      w.column[i] = w.column[i + 1];
    }
    --w.active;
  }

  /// Multipliers of the active set; drops the negative ones until there are none.
  void settle() noexcept {
    for (bool dropped = true; dropped && w.active > 0;) {
      for (int a = 0; a < w.active; ++a) w.right[a] = w.excess[a];
      solve_small();
      for (int a = 0; a < w.active; ++a) w.multiplier[a] = w.direction[a];
      dropped = false;
      for (int a = w.active - 1; a >= 0; --a) {
        if (w.multiplier[a] < 0.0) {
          drop(a);
          dropped = true;
        }
      }
    }
  }

  void begin_with_guesses() noexcept {
    if (w.num_guesses == 0) return;
    if (w.max_columns - w.num_columns < w.num_guesses) forget_columns(w);
    if (!take_columns(w, w.guesses, w.num_guesses)) return;
    for (int i = 0; i < w.num_guesses; ++i) try_append(w.guesses[i]);
    settle();
  }

  /// forces = free_forces - V y
  void combine() noexcept {
    const int n = 3 * w.padded_rows;
    const double* from = w.free_forces;
    int a = 0;
    for (; a + 4 <= w.active; a += 4) {
      const double* const* v = w.column + a;
      const Vec y0 = all(w.multiplier[a]);
      const Vec y1 = all(w.multiplier[a + 1]);
      const Vec y2 = all(w.multiplier[a + 2]);
      const Vec y3 = all(w.multiplier[a + 3]);
      for (int i = 0; i < n; i += 8) {
        Vec u = subtract_product(load(from + i), y0, load(v[0] + i));
        Vec t = y1 * load(v[1] + i);
        u = subtract_product(u, y2, load(v[2] + i));
        t = add_product(t, y3, load(v[3] + i));
        store(w.forces + i, u - t);
      }
      from = w.forces;
    }
    for (; a < w.active; ++a) {
      const Vec y = all(w.multiplier[a]);
      const double* v = w.column[a];
      for (int i = 0; i < n; i += 8) store(w.forces + i, subtract_product(load(from + i), y, load(v + i)));
      from = w.forces;
    }
    if (w.active == 0) {
      for (int i = 0; i < n; i += 8) store(w.forces + i, load(from + i));
    }
  }

  /// violation of every contact; returns the largest.
  double scan() noexcept {
    const double* x = w.forces;
    const double* y = x + w.padded_rows;
    const double* z = y + w.padded_rows;
    const Vec friction = all(w.friction);
    Vec worst = all(-1.0);
    for (int row = 0; row < w.padded_rows; row += 8) {
      const Vec fz = load(z + row);
      const Vec face = subtract_product(larger(magnitude(load(x + row)), magnitude(load(y + row))), friction, fz);
      const Vec outside = larger(fz - load(w.fz_max + row), load(w.fz_min + row) - fz);
      const Vec v = larger(face, outside);
      store(w.violation + row, v);
      worst = larger(v, worst);
    }
    return largest(worst);
  }

  /// The constraint of contact `row` that is violated most.
  int worst_of(int row) const noexcept {
    const double x = w.forces[row];
    const double y = w.forces[w.padded_rows + row];
    const double z = w.forces[2 * w.padded_rows + row];
    const double ax = __builtin_fabs(x);
    const double ay = __builtin_fabs(y);
    const double face = (ax >= ay ? ax : ay) - w.friction * z;
    const double above = z - w.fz_max[row];
    const double below = w.fz_min[row] - z;
    if (above >= face && above >= below) return kFaces * row + 4;
    if (below > face) return kFaces * row + 5;
    return kFaces * row + (ax >= ay ? (x < 0.0 ? 1 : 0) : (y < 0.0 ? 3 : 2));
  }
  int most_violated(double worst) const noexcept {
    int row = 0;
    while (w.violation[row] != worst) ++row;
    return worst_of(row);
  }

  /// Appends all violated constraints where they are few. Whether any was.
  bool append_block() noexcept {
    int count = 0;
    for (int row = 0; row < w.padded_rows; ++row) {
      if (!(w.violation[row] > w.tolerance)) continue;
      const double x = w.forces[row];
      const double y = w.forces[w.padded_rows + row];
      const double z = w.forces[2 * w.padded_rows + row];
      const double face = w.friction * z;
      const struct {
        int id;
        double violation;
      } violated[3] = {{x < 0.0 ? 1 : 0, __builtin_fabs(x) - face},
                       {y < 0.0 ? 3 : 2, __builtin_fabs(y) - face},
                       {z > w.fz_max[row] ? 4 : 5, z > w.fz_max[row] ? z - w.fz_max[row] : w.fz_min[row] - z}};
      int active = w.active_in_row[row];
      for (const auto& c : violated) {
        const int i = kFaces * row + c.id;
        if (c.violation > w.tolerance && w.is_active[i] == 0 && active < kPerContact) {
          if (count == kMaxBlock) return false;
          w.candidates[count++] = i;
          ++active;
        }
      }
    }
    if (!take_columns(w, w.candidates, count)) return false;
    bool any = false;
    for (int i = 0; i < count; ++i) any = try_append(w.candidates[i]) || any;
    return any;
  }

  /// The column of constraint i; where it is to be made, those of the next most violated come along in its lanes.
  bool fetch(int i) noexcept {
    if (w.column_of[i] >= 0) return true;
    int ids[8] = {i};
    double violation[8] = {};
    int count = 1;
    for (int row = 0; row < w.padded_rows; ++row) {
      const double v = w.violation[row];
      if (!(v > w.tolerance) || (count == 8 && v <= violation[7])) continue;
      const int other = worst_of(row);
      if (other == i || w.column_of[other] >= 0) continue;
      int at = count < 8 ? count++ : 7;
      for (; at > 1 && violation[at - 1] < v; --at) {
        violation[at] = violation[at - 1];
        ids[at] = ids[at - 1];
      }
      violation[at] = v;
      ids[at] = other;
    }
    const int room = w.max_columns - w.num_columns;
    return take_columns(w, ids, count < room ? count : room) && w.column_of[i] >= 0;
  }

  /// One step of Goldfarb and Idnani: constraint i, violated by `violation`, becomes active; those whose multipliers
  /// reach zero on the way are dropped.
  Outcome step(int i, double violation) noexcept {
    if (!fetch(i)) return Outcome::kOutOfBudget;
    const double* v = column_of(i);
    const Constraint c = constraint_of(i);
    const double curvature = along(c, v);
    double multiplier = 0.0;
    for (;;) {
      const double left = curvature_left(c, v);
      const bool independent = left > kDependent * curvature;
      int blocking = -1;
      double blocking_step = 0.0;
      for (int a = 0; a < w.active; ++a) {
        if (w.direction[a] <= kNoMultiplier) continue;
        const double to_zero = w.multiplier[a] / w.direction[a];
        if (blocking < 0 || to_zero < blocking_step) {
          blocking = a;
          blocking_step = to_zero;
        }
      }
      const double full_step = independent ? violation / left : 0.0;
      if (independent && (blocking < 0 || full_step <= blocking_step)) {
        if (w.active == w.max_active) return Outcome::kOutOfBudget;
        for (int a = 0; a < w.active; ++a) w.multiplier[a] -= full_step * w.direction[a];
        append(c, v, left);
        w.multiplier[w.active - 1] = multiplier + full_step;
        return Outcome::kSolved;
      }
      if (blocking < 0) return Outcome::kSingular;
      if (w.iterations == w.max_iterations) return Outcome::kOutOfBudget;
      ++w.iterations;
      for (int a = 0; a < w.active; ++a) w.multiplier[a] -= blocking_step * w.direction[a];
      multiplier += blocking_step;
      if (independent) violation -= blocking_step * left;
      drop(blocking);
    }
  }

  /// What rounding left of the active constraints, taken out through the multipliers.
  void correct_rounding() noexcept {
    double worst = 0.0;
    for (int a = 0; a < w.active; ++a) {
      w.right[a] = along(w.constraint[a], w.forces) - w.constraint[a].bound;
      const double size = __builtin_fabs(w.right[a]);
      worst = size > worst ? size : worst;
    }
    if (!(worst > kExactlyActive * w.tolerance)) return;
    solve_small();
    const double* from = w.forces;
    for (int a = 0; a < w.active; ++a) {
      w.multiplier[a] += w.direction[a];
      const Vec y = all(w.direction[a]);
      const double* v = w.column[a];
      for (int i = 0; i < 3 * w.padded_rows; i += 8) {
        store(w.forces + i, subtract_product(load(from + i), y, load(v + i)));
      }
    }
  }

  Workspace<NC>& w;
};

template <int NC>
Outcome solve(Workspace<NC>& w) noexcept {
  return ActiveSet<NC>(w).solve();
}
template <int NC>
void refine(Workspace<NC>& w) noexcept {
  ActiveSet<NC>(w).refine();
}

template <int NC>
constexpr Path<NC> path() noexcept {
  return {&factor<NC>, &take_ahead<NC>, &solve<NC>, &refine<NC>};
}

}  // namespace stance::force_qp::structured::STANCE_ISA
