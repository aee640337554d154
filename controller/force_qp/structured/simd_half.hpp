#pragma once
// Four lanes as one register of AVX2, for the paths of simd_avx2.hpp and simd_avx512.hpp. See simd.hpp for the meaning.
#include <immintrin.h>

namespace stance::force_qp::structured::STANCE_ISA {

struct Half {
  __m256d v;
};

template <typename V>
V load(const double* from) noexcept;
template <>
inline Half load<Half>(const double* from) noexcept {
  return {_mm256_load_pd(from)};
}
template <typename V>
V all(double x) noexcept;
template <>
inline Half all<Half>(double x) noexcept {
  return {_mm256_set1_pd(x)};
}
inline void store(double* to, const Half& a) noexcept { _mm256_store_pd(to, a.v); }
inline Half operator+(const Half& a, const Half& b) noexcept { return {_mm256_add_pd(a.v, b.v)}; }
inline Half operator-(const Half& a, const Half& b) noexcept { return {_mm256_sub_pd(a.v, b.v)}; }
inline Half operator*(const Half& a, const Half& b) noexcept { return {_mm256_mul_pd(a.v, b.v)}; }
inline Half add_product(const Half& c, const Half& a, const Half& b) noexcept {
  return {_mm256_fmadd_pd(a.v, b.v, c.v)};
}
inline Half subtract_product(const Half& c, const Half& a, const Half& b) noexcept {
  return {_mm256_fnmadd_pd(a.v, b.v, c.v)};
}

}  // namespace stance::force_qp::structured::STANCE_ISA
