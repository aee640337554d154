// A calibration takes no memory.
#include <catch2/catch_test_macros.hpp>
#include <cmath>
#include <vector>

#include "controller/calibration/calibration.hpp"
#include "tests/support/heap_calls.hpp"

using namespace stance;
using namespace stance::calibration;

TEST_CASE("CalibrationTakesNoMemory") {
  std::vector<Vector3> p_K, p_A;
  for (int i = 0; i < kMaxPoints; ++i) {
    p_K.emplace_back(std::sin(1.0 * i), std::cos(2.0 * i), std::sin(3.0 * i));
    p_A.push_back(p_K.back() + Vector3(0.1, 0.2, 0.3));
  }
  for (const Kind kind : {Kind::kRigid, Kind::kAffine, Kind::kLinear, Kind::kPlanar}) {
    const long before = test::heap_calls;
    const Calibration found = calibrate(kind, p_K, p_A);
    const long after = test::heap_calls;
    CHECK(after == before);
    CHECK(found.status == Status::kOk);
  }
}
