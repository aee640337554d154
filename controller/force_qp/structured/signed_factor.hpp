#pragma once
// The small factor of the structured engine, M = L S L' with S = diag(+-1), for the path of simd.hpp that is included
// before it. Only L^-1 is kept. Where M comes from stands in structured.hpp.
#include "controller/force_qp/structured/workspace.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

constexpr double kCancelled = 1e-8;  // of a sum of squares of either sign: too little to trust

inline double* row_of_L_inverse(const SignedFactor& M, int i) noexcept {
  return M.L_inverse + static_cast<std::int64_t>(i) * M.stride;
}
inline int blocks(const SignedFactor& M) noexcept { return (M.size + 7) / 8; }

inline void drop_all_pivots(SignedFactor& M) noexcept {
  for (int i = 0; i < M.size; ++i) {
    for (int b = 0; b <= i / 8; ++b) store(row_of_L_inverse(M, i) + 8 * b, zeros());
  }
  M.size = 0;
}

/// direction = L^-T S L^-1 right, right padded with zeros; returns right' direction.
inline double solve_factored(SignedFactor& M) noexcept {
  const int n = blocks(M);
  for (int a = M.size; a < 8 * n; ++a) M.right[a] = 0.0;
  Vec squares = zeros();
  for (int b = 0; b < n; ++b) {
    Vec partial[8];
    const Vec first = load(M.right);
    for (int i = 0; i < 8; ++i) partial[i] = load(row_of_L_inverse(M, 8 * b + i)) * first;
    for (int c = 1; c <= b; ++c) {
      const Vec r = load(M.right + 8 * c);
      for (int i = 0; i < 8; ++i) {
        partial[i] = add_product(partial[i], load(row_of_L_inverse(M, 8 * b + i) + 8 * c), r);
      }
    }
    const Vec l = sums(partial);
    const Vec signed_l = l * load(M.sign + 8 * b);
    store(M.half + 8 * b, signed_l);
    squares = add_product(squares, signed_l, l);
  }
  for (int b = 0; b < n; ++b) {
    Vec partial[4] = {zeros(), zeros(), zeros(), zeros()};
    for (int a = 8 * b; a < 8 * n; a += 4) {
      for (int i = 0; i < 4; ++i) {
        partial[i] = add_product(partial[i], all(M.half[a + i]), load(row_of_L_inverse(M, a + i) + 8 * b));
      }
    }
    store(M.direction + 8 * b, (partial[0] + partial[1]) + (partial[2] + partial[3]));
  }
  return sum(squares);
}

/// Appends a row whose pivot is sign |left|, with direction as `solve_factored` of the new column's entries left it.
inline void append_pivot(SignedFactor& M, double sign, double left) noexcept {
  const int k = M.size;
  double* row = row_of_L_inverse(M, k);
  const double scale = 1.0 / __builtin_sqrt(left);
  for (int a = 0; a < k; ++a) row[a] = -M.direction[a] * scale;
  row[k] = scale;
  for (int a = k + 1; a < 8 * (k / 8 + 1); ++a) row[a] = 0.0;
  M.sign[k] = sign;
  ++M.size;
}

/// Drops row and column j: rotations of neighbouring rows gather column j of L^-1 in the last row, which goes with it.
/// False where rounding has spoilt L^-1.
inline bool drop_pivot(SignedFactor& M, int j) noexcept {
  const int k = M.size;
  const double sign = M.sign[j];
  bool trusted = true;
  // half: column j from row j on; right: the norms of its first entries
  double size = 0.0;
  double squares = 0.0;
  for (int i = j; i < k; ++i) {
    const double x = row_of_L_inverse(M, i)[j];
    size += x * x;
    squares += sign * M.sign[i] * (x * x);
    trusted = trusted && squares > kCancelled * size;
    M.half[i] = x;
    M.right[i] = __builtin_sqrt(squares);
  }
  const double begin = M.half[j];
  for (int i = j; i + 1 < k; ++i) {
    const double r = 1.0 / M.right[i + 1];
    M.direction[i] = M.half[i + 1] * r;             // cosine
    M.half[i] = (i == j ? begin : M.right[i]) * r;  // sine
  }
  for (int i = j; i + 1 < k; ++i) {
    double* a = row_of_L_inverse(M, i);
    double* b = row_of_L_inverse(M, i + 1);
    const Vec cosine = all(M.direction[i]);
    const Vec sine = all(M.half[i]);
    const Vec turned = all(sign * M.sign[i + 1] * M.direction[i]);
    const int n = (i + 1) / 8 + 1;
    if (n > i / 8 + 1) store(a + 8 * (n - 1), zeros());
    for (int q = 0; q < n; ++q) {
      const Vec x = load(a + 8 * q);
      const Vec y = load(b + 8 * q);
      store(a + 8 * q, cosine * x - sine * y);
      store(b + 8 * q, sine * x + turned * y);
    }
    for (int q = j; q <= i; ++q) a[q] = a[q + 1];  // column j is gone
    a[i + 1] = 0.0;
  }
  for (int q = 0; q <= (k - 1) / 8; ++q) store(row_of_L_inverse(M, k - 1) + 8 * q, zeros());
  for (int i = j; i + 1 < k; ++i) M.sign[i] = M.sign[i + 1];
  --M.size;
  return trusted;
}

}  // namespace stance::force_qp::structured::STANCE_ISA
