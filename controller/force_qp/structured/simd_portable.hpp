#pragma once
// Eight lanes in plain C++: what the other paths compute, bit for bit, on any machine. See simd.hpp for the meaning.
#include <cmath>

#define STANCE_ISA portable

namespace stance::force_qp::structured::STANCE_ISA {

template <int n>
struct LanesOf {
  double v[n];
};
using Vec = LanesOf<8>;
using Half = LanesOf<4>;

template <int n = 8, typename F>
inline LanesOf<n> lanewise(F f) noexcept {
  LanesOf<n> r;
  for (int i = 0; i < n; ++i) r.v[i] = f(i);
  return r;
}

template <typename V>
inline V load(const double* from) noexcept {
  V r;
  for (double& x : r.v) x = *from++;
  return r;
}
template <typename V>
inline V all(double x) noexcept {
  V r;
  for (double& y : r.v) y = x;
  return r;
}
template <int n>
inline void store(double* to, const LanesOf<n>& a) noexcept {
  for (int i = 0; i < n; ++i) to[i] = a.v[i];
}
template <int n>
inline LanesOf<n> operator+(const LanesOf<n>& a, const LanesOf<n>& b) noexcept {
  return lanewise<n>([&](int i) { return a.v[i] + b.v[i]; });
}
template <int n>
inline LanesOf<n> operator-(const LanesOf<n>& a, const LanesOf<n>& b) noexcept {
  return lanewise<n>([&](int i) { return a.v[i] - b.v[i]; });
}
template <int n>
inline LanesOf<n> operator*(const LanesOf<n>& a, const LanesOf<n>& b) noexcept {
  return lanewise<n>([&](int i) { return a.v[i] * b.v[i]; });
}
template <int n>
inline LanesOf<n> add_product(const LanesOf<n>& c, const LanesOf<n>& a, const LanesOf<n>& b) noexcept {
  return lanewise<n>([&](int i) { return std::fma(a.v[i], b.v[i], c.v[i]); });
}
template <int n>
inline LanesOf<n> subtract_product(const LanesOf<n>& c, const LanesOf<n>& a, const LanesOf<n>& b) noexcept {
  return lanewise<n>([&](int i) { return std::fma(-a.v[i], b.v[i], c.v[i]); });
}
inline Vec operator/(const Vec& a, const Vec& b) noexcept {
  return lanewise([&](int i) { return a.v[i] / b.v[i]; });
}
inline Vec where_larger(const Vec& a, const Vec& b, const Vec& x, const Vec& y) noexcept {
  return lanewise([&](int i) { return a.v[i] > b.v[i] ? x.v[i] : y.v[i]; });
}
inline Vec larger(const Vec& a, const Vec& b) noexcept {
  return lanewise([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
inline Vec magnitude(const Vec& a) noexcept {
  return lanewise([&](int i) { return std::fabs(a.v[i]); });
}
template <int J>
inline Vec lane(const Vec& a) noexcept {
  return all<Vec>(a.v[J]);
}
template <int J>
inline Vec lane_of_halves(const Vec& a) noexcept {
  return lanewise([&](int i) { return a.v[i / 4 * 4 + J]; });
}
inline Vec swap_halves(const Vec& a) noexcept {
  return lanewise([&](int i) { return a.v[i ^ 4]; });
}
inline Vec join(const Half& a, const Half& b) noexcept {
  return lanewise([&](int i) { return i < 4 ? a.v[i] : b.v[i - 4]; });
}
inline Vec low_halves(const Vec& a, const Vec& b) noexcept {
  return lanewise([&](int i) { return i < 4 ? a.v[i] : b.v[i - 4]; });
}
inline Vec high_halves(const Vec& a, const Vec& b) noexcept {
  return lanewise([&](int i) { return i < 4 ? a.v[4 + i] : b.v[i]; });
}
inline void transpose_halves(Vec (&a)[4]) noexcept {
  Vec t[4];
  for (int i = 0; i < 4; ++i) t[i] = lanewise([&](int j) { return a[j % 4].v[j / 4 * 4 + i]; });
  for (int i = 0; i < 4; ++i) a[i] = t[i];
}

}  // namespace stance::force_qp::structured::STANCE_ISA
