#pragma once
// A message of lcmtypes/ to bytes and back, for all that speak the types themselves: the simulator, the rollout, tests.
// The controller has its own structs, see codec.hpp.
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace stance::io {

/// Allocates nothing where `bytes` has held a message as large before.
template <typename LcmType>
void encode(const LcmType& message, std::vector<std::uint8_t>& bytes) {
  bytes.resize(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
}

template <typename LcmType>
std::vector<std::uint8_t> bytes_of(const LcmType& message) {
  std::vector<std::uint8_t> bytes;
  encode(message, bytes);
  return bytes;
}

/// Throws std::invalid_argument where the bytes are not one whole message of the type.
template <typename LcmType>
LcmType decoded(std::span<const std::uint8_t> bytes) {
  LcmType message{};
  const auto size = static_cast<int>(bytes.size());
  if (message.decode(bytes.data(), 0, size) != size) {
    throw std::invalid_argument(std::string("these bytes are no ") + LcmType::getTypeName());
  }
  return message;
}

}  // namespace stance::io
