#pragma once
// The active set of the structured engine, for the path of simd.hpp that is included before it. The mathematics stands
// in structured.hpp; names are its.
#include "controller/force_qp/structured/held_faces.hpp"
#include "controller/force_qp/structured/signed_factor.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

constexpr int kMaxBlock = 32;     // constraints in one block
constexpr int kPerContact = 3;    // active constraints of a contact, at most, when appended in blocks
constexpr int kMaxPasses = 6;     // without held faces, in which all that is negative is dropped at once
constexpr int kFewGuesses = 16;   // to begin with: more are held, where columns are to be made ..
constexpr int kManyGuesses = 60;  // .. and where they are kept
constexpr int kManyChanges = 32;  // of a set that is held, before another is
constexpr int kMaxHolds = 30;
constexpr double kDependent = 1e-11;     // of a constraint's own curvature: what is left of it below this is nothing
constexpr double kRounding = 30.0;       // of the tolerance: violations that may be no more than rounding ..
constexpr int kMaxInRounding = 5;        // .. if they do not go
constexpr double kNoMultiplier = 1e-13;  // change of a multiplier that counts as none
constexpr double kNever = 1e300;         // a step that no multiplier stops
constexpr double kExactlyActive = 1e-4;  // of the tolerance: an active constraint is met to this, or refined

/// The dual active set over the columns; see structured.hpp.
template <int NC>
class ActiveSet {
 public:
  explicit ActiveSet(Workspace<NC>& workspace) noexcept : w(workspace) {}

  Outcome solve() noexcept {
    w.iterations = 0;
    clear();
    w.holds = w.num_guesses > (w.free_columns.num == 0 ? kFewGuesses : kManyGuesses);
    if (w.holds) {
      take_guesses();
      if (!begin_held()) return Outcome::kSingular;
    } else {
      if (!w.factor_stands && !factor(w)) return Outcome::kSingular;
      sweep<false>(w, nullptr, nullptr, w.start);
      begin_with_guesses();
    }
    int in_rounding = 0;
    int passes = w.holds ? kMaxPasses : 0;
    for (;;) {
      Outcome outcome = Outcome::kSolved;
      if (passes++ < kMaxPasses) {
        settle();
      } else {
        outcome = ascend();
      }
      if (outcome != Outcome::kSolved) return outcome;
      if (is_crowded()) {
        take_active();
        if (!begin_held()) return Outcome::kSingular;
        passes = kMaxPasses;
        continue;
      }
      const double worst = scan();
      if (!(worst > w.tolerance)) break;  // a number that is none is caught by the independent check
      if (worst <= kRounding * w.tolerance && ++in_rounding > kMaxInRounding) break;  // so is this, and refined
      if (w.iterations == w.max_iterations) return Outcome::kOutOfBudget;
      ++w.iterations;
      if (!append_block(worst)) outcome = step(most_violated(worst), worst);
      if (outcome != Outcome::kSolved) return outcome;
    }
    correct_rounding();
    name_multipliers();
    return Outcome::kSolved;
  }

  void refine() noexcept {
    // pull = C_A' y
    double* pull = w.way;
    for (int i = 0; i < gradients(); ++i) pull[i] = 0.0;
    for (int a = 0; a < w.M.size; ++a) {
      if (w.M.sign[a] > 0.0) add_normal(pull, w.constraint[a].id, w.multiplier[a]);
    }
    (w.holds ? sweep<true, NC> : sweep<false, NC>)(w, w.state, pull, w.state);
    if (w.holds) {
      double* gradient = w.state + gradients();
      gradient_at<NC>(w, w.state, gradient);
      for (int i = 0; i < gradients(); ++i) gradient[i] += pull[i];
    }
    correct_rounding();
  }

 private:
  /// Constraint `id` as a function of the forces; of the gradient, its multiplier, where it is held.
  Constraint constraint_of(int id) const noexcept {
    const int row = id / kFaces;
    const int face = id % kFaces;
    Constraint c;
    c.id = id;
    if (is_held(w, id)) {
      way_off(id, Held(w.held[row], w.fz_min[row]), w.friction, c.n);
      for (double& n : c.n) n = -n;
      c.at = gradients() + row;
      c.bound = 0.0;
    } else {
      normal(id, w.friction, c.n);
      c.at = row;
      c.bound = face < 4 ? 0.0 : face == 4 ? w.fz_max[row] : -w.fz_min[row];
    }
    return c;
  }
  /// n' of it
  double along(const Constraint& c, const double* v) const noexcept {
    v += c.at;
    return (c.n[0] * v[0] + c.n[1] * v[w.padded_rows]) + c.n[2] * v[2 * w.padded_rows];
  }
  const double* column_of(int i) const noexcept {
    const Columns& columns = columns_of(w);
    return columns.values + static_cast<std::int64_t>(columns.of[i]) * length();
  }
  int length() const noexcept { return length_of_state(w); }
  int gradients() const noexcept { return gradients_of_state(w); }

  void clear() noexcept {
    for (int a = 0; a < w.M.size; ++a) set_status(w.constraint[a].id, kIdle);
    drop_all_pivots(w.M);
    for (int row = 0; row < w.held_rows; ++row) {
      for (int face = 0; face < kFaces; ++face) w.status[kFaces * row + face] = kIdle;
      w.active_in_row[row] = 0;
    }
    w.held_rows = 0;
  }
  void set_status(int id, Status status) noexcept {
    w.active_in_row[id / kFaces] =
        static_cast<std::int8_t>(w.active_in_row[id / kFaces] + (status == kActive) - (w.status[id] == kActive));
    w.status[id] = status;
    if (is_held(w, id)) w.still[id % kFaces / 2 * w.padded_rows + id / kFaces] = status == kActive ? 1.0 : 0.0;
  }

  // ---- Held faces

  /// What to hold, and the gradients that its multipliers come from, as the last solution had them.
  void take_guesses() noexcept {
    for (int row = 0; row < w.padded_rows; ++row) w.next_held[row] = 0;
    for (int i = 0; i < gradients(); ++i) w.before[i] = 0.0;
    for (int i = 0; i < w.num_guesses; ++i) {
      std::uint8_t& next = w.next_held[w.guesses[i] / kFaces];
      next = static_cast<std::uint8_t>(next | 1U << (w.guesses[i] % kFaces));
      add_normal(w.before, w.guesses[i], -w.guess_multiplier[i]);
    }
    for (int row = 0; row < w.rows; ++row) {
      w.next_held[row] = holdable(w.next_held[row], w.before[row], w.before[w.padded_rows + row]);
    }
  }
  /// The same of what is active now.
  void take_active() noexcept {
    for (int i = 0; i < gradients(); ++i) w.before[i] = w.holds ? w.state[gradients() + i] : 0.0;
    for (int a = 0; a < w.M.size; ++a) {
      if (w.M.sign[a] > 0.0) add_normal(w.before, w.constraint[a].id, -w.multiplier[a]);
    }
    for (int row = 0; row < w.padded_rows; ++row) {
      unsigned faces = 0;
      for (int face = 0; face < kFaces; ++face) {
        faces |= static_cast<unsigned>(w.status[kFaces * row + face] == kActive) << face;
      }
      w.next_held[row] = holdable(faces, w.before[row], w.before[w.padded_rows + row]);
    }
  }
  /// to += c_i y
  void add_normal(double* to, int i, double y) const noexcept {
    double n[3];
    normal(i, w.friction, n);
    for (int d = 0; d < 3; ++d) to[i / kFaces + d * w.padded_rows] += n[d] * y;
  }

  /// Whether so much has changed that it pays to hold the set as it is and begin again.
  bool is_crowded() const noexcept {
    if (holds_ == kMaxHolds) return false;
    if (lost_) return true;
    if (!w.holds) return w.M.size > kManyGuesses;
    return w.M.size > kManyChanges || is_short_of_room(w, w.held_columns, kColumnRoom);
  }

  /// Holds `next_held` instead of what is held or active now: the minimiser within it in `start`, and in `state` the
  /// multipliers of `before`, as far as they are positive.
  bool begin_held() noexcept {
    ++holds_;
    lost_ = false;
    clear();
    w.holds = true;
    w.held_rows = w.rows;
    forget(w.held_columns);
    if (!hold(w)) return false;
    // Where so much has changed since the first set, many are to be let go
    while (holds_ == 2 && keep_positive(w) > kManyNegative && w.iterations < w.max_iterations) {
      ++w.iterations;
      if (!hold(w)) return false;
    }
    for (int i = 0; i < length(); i += 8) store(w.start + i, load(w.state + i));
    for (int i = 0; i < gradients(); i += 8) {
      store(w.side + i, zeros());
      store(w.still + i, zeros());
    }
    for (int row = 0; row < w.rows; ++row) {
      if (w.held[row] == 0) continue;
      const double* before = w.before + row;
      if (Held(w.held[row], w.fz_min[row]).apex) {
        w.held[row] = apex_with_sides(before[0], before[w.padded_rows]);
      }
      const Held h(w.held[row], w.fz_min[row]);
      const int sides[3] = {h.x, h.y, h.z};
      double y[3];
      held_multipliers(h, w.friction, w.padded_rows, before, y);
      for (int axis = 0; axis < 3; ++axis) {
        if (!(y[axis] > 0.0)) y[axis] = 0.0;
        if (sides[axis] == 0) continue;
        w.side[axis * w.padded_rows + row] = sides[axis];
        set_status(held_constraint(row, axis), kActive);
      }
      double* d = w.state + gradients() + row;
      d[0] = -h.x * y[0];
      d[w.padded_rows] = -h.y * y[1];
      d[2 * w.padded_rows] = w.friction * (y[0] + y[1]) - h.z * y[2];
    }
    return true;
  }

  /// direction = M^-1 C_A v; returns the pivot that the active set leaves to constraint c with column v.
  double pivot_left(const Constraint& c, const double* v) noexcept {
    for (int a = 0; a < w.M.size; ++a) w.M.right[a] = along(w.constraint[a], v);
    return along(c, v) - solve_factored(w.M);
  }

  /// Appends constraint c; |left| and direction as pivot_left gave them.
  void append(const Constraint& c, const double* v, double left) noexcept {
    const int k = w.M.size;
    const bool released = is_held(w, c.id);
    w.constraint[k] = c;
    w.column[k] = v;
    w.excess[k] = along(c, w.start) - c.bound;
    w.multiplier[k] = 0.0;
    set_status(c.id, released ? kReleased : kActive);
    append_pivot(w.M, released ? -1.0 : 1.0, left);
  }

  /// Appends i where it depends on none that is active and there is room.
  bool try_append(int i) noexcept {
    if (w.M.size == w.max_active) return false;
    const double* v = column_of(i);
    const Constraint c = constraint_of(i);
    const double sign = is_held(w, i) ? -1.0 : 1.0;
    const double left = sign * pivot_left(c, v);
    if (!(left > kDependent * (sign * along(c, v)))) return false;
    append(c, v, left);
    return true;
  }

  /// Drops the j-th active constraint.
  void drop(int j) noexcept {
    set_status(w.constraint[j].id, w.M.sign[j] < 0.0 ? kActive : kIdle);
    lost_ = !drop_pivot(w.M, j) || lost_;
    for (int i = j; i < w.M.size; ++i) {
      w.constraint[i] = w.constraint[i + 1];
      w.multiplier[i] = w.multiplier[i + 1];
      w.excess[i] = w.excess[i + 1];
      w.column[i] = w.column[i + 1];
    }
  }

  /// The minimiser of the active set, or of what is left of it: what has a negative multiplier is dropped at once.
  void settle() noexcept {
    for (bool dropped = true; dropped;) {
      for (int a = 0; a < w.M.size; ++a) w.M.right[a] = w.excess[a];
      solve_factored(w.M);
      for (int a = 0; a < w.M.size; ++a) w.multiplier[a] = w.M.direction[a];
      dropped = false;
      for (int a = w.M.size - 1; a >= 0; --a) {
        if (w.multiplier[a] < 0.0) {
          drop(a);
          dropped = true;
        }
      }
    }
    combine();
  }

  /// From multipliers none of which is negative to those of the active set, or of what is left of it: what reaches zero
  /// on the way is dropped. Ends early where the set is crowded.
  Outcome ascend() noexcept {
    for (;;) {
      if (is_crowded()) return Outcome::kSolved;
      if (lost_) return Outcome::kSingular;
      for (int a = 0; a < w.M.size; ++a) w.M.right[a] = w.excess[a];
      solve_factored(w.M);
      if (w.holds) {
        subtract_columns(w.start, w.M.direction, w.way, gradients());
        for (int i = gradients(); i < length(); i += 8) store(w.way + i, load(w.state + i) - load(w.way + i));
      }
      for (int a = 0; a < w.M.size; ++a) w.M.direction[a] = w.multiplier[a] - w.M.direction[a];
      const Blocking first = blocking();
      if (!first.any() || first.step >= 1.0) break;
      if (w.iterations == w.max_iterations) return Outcome::kOutOfBudget;
      ++w.iterations;
      go(first.step);
      if (first.at >= 0) {
        drop(first.at);
      } else if (!release(first.id)) {
        lost_ = true;
      }
    }
    for (int a = 0; a < w.M.size; ++a) w.multiplier[a] -= w.M.direction[a];
    combine();
    return Outcome::kSolved;
  }

  /// The constraint of contact `row` that is held along an axis, where one is.
  int held_constraint(int row, int axis) const noexcept {
    return kFaces * row + 2 * axis + static_cast<int>(w.side[axis * w.padded_rows + row] < 0.0);
  }
  bool is_untouched_apex(int row) const noexcept {
    bool untouched = Held(w.held[row], w.fz_min[row]).apex;
    for (int axis = 0; axis < 3; ++axis) untouched = untouched && w.status[held_constraint(row, axis)] == kActive;
    return untouched;
  }
  /// At the apex both sides hold: the other one takes the name, and the multiplier with its sign turned.
  void turn_side(int row, int axis) noexcept {
    set_status(held_constraint(row, axis), kIdle);
    w.held[row] = static_cast<std::uint8_t>(w.held[row] ^ (3U << (2 * axis)));
    w.side[axis * w.padded_rows + row] = -w.side[axis * w.padded_rows + row];
    set_status(held_constraint(row, axis), kActive);
    for (int i = 0; i < kFaces; ++i) w.held_columns.of[kFaces * row + i] = -1;
  }

  /// Of all active constraints, into `last_multiplier`.
  void name_multipliers() noexcept {
    for (int a = 0; a < w.M.size; ++a) w.last_multiplier[w.constraint[a].id] = w.multiplier[a];
    for (int row = 0; row < w.held_rows; ++row) {
      if (w.held[row] == 0) continue;
      const Held h(w.held[row], w.fz_min[row]);
      double y[3];
      held_multipliers(h, w.friction, w.padded_rows, w.state + gradients() + row, y);
      for (int axis = 0; axis < 3; ++axis) {
        const int i = held_constraint(row, axis);
        if (w.status[i] == kActive && is_held(w, i)) w.last_multiplier[i] = y[axis];
      }
    }
  }

  void begin_with_guesses() noexcept {
    if (is_short_of_room(w, w.free_columns, w.num_guesses + kColumnRoom)) {
      forget(w.free_columns);
      w.ahead = 0;
    }
    if (w.num_guesses == 0 || !take_columns(w, w.guesses, w.num_guesses)) return;
    for (int i = 0; i < w.num_guesses; ++i) {
      if (try_append(w.guesses[i])) w.multiplier[w.M.size - 1] = w.guess_multiplier[i];
    }
  }

  /// to = from - V y
  void subtract_columns(const double* from, const double* y, double* to, int begin = 0) const noexcept {
    const int n = length();
    int a = 0;
    for (; a + 4 <= w.M.size; a += 4) {
      const double* const* v = w.column + a;
      const Vec y0 = all(y[a]);
      const Vec y1 = all(y[a + 1]);
      const Vec y2 = all(y[a + 2]);
      const Vec y3 = all(y[a + 3]);
      for (int i = begin; i < n; i += 8) {
        Vec u = subtract_product(load(from + i), y0, load(v[0] + i));
        Vec t = y1 * load(v[1] + i);
        u = subtract_product(u, y2, load(v[2] + i));
        t = add_product(t, y3, load(v[3] + i));
        store(to + i, u - t);
      }
      from = to;
    }
    for (; a < w.M.size; ++a) {
      const Vec ya = all(y[a]);
      const double* v = w.column[a];
      for (int i = begin; i < n; i += 8) store(to + i, subtract_product(load(from + i), ya, load(v + i)));
      from = to;
    }
    if (from != to) {
      for (int i = begin; i < n; i += 8) store(to + i, load(from + i));
    }
  }
  void combine() noexcept { subtract_columns(w.start, w.multiplier, w.state); }

  /// violation of every contact; returns the largest.
  double scan() noexcept {
    const double* x = w.state;
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
    const double x = w.state[row];
    const double y = w.state[w.padded_rows + row];
    const double z = w.state[2 * w.padded_rows + row];
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

  /// Appends all violated constraints; where they are many, the most violated, by half and more. Whether any was.
  bool append_block(double worst) noexcept {
    int count = candidates_beyond(w.tolerance);
    if (count > kMaxBlock) count = candidates_beyond(0.5 * worst);
    if (count > kMaxBlock) count = kMaxBlock;
    if (!take_columns(w, w.candidates, count)) return false;
    bool any = false;
    for (int i = 0; i < count; ++i) {
      if (w.status[w.candidates[i]] == kReleased) {
        drop(index_of(w.candidates[i]));
        any = true;
      } else {
        any = try_append(w.candidates[i]) || any;
      }
    }
    return any;
  }
  /// Collects constraints that are violated by more than `limit` and may become active.
  int candidates_beyond(double limit) noexcept {
    int count = 0;
    for (int row = 0; row < w.padded_rows; ++row) {
      if (!(w.violation[row] > limit)) continue;
      const double x = w.state[row];
      const double y = w.state[w.padded_rows + row];
      const double z = w.state[2 * w.padded_rows + row];
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
        if (c.violation > limit && w.status[i] != kActive && active < kPerContact) {
          w.candidates[count++] = i;
          ++active;
        }
      }
    }
    return count;
  }
  int index_of(int id) const noexcept {
    int a = 0;
    while (w.constraint[a].id != id) ++a;
    return a;
  }

  /// Up to eight constraints that need columns, the most urgent first, behind one that is needed now.
  struct Wanted {
    int ids[8];
    double urgency[8];
    int count;
    explicit Wanted(int id) noexcept : ids{id}, urgency{}, count(1) {}
    void add(int id, double how_urgent) noexcept {
      if (id == ids[0] || (count == 8 && how_urgent <= urgency[7])) return;
      int at = count < 8 ? count++ : 7;
      for (; at > 1 && urgency[at - 1] < how_urgent; --at) {
        urgency[at] = urgency[at - 1];
        ids[at] = ids[at - 1];
      }
      urgency[at] = how_urgent;
      ids[at] = id;
    }
  };
  bool take(const Wanted& wanted) noexcept {
    const Columns& columns = columns_of(w);
    const int room = columns.max - columns.num;
    return take_columns(w, wanted.ids, wanted.count < room ? wanted.count : room) && columns.of[wanted.ids[0]] >= 0;
  }

  /// The column of constraint i; where it is to be made, those of the next most violated come along in its lanes.
  bool fetch(int i) noexcept {
    const Columns& columns = columns_of(w);
    if (columns.of[i] >= 0) return true;
    Wanted wanted(i);
    for (int row = 0; row < w.padded_rows; ++row) {
      if (!(w.violation[row] > w.tolerance)) continue;
      const int other = worst_of(row);
      if (columns.of[other] < 0) wanted.add(other, w.violation[row]);
    }
    return take(wanted);
  }
  /// The same of one that is held, with those whose multipliers reach zero next, as `blocking` left them.
  bool fetch_held(int i) noexcept {
    const Columns& columns = columns_of(w);
    if (columns.of[i] >= 0) return true;
    Wanted wanted(i);
    for (int axis = 0; axis < 3; ++axis) {
      for (int row = 0; row < w.rows; ++row) {
        const double step = w.to_zero[axis * w.padded_rows + row];
        if (!(step < 1.0)) continue;
        const int other = held_constraint(row, axis);
        if (columns.of[other] < 0) wanted.add(other, 1.0 - step);
      }
    }
    return take(wanted);
  }

  /// What stops a step: an active constraint, or one that is held, whose multiplier reaches zero.
  struct Blocking {
    double step = 0.0;
    int at = -1;  ///< in the active set
    int id = -1;  ///< held
    bool any() const noexcept { return at >= 0 || id >= 0; }
    /// The least of multiplier / rate so far; one below zero by rounding counts as zero.
    bool is_met(double multiplier, double rate) noexcept {
      if (!(rate > kNoMultiplier)) return false;
      const double to_zero = multiplier > 0.0 ? multiplier / rate : 0.0;
      if (any() && to_zero >= step) return false;
      step = to_zero;
      return true;
    }
  };
  /// Along `direction` and `way`.
  Blocking blocking() const noexcept {
    Blocking first;
    for (int a = 0; a < w.M.size; ++a) {
      if (w.M.sign[a] > 0.0 && first.is_met(w.multiplier[a], w.M.direction[a])) first.at = a;
    }
    if (!w.holds) return first;
    const int P = w.padded_rows;
    const double* d = w.state + gradients();
    const double* rate_of_d = w.way + gradients();
    const Vec friction = all(w.friction);
    const Vec least = all(kNoMultiplier);
    const Vec never = all(kNever);
    Vec first_of_all = zeros() - never;
    for (int row = 0; row < P; row += 8) {
      const Vec side[3] = {load(w.side + row), load(w.side + P + row), load(w.side + 2 * P + row)};
      const auto multipliers = [&](const double* s, Vec(&y)[3]) noexcept {
        y[0] = zeros() - side[0] * load(s + row);
        y[1] = zeros() - side[1] * load(s + P + row);
        y[2] = side[2] * (friction * (y[0] + y[1]) - load(s + 2 * P + row));
      };
      Vec y[3], rate[3];
      multipliers(d, y);
      multipliers(rate_of_d, rate);
      for (int axis = 0; axis < 3; ++axis) {
        const Vec falls = rate[axis] * load(w.still + axis * P + row);
        const Vec step = where_larger(falls, least, larger(y[axis], zeros()) / falls, never);
        store(w.to_zero + axis * P + row, step);
        first_of_all = larger(first_of_all, zeros() - step);
      }
    }
    const double step = -largest(first_of_all);
    if (step == kNever || (first.any() && step >= first.step)) return first;
    int at = 0;
    while (at < 3 * P && w.to_zero[at] != step) ++at;
    if (at < 3 * P) first = {step, -1, held_constraint(at % P, at / P)};  // else a number that is none
    return first;
  }
  void go(double step) noexcept {
    for (int a = 0; a < w.M.size; ++a) w.multiplier[a] -= step * w.M.direction[a];
    if (!w.holds) return;
    const Vec t = all(step);
    for (int i = gradients(); i < length(); i += 8) {
      store(w.state + i, subtract_product(load(w.state + i), t, load(w.way + i)));
    }
  }
  /// Lets go of a held constraint whose multiplier is zero.
  bool release(int i) noexcept {
    const int row = i / kFaces;
    const int axis = i % kFaces / 2;
    if (axis < 2 && is_untouched_apex(row)) {
      turn_side(row, axis);
      return true;
    }
    return fetch_held(i) && try_append(i);
  }

  /// One step of Goldfarb and Idnani: constraint i, violated by `violation`, becomes active; those whose multipliers
  /// reach zero on the way are dropped.
  Outcome step(int i, double violation) noexcept {
    const bool was_held = w.status[i] == kReleased;
    // An active one is violated by rounding alone; where there is no column there is no room for it
    if (w.status[i] == kActive || !fetch(i)) {
      lost_ = true;
      return Outcome::kSolved;  // and the set is held anew
    }
    const double* v = column_of(i);
    const Constraint c = constraint_of(i);
    const double curvature = along(c, v);
    double multiplier = 0.0;
    for (;;) {
      if (lost_) {  // as above; what has been taken of the multiplier goes back
        for (int d = 0; d < 3 && w.holds && !was_held; ++d) {
          w.state[gradients() + c.at + d * w.padded_rows] -= c.n[d] * multiplier;
        }
        return Outcome::kSolved;
      }
      double rate = 0.0;  // at which the violation shrinks with the multiplier
      bool independent = false;
      if (was_held) {
        const int at = index_of(i);
        for (int a = 0; a < w.M.size; ++a) w.M.right[a] = 0.0;
        w.M.right[at] = 1.0;
        solve_factored(w.M);
        rate = -w.M.direction[at];
        independent = rate > 0.0;
      } else {
        rate = pivot_left(c, v);
        independent = rate > kDependent * curvature;
      }
      if (w.holds) {
        if (was_held) {
          for (int at = gradients(); at < length(); at += 8) store(w.way + at, zeros());
        }
        subtract_columns(was_held ? w.way : v, w.M.direction, w.way, gradients());
      }
      const Blocking first = blocking();
      const double full_step = independent ? violation / rate : 0.0;
      if (independent && (!first.any() || full_step <= first.step)) {
        if (w.M.size == w.max_active) return Outcome::kOutOfBudget;
        go(full_step);
        if (was_held) {
          drop(index_of(i));
        } else {
          append(c, v, rate);
          w.multiplier[w.M.size - 1] = multiplier + full_step;
        }
        if (!w.holds) combine();
        return Outcome::kSolved;
      }
      if (!first.any()) return Outcome::kSingular;
      if (w.iterations == w.max_iterations) return Outcome::kOutOfBudget;
      ++w.iterations;
      go(first.step);
      multiplier += first.step;
      if (independent) violation -= first.step * rate;
      if (first.at >= 0) {
        drop(first.at);
      } else if (!release(first.id)) {
        lost_ = true;
      }
    }
  }

  /// What rounding left of the active constraints, taken out through the multipliers.
  void correct_rounding() noexcept {
    double worst = 0.0;
    for (int a = 0; a < w.M.size; ++a) {
      w.M.right[a] = along(w.constraint[a], w.state) - w.constraint[a].bound;
      const double size = __builtin_fabs(w.M.right[a]);
      worst = size > worst ? size : worst;
    }
    if (!(worst > kExactlyActive * w.tolerance)) return;
    solve_factored(w.M);
    for (int a = 0; a < w.M.size; ++a) w.multiplier[a] += w.M.direction[a];
    subtract_columns(w.state, w.M.direction, w.state);
  }

  Workspace<NC>& w;
  int holds_ = 0;      ///< sets held in this solve
  bool lost_ = false;  ///< the way on, to rounding or for want of room: the set is to be held anew
};

}  // namespace stance::force_qp::structured::STANCE_ISA
