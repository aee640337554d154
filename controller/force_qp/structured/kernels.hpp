#pragma once
// What a path of the structured engine is made of, for that of simd.hpp that is included before it.
#include "controller/force_qp/structured/dual_active_set.hpp"

namespace stance::force_qp::structured::STANCE_ISA {

template <int NC>
void take_stages(Workspace<NC>& w) noexcept {
  forget(w.free_columns);
  forget(w.held_columns);
  w.ahead = 0;
  w.rows_stand = w.factor_stands = w.held_factor_stands = false;
}
template <int NC>
Outcome solve(Workspace<NC>& w) noexcept {
  return ActiveSet<NC>(w).solve();
}
template <int NC>
void refine(Workspace<NC>& w) noexcept {
  ActiveSet<NC>(w).refine();
}

template <int NC>
constexpr Path<NC> path() noexcept {
  return {&take_stages<NC>, &factor<NC>, &take_ahead<NC>, &solve<NC>, &refine<NC>};
}

}  // namespace stance::force_qp::structured::STANCE_ISA
