#pragma once
// What ran, as one message: encoded once at set-up.
#include <string>
#include <vector>

#include "controller/io/codec.hpp"

namespace stance::io {

struct RunInfo {
  std::string robot;
  std::string options;        ///< the command line
  std::string urdf;           ///< whole text
  std::string configuration;  ///< whole text of the robot's YAML, as in effect
};

/// The run_info_t of stance-controller.
std::vector<std::uint8_t> encode(const RunInfo& info);

/// What an encoded run_info_t says; false, and `out` left alone, where the bytes are not a whole one.
[[nodiscard]] bool decode(Bytes bytes, RunInfo& out);

}  // namespace stance::io
