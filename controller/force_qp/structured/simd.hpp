#pragma once
// What is made of the primitives of simd_*.hpp, the same for every path. Included after one of them, which names the
// path STANCE_ISA: everything lives in that namespace, so that no function compiled for one machine is ever linked
// into another's path. For the same reason nothing here or in the kernels uses a template of the standard library.
//
// A Vec has eight lanes in two halves of four. Lanes 0-2 hold one 3-vector and lanes 4-6 another; 3 and 7 are spare. A
// Half has four lanes, and only load, store, all, zeros, +, -, * and the two sums with a product.
//
//   lane<J>(a)              lane J of a, in all lanes
//   lane_of_halves<J>(a)    lane J of each half, in all lanes of that half
//   join(a, b)              two Halves
//   low_halves(a, b)        (a's low half | b's low half); high_halves likewise
//   transpose_halves(a)     a[i], lane j of each half <-> a[j], lane i
//   where_larger(a, b, x, y)   lanes of x where a > b, else of y
//   add_product(c, a, b)    c + a b, rounded once; subtract_product c - a b
//
// Rounding is the same on every path: products are fused where add_product says so and nowhere else
// (-ffp-contract=off), and sums have one order. So every path gives the same bits.
#ifndef STANCE_ISA
#error "include one of simd_portable.hpp, simd_avx2.hpp and simd_avx512.hpp first"
#endif

namespace stance::force_qp::structured::STANCE_ISA {

inline Vec load(const double* from) noexcept { return load<Vec>(from); }
inline Vec all(double x) noexcept { return all<Vec>(x); }
template <typename V = Vec>
inline V zeros() noexcept {
  return all<V>(0.0);
}

/// Sums of the lanes of a[0]..a[7], in one Vec; each as ((0+4)+(2+6)) + ((1+5)+(3+7)).
inline Vec sums(const Vec (&a)[8]) noexcept {
  Vec t[4];
  for (int i = 0; i < 4; ++i) t[i] = low_halves(a[i], a[4 + i]) + high_halves(a[i], a[4 + i]);
  transpose_halves(t);
  return (t[0] + t[2]) + (t[1] + t[3]);
}

inline double sum(const Vec& a) noexcept {
  alignas(64) double v[8];
  store(v, a);
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

inline double largest(const Vec& a) noexcept {
  alignas(64) double v[8];
  store(v, a);
  double r = v[0];
  for (int i = 1; i < 8; ++i) r = v[i] > r ? v[i] : r;
  return r;
}

/// a[i], lane j <-> a[j], lane i.
inline void transpose(Vec (&a)[8]) noexcept {
  Vec top[4] = {a[0], a[1], a[2], a[3]};
  Vec bottom[4] = {a[4], a[5], a[6], a[7]};
  transpose_halves(top);
  transpose_halves(bottom);
  for (int i = 0; i < 4; ++i) {
    a[i] = low_halves(top[i], bottom[i]);
    a[4 + i] = high_halves(top[i], bottom[i]);
  }
}

}  // namespace stance::force_qp::structured::STANCE_ISA
