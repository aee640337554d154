#pragma once
// Eight lanes as one register of AVX-512. See simd.hpp for the meaning.
#include <immintrin.h>

#define STANCE_ISA avx512
#include "controller/force_qp/structured/simd_half.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

struct Vec {
  __m512d v;
};

template <>
inline Vec load<Vec>(const double* from) noexcept {
  return {_mm512_load_pd(from)};
}
template <>
inline Vec all<Vec>(double x) noexcept {
  return {_mm512_set1_pd(x)};
}
inline void store(double* to, const Vec& a) noexcept { _mm512_store_pd(to, a.v); }
inline Vec operator+(const Vec& a, const Vec& b) noexcept { return {_mm512_add_pd(a.v, b.v)}; }
inline Vec operator-(const Vec& a, const Vec& b) noexcept { return {_mm512_sub_pd(a.v, b.v)}; }
inline Vec operator*(const Vec& a, const Vec& b) noexcept { return {_mm512_mul_pd(a.v, b.v)}; }
inline Vec add_product(const Vec& c, const Vec& a, const Vec& b) noexcept { return {_mm512_fmadd_pd(a.v, b.v, c.v)}; }
inline Vec subtract_product(const Vec& c, const Vec& a, const Vec& b) noexcept {
  return {_mm512_fnmadd_pd(a.v, b.v, c.v)};
}
inline Vec operator/(const Vec& a, const Vec& b) noexcept { return {_mm512_div_pd(a.v, b.v)}; }
inline Vec where_larger(const Vec& a, const Vec& b, const Vec& x, const Vec& y) noexcept {
  return {_mm512_mask_blend_pd(_mm512_cmp_pd_mask(a.v, b.v, _CMP_GT_OQ), y.v, x.v)};
}
inline Vec larger(const Vec& a, const Vec& b) noexcept { return {_mm512_max_pd(a.v, b.v)}; }
inline Vec magnitude(const Vec& a) noexcept { return {_mm512_abs_pd(a.v)}; }
template <int J>
inline Vec lane(const Vec& a) noexcept {
  return {_mm512_permutexvar_pd(_mm512_set1_epi64(J), a.v)};
}
template <int J>
inline Vec lane_of_halves(const Vec& a) noexcept {
  return {_mm512_permutex_pd(a.v, J * 0x55)};
}
inline Vec swap_halves(const Vec& a) noexcept { return {_mm512_shuffle_f64x2(a.v, a.v, 0x4e)}; }
inline Vec join(const Half& a, const Half& b) noexcept {
  return {_mm512_insertf64x4(_mm512_castpd256_pd512(a.v), b.v, 1)};
}
inline Vec low_halves(const Vec& a, const Vec& b) noexcept { return {_mm512_shuffle_f64x2(a.v, b.v, 0x44)}; }
inline Vec high_halves(const Vec& a, const Vec& b) noexcept { return {_mm512_shuffle_f64x2(a.v, b.v, 0xee)}; }
inline void transpose_halves(Vec (&a)[4]) noexcept {
  const __m512i first = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
  const __m512i second = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
  const __m512d ab_even = _mm512_unpacklo_pd(a[0].v, a[1].v);
  const __m512d ab_odd = _mm512_unpackhi_pd(a[0].v, a[1].v);
  const __m512d cd_even = _mm512_unpacklo_pd(a[2].v, a[3].v);
  const __m512d cd_odd = _mm512_unpackhi_pd(a[2].v, a[3].v);
  a[0].v = _mm512_permutex2var_pd(ab_even, first, cd_even);
  a[1].v = _mm512_permutex2var_pd(ab_odd, first, cd_odd);
  a[2].v = _mm512_permutex2var_pd(ab_even, second, cd_even);
  a[3].v = _mm512_permutex2var_pd(ab_odd, second, cd_odd);
}

}  // namespace stance::force_qp::structured::STANCE_ISA
