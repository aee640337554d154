#pragma once
// Factor and sweeps of the structured engine, for the path of simd.hpp that is included before it. The mathematics
// stands in structured.hpp; names are its.
#include "controller/force_qp/structured/workspace.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

template <typename V = Vec>
inline V load(const Lanes& from) noexcept {
  return load<V>(from.v);
}
template <typename V>
inline void store(Lanes& to, const V& a) noexcept {
  store(to.v, a);
}

/// What a contact's held faces fix: which side of x and of y, which bound of z, 0 where none.
struct Held {
  int x, y, z;
  bool apex;  ///< fz = 0 leaves no room for fx and fy
  Held(unsigned faces, double fz_min) noexcept
      : x(static_cast<int>(faces & 1U) - static_cast<int>(faces >> 1 & 1U)),
        y(static_cast<int>(faces >> 2 & 1U) - static_cast<int>(faces >> 3 & 1U)),
        z(static_cast<int>(faces >> 4 & 1U) - static_cast<int>(faces >> 5 & 1U)),
        apex(z < 0 && fz_min <= 0.0) {}
};

/// Lane of component i, 0 <= i < 6, of two 3-vectors.
constexpr int lane_of(int i) noexcept { return i + i / 3; }
template <typename V = Vec>
inline V entry(const Lanes& a, int i) noexcept {
  return all<V>(a.v[lane_of(i)]);
}

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

/// The forces that held faces leave free, f = t + T w; of each contact T = [kx 0 ex; 0 ky ey; 0 0 kz]: k is 0 where a
/// face holds the component, e the slope of a side face that is held.
template <int M>
struct Free {
  static constexpr int U = 3 * M;
  double keep[U], slope[U];
  bool any = false;

  Free(const std::uint8_t* held, const double* fz_min, double friction) noexcept {
    for (int slot = 0; slot < M; ++slot) {
      const Held h(held[slot], fz_min[slot]);
      double* k = keep + 3 * slot;
      double* e = slope + 3 * slot;
      k[0] = static_cast<int>(h.x == 0) & static_cast<int>(!h.apex);
      k[1] = static_cast<int>(h.y == 0) & static_cast<int>(!h.apex);
      k[2] = static_cast<int>(h.z == 0);
      any = any || k[0] + k[1] + k[2] > 0.0;
      e[0] = k[2] * h.x * friction;
      e[1] = k[2] * h.y * friction;
      e[2] = 0.0;
    }
  }

  /// H <- T'HT, with a weight of one for components that are gone.
  void reduce(double (&H)[U][U]) const noexcept {
    for (int i = 0; i < U; ++i) {
      for (int c = 0; c < U; c += 3) {
        H[i][c + 2] = keep[c + 2] * H[i][c + 2] + (slope[c] * H[i][c] + slope[c + 1] * H[i][c + 1]);
        H[i][c] *= keep[c];
        H[i][c + 1] *= keep[c + 1];
      }
    }
    for (int j = 0; j < U; ++j) {
      for (int c = 0; c < U; c += 3) {
        H[c + 2][j] = keep[c + 2] * H[c + 2][j] + (slope[c] * H[c][j] + slope[c + 1] * H[c + 1][j]);
        H[c][j] *= keep[c];
        H[c + 1][j] *= keep[c + 1];
      }
    }
    for (int i = 0; i < U; ++i) H[i][i] += 1.0 - keep[i];
  }

  /// X <- T X T'
  void extend(double (&X)[U][U]) const noexcept {
    for (int j = 0; j < U; ++j) {
      for (int c = 0; c < U; c += 3) {
        X[c][j] = keep[c] * X[c][j] + slope[c] * X[c + 2][j];
        X[c + 1][j] = keep[c + 1] * X[c + 1][j] + slope[c + 1] * X[c + 2][j];
        X[c + 2][j] *= keep[c + 2];
      }
    }
    for (int i = 0; i < U; ++i) {
      for (int c = 0; c < U; c += 3) {
        X[i][c] = keep[c] * X[i][c] + slope[c] * X[i][c + 2];
        X[i][c + 1] = keep[c + 1] * X[i][c + 1] + slope[c + 1] * X[i][c + 2];
        X[i][c + 2] *= keep[c + 2];
      }
    }
  }
};

/// One backward step: `next` is the cost-to-go of x_(k+1); `cost` becomes that of x_k, with Q of x_k added, where
/// `before`, stage k - 1, is given. With T (T'Quu T)^-1 T' in the place of Quu^-1 where there are faces held.
template <int M, bool kHeld, int NC>
inline bool factor_stage(const Workspace<NC>& w, const Stage<NC>& s, const Stage<NC>* before, const Cost& next,
                         Gain<NC>& gain, Cost& cost) noexcept {
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
    Quu[c][c] += s.R[c / 6].v[lane_of(c % 6)];
  }
  const auto as_columns = [](const double(&H)[U][U], Lanes(&columns)[Gain<NC>::kPairs][3 * NC]) noexcept {
    for (int pair = 0; pair < kPairs; ++pair) {
      for (int c = 0; c < U; ++c) {
        for (int i = 0; i < 6; ++i) columns[pair][c].v[lane_of(i)] = 6 * pair + i < U ? H[c][6 * pair + i] : 0.0;
      }
    }
  };
  bool moves = true;
  if constexpr (kHeld) {
    as_columns(Quu, gain.Quu);
    const Free<M> free(w.held + s.first_row, w.fz_min + s.first_row, w.friction);
    moves = free.any;
    if (moves) {
      free.reduce(Quu);
      if (!invert<U>(Quu, X)) return false;
      free.extend(X);
    }
  } else {
    if (!invert<U>(Quu, X)) return false;
  }
  if (!moves) {
    for (double(&row)[U] : X) {
      for (double& x : row) x = 0.0;
    }
  }
  as_columns(X, gain.Quu_inverse);
  gain.moves = moves;

  // Qux = B'P A and K
  Lanes Qux_pose[U], Qux_rate[U];
  for (int c = 0; c < U; ++c) {
    store(Qux_pose[c], add_Ct_times(s, PB_pose[c], PB_rate[c]));
    store(Qux_rate[c], Dt_times(s, PB_pose[c]) + PB_rate[c]);
    if constexpr (kHeld) {
      gain.Qux_pose[c] = Qux_pose[c];
      gain.Qux_rate[c] = Qux_rate[c];
    }
  }
  Vec K_pose[U], K_rate[U];
  if (moves) {
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
  } else {
    for (int c = 0; c < U; ++c) gain.K_pose[c] = gain.K_rate[c] = Lanes{};
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
    for (int c = 0; c < U && moves; ++c) {
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

/// False where Quu is not positive definite.
template <int NC>
bool factor(Workspace<NC>& w) noexcept {
  Cost costs[2];  // in turns
  const Cost* next = &w.terminal;
  bool positive = true;
  for (int k = w.num_stages - 1; k >= 0 && positive; --k) {
    Stage<NC>& s = w.stages[k];
    if (!w.rows_stand) make_rows(s);
    Cost& cost = costs[k % 2];
    with_slots(s, [&]<int M>() noexcept {
      positive = factor_stage<M, false>(w, s, k > 0 ? &w.stages[k - 1] : nullptr, *next, w.gains[k], cost);
    });
    next = &cost;
  }
  w.rows_stand = w.rows_stand || positive;
  w.factor_stands = positive;
  return positive;
}

/// The same within the faces that are held, from stage `last` back: those after it are as they were.
template <int NC>
bool factor_held(Workspace<NC>& w, int last) noexcept {
  bool positive = true;
  for (int k = last; k >= 0 && positive; --k) {
    Stage<NC>& s = w.stages[k];
    if (!w.rows_stand) make_rows(s);
    const Cost& next = k + 1 < w.num_stages ? w.held_costs[k + 1] : w.terminal;
    const std::uint8_t* held = w.held + s.first_row;
    with_slots(s, [&]<int M>() noexcept {
      bool any = false;
      for (int slot = 0; slot < M; ++slot) any = any || held[slot] != 0;
      const Stage<NC>* before = k > 0 ? &w.stages[k - 1] : nullptr;
      positive = any ? factor_stage<M, true>(w, s, before, next, w.held_gains[k], w.held_costs[k])
                     : factor_stage<M, false>(w, s, before, next, w.held_gains[k], w.held_costs[k]);
    });
  }
  w.rows_stand = w.rows_stand || positive;
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

/// z along the path of `forces`; of f_ref, where they are null.
template <int NC>
void roll(Workspace<NC>& w, const double* forces) noexcept {
  Vec pose = load(w.x0_pose);
  Vec rate = load(w.x0_rate);
  for (int k = 0; k < w.num_stages; ++k) {
    const Stage<NC>& s = w.stages[k];
    Vec push = load(s.g_rate);
    with_slots(s, [&]<int M>() noexcept {
      Vec f[Stage<NC>::kPairs];
      if (forces == nullptr) {
        for (int pair = 0; 2 * pair < M; ++pair) f[pair] = load(s.f_ref[pair]);
      } else {
        gather<M>(forces, w.padded_rows, s.first_row, f);
      }
      push = add_B_times<M>(s, push, f);
    });
    const Vec pose_next = (pose + load(s.g_pose)) + D_times(s, rate);
    rate = add_C_times(s, rate + push, pose);
    pose = pose_next;
    store(w.z_pose[k], pose - load(s.x_ref_pose));
    store(w.z_rate[k], rate - load(s.x_ref_rate));
  }
}

/// P_N z_N
template <int NC>
void terminal_costate(const Workspace<NC>& w, Vec& pose, Vec& rate) noexcept {
  const int last = w.num_stages - 1;
  const Lanes& z_pose = w.z_pose[last];
  const Lanes& z_rate = w.z_rate[last];
  if (!w.has_terminal_cost) {
    pose = load(w.stages[last].Q_pose) * load(z_pose);
    rate = load(w.stages[last].Q_rate) * load(z_rate);
    return;
  }
  pose = zeros();
  rate = zeros();
  for (int j = 0; j < 6; ++j) {
    pose = add_product(pose, load(w.terminal.pose_pose[j]), entry(z_pose, j));
    rate = add_product(rate, load(w.terminal.rate_pose[j]), entry(z_pose, j));
    pose = add_product(pose, load(w.terminal.pose_rate[j]), entry(z_rate, j));
    rate = add_product(rate, load(w.terminal.rate_rate[j]), entry(z_rate, j));
  }
}

/// A'p + Q z of the stage before: the costate a stage earlier, of a path that nothing corrects.
template <int NC>
inline void costate_before(const Workspace<NC>& w, int k, Vec& pose, Vec& rate) noexcept {
  const Stage<NC>& s = w.stages[k];
  const Stage<NC>& before = w.stages[k - 1];
  const Vec h_pose = add_product(add_Ct_times(s, pose, rate), load(before.Q_pose), load(w.z_pose[k - 1]));
  rate = add_product(Dt_times(s, pose) + rate, load(before.Q_rate), load(w.z_rate[k - 1]));
  pose = h_pose;
}

/// The gradient of half the cost at `forces`, R (f - fref) + B'p with p the costate of their path, where z is along it.
template <int NC>
void gradient_at(const Workspace<NC>& w, const double* forces, double* gradient) noexcept {
  Vec p_pose, p_rate;
  terminal_costate(w, p_pose, p_rate);
  for (int k = w.num_stages - 1; k >= 0; --k) {
    const Stage<NC>& s = w.stages[k];
    with_slots(s, [&]<int M>() noexcept {
      constexpr int kUsed = (M + 1) / 2;
      Vec f[kUsed];
      gather<M>(forces, w.padded_rows, s.first_row, f);
      for (int pair = 0; pair < kUsed; ++pair) {
        f[pair] = add_product(Bt_times<M>(s, pair, p_rate), load(s.R[pair]), f[pair] - load(s.f_ref[pair]));
      }
      scatter<M>(f, gradient, w.padded_rows, s.first_row);
    });
    if (k > 0) costate_before(w, k, p_pose, p_rate);
  }
}

/// The minimiser of the cost plus pull' f, as a step from the path of `nominal`; f_ref, and no pull, where they are
/// null. Exact from any nominal; the nearer it is, the less is rounded. With the gains of faces that are held the step
/// stays within them: `nominal` must lie in each. From a nominal path z is left along the path of the result.
template <bool kWithin, int NC>
void sweep(Workspace<NC>& w, const double* nominal, const double* pull, double* forces) noexcept {
  constexpr int kPairs = Stage<NC>::kPairs;
  const Gain<NC>* gains = kWithin ? w.held_gains : w.gains;
  const int N = w.num_stages;
  roll(w, nominal);
  Vec p_pose, p_rate;  // the costate p of x_(k+1), Q z included
  terminal_costate(w, p_pose, p_rate);
  for (int k = N - 1; k >= 0; --k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = gains[k];
    const bool moves = !kWithin || gain.moves;
    with_slots(s, [&]<int M>() noexcept {
      constexpr int kUsed = (M + 1) / 2;
      Vec su[kUsed];
      for (int pair = 0; pair < kUsed; ++pair) su[pair] = Bt_times<M>(s, pair, p_rate);
      if (nominal != nullptr) {
        Vec f[kUsed], pulled[kUsed];
        gather<M>(nominal, w.padded_rows, s.first_row, f);
        if (pull != nullptr) {
          gather<M>(pull, w.padded_rows, s.first_row, pulled);
        } else {
          for (Vec& of_pair : pulled) of_pair = zeros();
        }
        for (int pair = 0; pair < kUsed; ++pair) {
          su[pair] = su[pair] + add_product(pulled[pair], load(s.R[pair]), f[pair] - load(s.f_ref[pair]));
        }
      }
      for (int pair = 0; pair < kUsed && moves; ++pair) {
        Vec f = zeros();
        for (int of = 0; of < kUsed; ++of) f = add_columns<M>(f, gain.Quu_inverse[pair] + 6 * of, su[of]);
        store(w.feedforward[k * kPairs + pair], f);
      }
      if (k == 0) return;
      Vec pull_pose = zeros();
      Vec pull_rate = zeros();
      for (int pair = 0; pair < kUsed && moves; ++pair) {
        pull_pose = add_columns<M>(pull_pose, gain.K_pose + 6 * pair, su[pair]);
        pull_rate = add_columns<M>(pull_rate, gain.K_rate + 6 * pair, su[pair]);
      }
      costate_before(w, k, p_pose, p_rate);
      p_pose = p_pose - pull_pose;
      p_rate = p_rate - pull_rate;
    });
  }

  Vec pose = zeros();  // of the deviation from the nominal path
  Vec rate = zeros();
  for (int k = 0; k < N; ++k) {
    const Stage<NC>& s = w.stages[k];
    const Gain<NC>& gain = gains[k];
    const bool moves = !kWithin || gain.moves;
    with_slots(s, [&]<int M>() noexcept {
      constexpr int kUsed = (M + 1) / 2;
      Vec step[kUsed], f[kUsed];
      for (int pair = 0; pair < kUsed; ++pair) {
        step[pair] =
            moves ? zeros() - load(w.feedforward[k * kPairs + pair]) - K_times<M>(gain, pair, pose, rate) : zeros();
      }
      if (nominal == nullptr) {
        for (int pair = 0; pair < kUsed; ++pair) f[pair] = load(s.f_ref[pair]);
      } else {
        gather<M>(nominal, w.padded_rows, s.first_row, f);
      }
      const Vec pose_next = pose + D_times(s, rate);
      rate = add_B_times<M>(s, add_C_times(s, rate, pose), step);
      pose = pose_next;
      if (nominal != nullptr) {
        store(w.z_pose[k], load(w.z_pose[k]) + pose);
        store(w.z_rate[k], load(w.z_rate[k]) + rate);
      }
      for (int pair = 0; pair < kUsed; ++pair) f[pair] = f[pair] + step[pair];
      scatter<M>(f, forces, w.padded_rows, s.first_row);
    });
  }
}

}  // namespace stance::force_qp::structured::STANCE_ISA
