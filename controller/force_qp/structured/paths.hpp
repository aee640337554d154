#pragma once
// The paths of the structured engine, each compiled by itself for its machine.
#include "controller/force_qp/structured/workspace.hpp"

namespace stance::force_qp::structured {

template <int NC>
const Path<NC>& path_portable() noexcept;
template <int NC>
const Path<NC>& path_avx2() noexcept;
template <int NC>
const Path<NC>& path_avx512() noexcept;

}  // namespace stance::force_qp::structured
