#pragma once
// Numbers as text.
#include <array>
#include <charconv>
#include <string>

namespace stance::platform {

/// The shortest text that reads as the same number.
inline std::string to_text(double value) {
  std::array<char, 32> digits{};
  return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
}

}  // namespace stance::platform
