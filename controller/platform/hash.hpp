#pragma once
// FNV-1a, 64 bit: names bytes, protects nothing.
#include <cstdint>
#include <span>
#include <string_view>

namespace stance::platform {

inline constexpr std::uint64_t kHashSeed = 14695981039346656037ULL;

/// One step: takes a byte, or a whole word, into `hash`.
constexpr std::uint64_t hash_step(std::uint64_t hash, std::uint64_t value) noexcept {
  return (hash ^ value) * 1099511628211ULL;
}

/// Start from kHashSeed and chain.
constexpr std::uint64_t hash(std::span<const std::uint8_t> bytes, std::uint64_t seed = kHashSeed) noexcept {
  for (const std::uint8_t byte : bytes) seed = hash_step(seed, byte);
  return seed;
}
constexpr std::uint64_t hash(std::string_view text, std::uint64_t seed = kHashSeed) noexcept {
  for (const char c : text) seed = hash_step(seed, static_cast<unsigned char>(c));
  return seed;
}

}  // namespace stance::platform
