#pragma once
// Random numbers that are the same with every standard library: the engine is specified to the bit, its distributions
// are not.
#include <cmath>
#include <cstdint>
#include <random>

#include "controller/math/so3.hpp"

namespace stance::sim {

/// In [0, 1), by `key` alone: for what is drawn by its name or place, in no order (splitmix64's finaliser).
constexpr double keyed_uniform(std::uint64_t key) {
  key += 0x9e3779b97f4a7c15ULL;
  key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9ULL;
  key = (key ^ (key >> 27)) * 0x94d049bb133111ebULL;
  return static_cast<double>((key ^ (key >> 31)) >> 11) * 0x1p-53;
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1), 53 random bits.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

  /// -1 or 1.
  double sign() { return (engine_() >> 63) != 0 ? 1.0 : -1.0; }

  /// Zero mean, unit variance: Marsaglia's polar method, which gives two at a time.
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double u = 0.0, v = 0.0, s = 0.0;
    do {
      u = 2.0 * uniform() - 1.0;
      v = 2.0 * uniform() - 1.0;
      s = u * u + v * v;
    } while (s >= 1.0 || s == 0.0);
    const double scale = std::sqrt(-2.0 * std::log(s) / s);
    spare_ = v * scale;
    has_spare_ = true;
    return u * scale;
  }

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

/// Three of Random::normal.
inline Vector3 normal3(Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

}  // namespace stance::sim
