#pragma once
// What a configuration's validate() says of a field that is out of range.
#include <stdexcept>
#include <string>

namespace stance {

/// Throws std::invalid_argument "<section><field> is <value>, but must be <range>" where a field is not good.
struct Require {
  const char* section;  ///< "gait.", or "" for fields that name theirs

  template <typename Value>
  void operator()(bool good, const char* field, Value value, const char* range) const {
    if (!good) {
      throw std::invalid_argument(section + std::string(field) + " is " + std::to_string(value) + ", but must be " +
                                  range);
    }
  }
};

}  // namespace stance
