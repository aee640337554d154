#include "controller/io/run_info.hpp"

#include <cstdio>
#include <stance_msgs/run_info_t.hpp>
#include <stdexcept>

#include "controller/io/lcm_bytes.hpp"
#include "controller/platform/hash.hpp"
#include "stance_commit.hpp"

namespace stance::io {

std::vector<std::uint8_t> encode(const RunInfo& info) {
  stance_msgs::run_info_t message{};
  message.program = "stance-controller";
  message.version = STANCE_VERSION;
  message.source = STANCE_COMMIT;
  message.build = STANCE_BUILD;
  message.robot = info.robot;
  message.options = info.options;
  message.urdf = info.urdf;
  message.configuration = info.configuration;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx",
                static_cast<unsigned long long>(platform::hash(info.configuration, platform::hash(info.urdf))));
  message.input_hash = text;
  return bytes_of(message);
}

bool decode(Bytes bytes, RunInfo& out) {
  const auto size = static_cast<int>(bytes.size());
  stance_msgs::run_info_t message;
  try {
    if (message.decode(bytes.data(), 0, size) != size) return false;
  } catch (const std::length_error&) {  // LCM's decoder believes the lengths of strings
    return false;
  }
  out = {message.robot, message.options, message.urdf, message.configuration};
  return true;
}

}  // namespace stance::io
