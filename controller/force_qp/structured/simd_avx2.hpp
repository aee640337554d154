#pragma once
// Eight lanes as two registers of AVX2. See simd.hpp for the meaning.
#include <immintrin.h>

#define STANCE_ISA avx2
#include "controller/force_qp/structured/simd_half.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

struct Vec {
  __m256d low, high;
};

template <>
inline Vec load<Vec>(const double* from) noexcept {
  return {_mm256_load_pd(from), _mm256_load_pd(from + 4)};
}
template <>
inline Vec all<Vec>(double x) noexcept {
  const __m256d r = _mm256_set1_pd(x);
  return {r, r};
}
inline void store(double* to, const Vec& a) noexcept {
  _mm256_store_pd(to, a.low);
  _mm256_store_pd(to + 4, a.high);
}
inline Vec operator+(const Vec& a, const Vec& b) noexcept {
  return {_mm256_add_pd(a.low, b.low), _mm256_add_pd(a.high, b.high)};
}
inline Vec operator-(const Vec& a, const Vec& b) noexcept {
  return {_mm256_sub_pd(a.low, b.low), _mm256_sub_pd(a.high, b.high)};
}
inline Vec operator*(const Vec& a, const Vec& b) noexcept {
  return {_mm256_mul_pd(a.low, b.low), _mm256_mul_pd(a.high, b.high)};
}
inline Vec add_product(const Vec& c, const Vec& a, const Vec& b) noexcept {
  return {_mm256_fmadd_pd(a.low, b.low, c.low), _mm256_fmadd_pd(a.high, b.high, c.high)};
}
inline Vec subtract_product(const Vec& c, const Vec& a, const Vec& b) noexcept {
  return {_mm256_fnmadd_pd(a.low, b.low, c.low), _mm256_fnmadd_pd(a.high, b.high, c.high)};
}
inline Vec operator/(const Vec& a, const Vec& b) noexcept {
  return {_mm256_div_pd(a.low, b.low), _mm256_div_pd(a.high, b.high)};
}
inline Vec where_larger(const Vec& a, const Vec& b, const Vec& x, const Vec& y) noexcept {
  return {_mm256_blendv_pd(y.low, x.low, _mm256_cmp_pd(a.low, b.low, _CMP_GT_OQ)),
          _mm256_blendv_pd(y.high, x.high, _mm256_cmp_pd(a.high, b.high, _CMP_GT_OQ))};
}
inline Vec larger(const Vec& a, const Vec& b) noexcept {
  return {_mm256_max_pd(a.low, b.low), _mm256_max_pd(a.high, b.high)};
}
inline Vec magnitude(const Vec& a) noexcept {
  const __m256d sign = _mm256_set1_pd(-0.0);
  return {_mm256_andnot_pd(sign, a.low), _mm256_andnot_pd(sign, a.high)};
}
template <int J>
inline Vec lane(const Vec& a) noexcept {
  const __m256d r = _mm256_permute4x64_pd(J < 4 ? a.low : a.high, (J % 4) * 0x55);
  return {r, r};
}
template <int J>
inline Vec lane_of_halves(const Vec& a) noexcept {
  return {_mm256_permute4x64_pd(a.low, J * 0x55), _mm256_permute4x64_pd(a.high, J * 0x55)};
}
inline Vec swap_halves(const Vec& a) noexcept { return {a.high, a.low}; }
inline Vec join(const Half& a, const Half& b) noexcept { return {a.v, b.v}; }
inline Vec low_halves(const Vec& a, const Vec& b) noexcept { return {a.low, b.low}; }
inline Vec high_halves(const Vec& a, const Vec& b) noexcept { return {a.high, b.high}; }
inline void transpose_4x4(__m256d& a, __m256d& b, __m256d& c, __m256d& d) noexcept {
  const __m256d ab_even = _mm256_unpacklo_pd(a, b);
  const __m256d ab_odd = _mm256_unpackhi_pd(a, b);
  const __m256d cd_even = _mm256_unpacklo_pd(c, d);
  const __m256d cd_odd = _mm256_unpackhi_pd(c, d);
  a = _mm256_permute2f128_pd(ab_even, cd_even, 0x20);
  b = _mm256_permute2f128_pd(ab_odd, cd_odd, 0x20);
  c = _mm256_permute2f128_pd(ab_even, cd_even, 0x31);
  d = _mm256_permute2f128_pd(ab_odd, cd_odd, 0x31);
}
inline void transpose_halves(Vec (&a)[4]) noexcept {
  transpose_4x4(a[0].low, a[1].low, a[2].low, a[3].low);
  transpose_4x4(a[0].high, a[1].high, a[2].high, a[3].high);
}

}  // namespace stance::force_qp::structured::STANCE_ISA
