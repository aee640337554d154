#pragma once
// The structured engine's arithmetic, for the path of simd.hpp that is included before it. The mathematics stands in
// structured.hpp; names are its.
#include "controller/force_qp/structured/workspace.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

constexpr int kMaxPasses = 6;            // of appending constraints in blocks
constexpr int kMaxBlock = 16;            // constraints in one block
constexpr int kPerContact = 3;           // active constraints of a contact, at most, when appended in blocks
constexpr double kDependent = 1e-11;     // of a constraint's own curvature: what is left of it below this is nothing
constexpr double kNoMultiplier = 1e-13;  // change of a multiplier that counts as none
constexpr double kExactlyActive = 1e-4;  // of the tolerance: an active constraint is met to this, or refined

inline Vec load(const Lanes& from) noexcept { return load(from.v); }
inline void store(Lanes& to, const Vec& a) noexcept { store(to.v, a); }
/// Lane of component i, 0 <= i < 6, of two 3-vectors.
constexpr int lane_of(int i) noexcept { return i + i / 3; }
inline Vec entry(const Lanes& a, int i) noexcept { return all(a.v[lane_of(i)]); }

// ---- Products with the model --------------------------------------------------------------------------------------

/// Sum of columns[j] a_j over the two 3 x 3 blocks of a block-diagonal matrix given by its columns.
inline Vec block_diagonal(const Lanes (&columns)[3], const Vec& a) noexcept {
  Vec r = load(columns[0]) * lane_of_halves<0>(a);
  r = add_product(r, load(columns[1]), lane_of_halves<1>(a));
  return add_product(r, load(columns[2]), lane_of_halves<2>(a));
}
template <int NC>
inline Vec D_times(const Stage<NC>& s, const Vec& rate) noexcept {
  return block_diagonal(s.D, rate);
}
template <int NC>
inline Vec Dt_times(const Stage<NC>& s, const Vec& pose) noexcept {
  return block_diagonal(s.D_rows, pose);
}
/// c + C p
template <int NC>
inline Vec add_C_times(const Stage<NC>& s, Vec c, const Vec& pose) noexcept {
  if (!s.coupled) return c;
  c = add_product(c, load(s.C[0]), lane<4>(pose));
  c = add_product(c, load(s.C[1]), lane<5>(pose));
  return add_product(c, load(s.C[2]), lane<6>(pose));
}
/// c + C' omega
template <int NC>
inline Vec add_Ct_times(const Stage<NC>& s, Vec c, const Vec& rate) noexcept {
  if (!s.coupled) return c;
  c = add_product(c, load(s.C_rows[0]), lane<0>(rate));
  c = add_product(c, load(s.C_rows[1]), lane<1>(rate));
  return add_product(c, load(s.C_rows[2]), lane<2>(rate));
}
/// Contacts 2 pair and 2 pair + 1 of B' rate.
template <int M, int NC>
inline Vec Bt_times(const Stage<NC>& s, int pair, const Vec& rate) noexcept {
  const Vec first = block_diagonal(s.B_rows[2 * pair], rate);
  if constexpr (M == 1) {
    return low_halves(first, zeros()) + high_halves(first, zeros());
  } else {
    const Vec second = block_diagonal(s.B_rows[2 * pair + 1], rate);
    return low_halves(first, second) + high_halves(first, second);
  }
}
/// c + sum over a pair's forces of columns[i] f_i; `columns` are the pair's.
template <int M>
inline Vec add_columns(Vec c, const Lanes* columns, const Vec& f) noexcept {
  c = add_product(c, load(columns[0]), lane<0>(f));
  c = add_product(c, load(columns[1]), lane<1>(f));
  c = add_product(c, load(columns[2]), lane<2>(f));
  if constexpr (M > 1) {
    Vec d = load(columns[3]) * lane<4>(f);
    d = add_product(d, load(columns[4]), lane<5>(f));
    d = add_product(d, load(columns[5]), lane<6>(f));
    c = c + d;
  }
  return c;
}
template <int M, int NC>
inline Vec add_B_times(const Stage<NC>& s, Vec c, const Vec* f) noexcept {
  for (int pair = 0; 2 * pair < M; ++pair) c = add_columns<M>(c, s.B + 6 * pair, f[pair]);
  return c;
}
/// Contacts 2 pair and 2 pair + 1 of K x.
template <int M, int NC>
inline Vec K_times(const Gain<NC>& gain, int pair, const Vec& pose, const Vec& rate) noexcept {
  const auto contact = [&](const Lanes(&columns)[6]) noexcept {
    Vec a = load(columns[0]) * lane_of_halves<0>(pose);
    Vec b = load(columns[3]) * lane_of_halves<0>(rate);
    a = add_product(a, load(columns[1]), lane_of_halves<1>(pose));
    b = add_product(b, load(columns[4]), lane_of_halves<1>(rate));
    a = add_product(a, load(columns[2]), lane_of_halves<2>(pose));
    b = add_product(b, load(columns[5]), lane_of_halves<2>(rate));
    return a + b;
  };
  const Vec first = contact(gain.K_columns[2 * pair]);
  if constexpr (M == 1) {
    return low_halves(first, zeros()) + high_halves(first, zeros());
  } else {
    const Vec second = contact(gain.K_columns[2 * pair + 1]);
    return low_halves(first, second) + high_halves(first, second);
  }
}

/// Calls f.template operator()<M>() with the stage's number of slots.
template <int NC, typename F>
inline void with_slots(const Stage<NC>& s, F f) noexcept {
  if constexpr (NC >= 4) {
    if (s.slots == 4) return f.template operator()<4>();
  }
  if constexpr (NC >= 2) {
    if (s.slots == 2) return f.template operator()<2>();
  }
  f.template operator()<1>();
}

// ---- Factor -------------------------------------------------------------------------------------------------------

template <int NC>
inline void make_rows(Stage<NC>& s) noexcept {
  const auto transposed = [](const Lanes* columns, Lanes* rows, auto adjust) noexcept {
    Vec t[4] = {load(columns[0]), load(columns[1]), load(columns[2]), zeros()};
    transpose_halves(t);
    for (int i = 0; i < 3; ++i) store(rows[i], adjust(t[i]));
  };
  const auto as_it_is = [](const Vec& a) noexcept { return a; };
  transposed(s.D, s.D_rows, as_it_is);
  if (s.coupled) transposed(s.C, s.C_rows, [](const Vec& a) noexcept { return swap_halves(a); });
  for (int slot = 0; slot < s.slots; ++slot) transposed(s.B + 3 * slot, s.B_rows[slot], as_it_is);
}

/// X = H^-1 of a symmetric positive definite matrix by blocks, down to 3 x 3 cofactors:
///   H = [A W'; W D], S = D - W A^-1 W':   X = [A^-1 + V' S^-1 V, -V' S^-1; -S^-1 V, S^-1], V = W A^-1.
/// False where a leading minor that is met is not positive.
template <int n>
inline bool invert(const double (&H)[n][n], double (&X)[n][n]) noexcept {
  if constexpr (n == 3) {
    const double a = H[0][0], b = H[1][0], c = H[2][0], d = H[1][1], e = H[2][1], f = H[2][2];
    const double A = d * f - e * e, B = c * e - b * f, C = b * e - c * d;
    const double determinant = (a * A + b * B) + c * C;
    const double minor = a * d - b * b;
    if (!(a > 0.0 && minor > 0.0 && determinant > 0.0)) return false;
    const double r = 1.0 / determinant;
    X[0][0] = A * r;
    X[0][1] = X[1][0] = B * r;
    X[0][2] = X[2][0] = C * r;
    X[1][1] = (a * f - c * c) * r;
    X[1][2] = X[2][1] = (b * c - a * e) * r;
    X[2][2] = minor * r;
    return true;
  } else {
    constexpr int h = n / 2;
    double A[h][h], A_inverse[h][h], V[h][h], S[h][h], S_inverse[h][h];
    for (int i = 0; i < h; ++i) {
      for (int j = 0; j < h; ++j) A[i][j] = H[i][j];
    }
    if (!invert<h>(A, A_inverse)) return false;
    for (int i = 0; i < h; ++i) {
      for (int j = 0; j < h; ++j) {
        double v = 0.0;
        for (int m = 0; m < h; ++m) v += H[h + i][m] * A_inverse[m][j];
        V[i][j] = v;
      }
    }
    for (int i = 0; i < h; ++i) {
      for (int j = 0; j <= i; ++j) {
        double v = H[h + i][h + j];
        for (int m = 0; m < h; ++m) v -= V[i][m] * H[h + j][m];
        S[i][j] = S[j][i] = v;
      }
    }
    if (!invert<h>(S, S_inverse)) return false;
    for (int i = 0; i < h; ++i) {
      for (int j = 0; j < h; ++j) {
        double v = 0.0;
        for (int m = 0; m < h; ++m) v -= S_inverse[i][m] * V[m][j];
        X[h + i][j] = X[j][h + i] = v;
        X[h + i][h + j] = S_inverse[i][j];
      }
    }
    for (int i = 0; i < h; ++i) {
      for (int j = 0; j <= i; ++j) {
        double v = A_inverse[i][j];
        for (int m = 0; m < h; ++m) v -= V[m][i] * X[h + m][j];
        X[i][j] = X[j][i] = v;
      }
    }
    return true;
  }
}

/// One backward step: `next` is the cost-to-go of x_(k+1); `cost` becomes that of x_k, with Q of x_k added, where
/// `before`, stage k - 1, is given.
template <int M, int NC>
inline bool factor_stage(const Stage<NC>& s, const Stage<NC>* before, const Cost& next, Gain<NC>& gain,
                         Cost& cost) noexcept {
  constexpr int U = 3 * M;
  constexpr int kPairs = (M + 1) / 2;
  Vec PB_pose[U], PB_rate[U];  // P B
  for (int c = 0; c < U; ++c) {
    Vec pose = load(next.pose_rate[0]) * entry(s.B[c], 0);
    Vec rate = load(next.rate_rate[0]) * entry(s.B[c], 0);
    for (int i = 1; i < 6; ++i) {
      pose = add_product(pose, load(next.pose_rate[i]), entry(s.B[c], i));
      rate = add_product(rate, load(next.rate_rate[i]), entry(s.B[c], i));
    }
    PB_pose[c] = pose;
    PB_rate[c] = rate;
  }

  double Quu[U][U], X[U][U];
  for (int c = 0; c < U; ++c) {
    for (int pair = 0; pair < kPairs; ++pair) {
      Lanes column;
      store(column, Bt_times<M>(s, pair, PB_rate[c]));
      for (int i = 0; i < 6 && 6 * pair + i < U; ++i) Quu[c][6 * pair + i] = column.v[lane_of(i)];
    }
    Quu[c][c] += s.R[c];
  }
  if (!invert<U>(Quu, X)) return false;
  for (int pair = 0; pair < kPairs; ++pair) {
    for (int c = 0; c < U; ++c) {
      for (int i = 0; i < 6; ++i) gain.Quu_inverse[pair][c].v[lane_of(i)] = 6 * pair + i < U ? X[c][6 * pair + i] : 0.0;
    }
  }

  // Qux = B'P A and K
  Lanes Qux_pose[U], Qux_rate[U];
  for (int c = 0; c < U; ++c) {
    store(Qux_pose[c], add_Ct_times(s, PB_pose[c], PB_rate[c]));
    store(Qux_rate[c], Dt_times(s, PB_pose[c]) + PB_rate[c]);
  }
  Vec K_pose[U], K_rate[U];
  for (int c = 0; c < U; ++c) {
    Vec pose = all(X[c][0]) * load(Qux_pose[0]);
    Vec rate = all(X[c][0]) * load(Qux_rate[0]);
    for (int e = 1; e < U; ++e) {
      pose = add_product(pose, all(X[c][e]), load(Qux_pose[e]));
      rate = add_product(rate, all(X[c][e]), load(Qux_rate[e]));
    }
    K_pose[c] = pose;
    K_rate[c] = rate;
    store(gain.K_pose[c], pose);
    store(gain.K_rate[c], rate);
  }
  for (int slot = 0; slot < M; ++slot) {
    Vec t[4] = {K_pose[3 * slot], K_pose[3 * slot + 1], K_pose[3 * slot + 2], zeros()};
    transpose_halves(t);
    for (int j = 0; j < 3; ++j) store(gain.K_columns[slot][j], t[j]);
    Vec r[4] = {K_rate[3 * slot], K_rate[3 * slot + 1], K_rate[3 * slot + 2], zeros()};
    transpose_halves(r);
    for (int j = 0; j < 3; ++j) store(gain.K_columns[slot][3 + j], r[j]);
  }
  if (before == nullptr) return true;

  // A'P A - K' Qux + Q, column by column: j of pose, j of rate; the rate-pose block is the transpose of pose-rate
  static constexpr Lanes kUnit[6] = {
      {{1.0}}, {{0.0, 1.0}}, {{0.0, 0.0, 1.0}}, {{0, 0, 0, 0, 1.0}}, {{0, 0, 0, 0, 0, 1.0}}, {{0, 0, 0, 0, 0, 0, 1.0}}};
  Vec rate_rows[2][4];
#pragma GCC unroll 6
  for (int j = 0; j < 6; ++j) {
    const int block = j / 3 * 3;
    Vec PA_pose_pose = load(next.pose_pose[j]);
    Vec PA_rate_pose = load(next.rate_pose[j]);
    if (s.coupled && block == 3) {
      for (int i = 0; i < 3; ++i) {
        const Vec c = all(s.C[j - 3].v[i]);
        PA_pose_pose = add_product(PA_pose_pose, load(next.pose_rate[i]), c);
        PA_rate_pose = add_product(PA_rate_pose, load(next.rate_rate[i]), c);
      }
    }
    Vec PA_pose_rate = load(next.pose_rate[j]);
    Vec PA_rate_rate = load(next.rate_rate[j]);
    for (int i = 0; i < 3; ++i) {
      const Vec d = all(s.D[j - block].v[lane_of(block + i)]);
      PA_pose_rate = add_product(PA_pose_rate, load(next.pose_pose[block + i]), d);
      PA_rate_rate = add_product(PA_rate_rate, load(next.rate_pose[block + i]), d);
    }
    Vec pose_pose = add_Ct_times(s, PA_pose_pose, PA_rate_pose);
    Vec pose_rate = add_Ct_times(s, PA_pose_rate, PA_rate_rate);
    Vec rate_rate = Dt_times(s, PA_pose_rate) + PA_rate_rate;
    for (int c = 0; c < U; ++c) {
      const Vec rate = entry(Qux_rate[c], j);
      pose_pose = subtract_product(pose_pose, K_pose[c], entry(Qux_pose[c], j));
      pose_rate = subtract_product(pose_rate, K_pose[c], rate);
      rate_rate = subtract_product(rate_rate, K_rate[c], rate);
    }
    store(cost.pose_pose[j], add_product(pose_pose, load(before->Q_pose), load(kUnit[j])));
    store(cost.pose_rate[j], pose_rate);
    store(cost.rate_rate[j], add_product(rate_rate, load(before->Q_rate), load(kUnit[j])));
    rate_rows[j / 3][j % 3] = pose_rate;
  }
  for (Vec(&rows)[4] : rate_rows) {
    rows[3] = zeros();
    transpose_halves(rows);
  }
  for (int i = 0; i < 3; ++i) {
    store(cost.rate_pose[i], low_halves(rate_rows[0][i], rate_rows[1][i]));
    store(cost.rate_pose[3 + i], high_halves(rate_rows[0][i], rate_rows[1][i]));
  }
  return true;
}

template <int NC>
void forget_columns(Workspace<NC>& w) noexcept {
  for (int i = 0; i < w.num_columns; ++i) w.column_of[w.column_constraint[i]] = -1;
  w.num_columns = 0;
  w.ahead = 0;
}

template <int NC>
bool factor(Workspace<NC>& w) noexcept {
  forget_columns(w);
  Cost costs[2];  // in turns
  const Cost* next = &w.terminal;
  bool positive = true;
  for (int k = w.num_stages - 1; k >= 0 && positive; --k) {
    Stage<NC>& s = w.stages[k];
    make_rows(s);
    Cost& cost = costs[k % 2];
    with_slots(s, [&]<int M>() noexcept {
      positive = factor_stage<M>(s, k > 0 ? &w.stages[k - 1] : nullptr, *next, w.gains[k], cost);
    });
    next = &cost;
  }
  return positive;
}

// ---- Sweep --------------------------------------------------------------------------------------------------------

/// Forces of one stage to and from a vector of forces.
template <int M>
inline void scatter(const Vec* f, double* forces, int padded_rows, int row) noexcept {
  for (int pair = 0; 2 * pair < M; ++pair) {
    Lanes t;
    store(t, f[pair]);
    for (int i = 0; i < 2 && 2 * pair + i < M; ++i) {
      for (int d = 0; d < 3; ++d) forces[d * padded_rows + row + 2 * pair + i] = t.v[4 * i + d];
    }
  }
}
template <int M>
inline void gather(const double* forces, int padded_rows, int row, Vec* f) noexcept {
  for (int pair = 0; 2 * pair < M; ++pair) {
    Lanes t = {};
    for (int i = 0; i < 2 && 2 * pair + i < M; ++i) {
      for (int d = 0; d < 3; ++d) t.v[4 * i + d] = forces[d * padded_rows + row + 2 * pair + i];
    }
    f[pair] = load(t);
  }
}

/// The minimiser of the cost plus pull' f, as a step from the path of `nominal`; f_ref, and no pull, where they are
/// null. Exact from any nominal; the nearer it is, the less is rounded.
template <int NC>
void sweep(Workspace<NC>& w, const double* nominal, const double* pull, double* forces) noexcept {
  constexpr int kPairs = Stage<NC>::kPairs;
  const int N = w.num_stages;
  Vec pose = load(w.x0_pose);
  Vec rate = load(w.x0_rate);
  for (int k = 0; k < N; ++k) {
    const Stage<NC>& s = w.stages[k];
    Vec push = load(s.g_rate);
    with_slots(s, [&]<int M>() noexcept {
      Vec f[kPairs];
      if (nominal == nullptr) {
        for (int pair = 0; 2 * pair < M; ++pair) f[pair] = load(s.f_ref[pair]);
      } else {
        gather<M>(nominal, w.padded_rows, s.first_row, f);
      }
      push = add_B_times<M>(s, push, f);
    });
    const Vec pose_next = (pose + load(s.g_pose)) + D_times(s, rate);
    rate = add_C_times(s, rate + push, pose);
    pose = pose_next;
    store(w.z_pose[k], pose - load(s.x_ref_pose));
    store(w.z_rate[k], rate - load(s.x_ref_rate));
  }

  // The costate p of x_(k+1), Q z included
  Vec p_pose = zeros();
  Vec p_rate = zeros();
  const Lanes& z_pose = w.z_pose[N - 1];
  const Lanes& z_rate = w.z_rate[N - 1];
  if (w.has_terminal_cost) {
    for (int j = 0; j < 6; ++j) {
      p_pose = add_product(p_pose, load(w.terminal.pose_pose[j]), entry(z_pose, j));
      p_rate = add_product(p_rate, load(w.terminal.rate_pose[j]), entry(z_pose, j));
      p_pose = add_product(p_pose, load(w.terminal.pose_rate[j]), entry(z_rate, j));
      p_rate = add_product(p_rate, load(w.terminal.rate_rate[j]), entry(z_rate, j));
    }
  } else {
    p_pose = load(w.stages[N - 1].Q_pose) * load(z_pose);
    p_rate = load(w.stages[N - 1].Q_rate) * load(z_rate);
  }
  for (int k = N - 1; k >= 0; --k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = w.gains[k];
    with_slots(s, [&]<int M>() noexcept {
      constexpr int kUsed = (M + 1) / 2;
      Vec su[kUsed];
      for (int pair = 0; pair < kUsed; ++pair) su[pair] = Bt_times<M>(s, pair, p_rate);
      if (nominal != nullptr) {
        Vec f[kUsed], pulled[kUsed];
        gather<M>(nominal, w.padded_rows, s.first_row, f);
        gather<M>(pull, w.padded_rows, s.first_row, pulled);
        for (int pair = 0; pair < kUsed; ++pair) {
          Lanes R = {};
          for (int i = 0; i < 6 && 6 * pair + i < 3 * M; ++i) R.v[lane_of(i)] = s.R[6 * pair + i];
          su[pair] = su[pair] + add_product(pulled[pair], load(R), f[pair] - load(s.f_ref[pair]));
        }
      }
      for (int pair = 0; pair < kUsed; ++pair) {
        Vec f = zeros();
        for (int of = 0; of < kUsed; ++of) f = add_columns<M>(f, gain.Quu_inverse[pair] + 6 * of, su[of]);
        store(w.feedforward[k * kPairs + pair], f);
      }
      if (k == 0) return;
      Vec pull_pose = zeros();
      Vec pull_rate = zeros();
      for (int pair = 0; pair < kUsed; ++pair) {
        pull_pose = add_columns<M>(pull_pose, gain.K_pose + 6 * pair, su[pair]);
        pull_rate = add_columns<M>(pull_rate, gain.K_rate + 6 * pair, su[pair]);
      }
      const Stage<NC>& before = w.stages[k - 1];
      const Vec h_pose = add_product(add_Ct_times(s, p_pose, p_rate), load(before.Q_pose), load(w.z_pose[k - 1]));
      const Vec h_rate = add_product(Dt_times(s, p_pose) + p_rate, load(before.Q_rate), load(w.z_rate[k - 1]));
      p_pose = h_pose - pull_pose;
      p_rate = h_rate - pull_rate;
    });
  }

  pose = zeros();  // of the deviation from the nominal path
  rate = zeros();
  for (int k = 0; k < N; ++k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = w.gains[k];
    with_slots(s, [&]<int M>() noexcept {
      constexpr int kUsed = (M + 1) / 2;
      Vec step[kUsed], f[kUsed];
      for (int pair = 0; pair < kUsed; ++pair) {
        step[pair] = zeros() - load(w.feedforward[k * kPairs + pair]) - K_times<M>(gain, pair, pose, rate);
      }
      if (nominal == nullptr) {
        for (int pair = 0; pair < kUsed; ++pair) f[pair] = load(s.f_ref[pair]);
      } else {
        gather<M>(nominal, w.padded_rows, s.first_row, f);
      }
      const Vec pose_next = pose + D_times(s, rate);
      rate = add_B_times<M>(s, add_C_times(s, rate, pose), step);
      pose = pose_next;
      for (int pair = 0; pair < kUsed; ++pair) f[pair] = f[pair] + step[pair];
      scatter<M>(f, forces, w.padded_rows, s.first_row);
    });
  }
}

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
    clear();
    sweep<NC>(w, nullptr, nullptr, w.free_forces);
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
    // pull = C_A' y, in the place of the violations' candidates' forces
    double* pull = w.free_forces;
    for (int i = 0; i < 3 * w.padded_rows; ++i) pull[i] = 0.0;
    for (int a = 0; a < w.active; ++a) {
      const Constraint& c = w.constraint[a];
      pull[c.side_at] += c.side * w.multiplier[a];
      pull[c.up_at] += c.up * w.multiplier[a];
    }
    sweep<NC>(w, w.forces, pull, w.forces);
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
