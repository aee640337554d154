#include "controller/behaviours/shifted_plan.hpp"

#include <algorithm>

namespace stance::behaviours {
namespace {

constexpr double kRounding = 1e-9;  // s

bool has_contacts(const ForcePlan& plan, int stage, const ContactFlags& present) noexcept {
  const ContactFlags& planned = plan.contact[static_cast<std::size_t>(stage)];
  return std::equal(planned.begin(), planned.begin() + plan.num_contacts, present.begin());
}

}  // namespace

bool shift_plan(ForcePlan& plan, double elapsed, const ContactFlags& present) noexcept {
  const int last = plan.num_stages - 1;
  if (last < 0) return false;
  int due = 0;
  double over = 0.0;  // s, the end of stage `due`
  for (;; ++due) {
    over += plan.stage_duration[static_cast<std::size_t>(due)];
    if (due == last || over > elapsed + kRounding) break;
  }

  int first = -1;
  for (int away = 0; away <= last && first < 0; ++away) {
    for (const int stage : {due + away, due - away}) {
      if (first < 0 && stage >= 0 && stage <= last && has_contacts(plan, stage, present)) first = stage;
    }
  }
  if (first < 0) return false;

  if (first == due && over > elapsed + kRounding) {
    plan.stage_duration[static_cast<std::size_t>(first)] = over - elapsed;
  }
  const auto drop = [&](auto& stages) {
    std::copy(stages.begin() + first, stages.begin() + plan.num_stages, stages.begin());
  };
  drop(plan.stage_duration);
  drop(plan.contact);
  drop(plan.force);
  drop(plan.p_WC);
  plan.num_stages -= first;
  return true;
}

}  // namespace stance::behaviours
