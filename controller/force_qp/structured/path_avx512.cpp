#include "controller/force_qp/structured/paths.hpp"
// The path first, then what is made of it:
// clang-format off
#include "controller/force_qp/structured/simd_avx512.hpp"
#include "controller/force_qp/structured/simd.hpp"
#include "controller/force_qp/structured/kernels.hpp"
// clang-format on

namespace stance::force_qp::structured {

template <int NC>
const Path<NC>& path_avx512() noexcept {
  static constexpr Path<NC> kPath = STANCE_ISA::path<NC>();
  return kPath;
}
template const Path<1>& path_avx512<1>() noexcept;
template const Path<2>& path_avx512<2>() noexcept;
template const Path<4>& path_avx512<4>() noexcept;

}  // namespace stance::force_qp::structured
