#include "controller/force_qp/structured/structured.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "controller/force_qp/structured/paths.hpp"

namespace stance::force_qp {
namespace structured {
namespace {

constexpr double kTolerance = 1e-10;  // of a violation that counts as none, relative to the typical force
constexpr int kMaxColumns = 1024;     // that are kept
constexpr int kMaxHeldColumns = 192;  // within held faces
constexpr int kMaxActive = 192;       // constraints, besides those that are held

constexpr int padded(int count) { return (count + 7) / 8 * 8; }

/// A row of doubles, aligned as Lanes.
class Numbers {
 public:
  explicit Numbers(std::size_t count) : lanes_((count + 7) / 8, Lanes{}) {}
  double* data() { return lanes_.front().v; }

 private:
  std::vector<Lanes> lanes_;
};

template <int NC>
const Path<NC>& path_of(Simd simd) {
  switch (simd) {
#ifdef STANCE_X86
    case Simd::kAvx512:
      return path_avx512<NC>();
    case Simd::kAvx2:
      return path_avx2<NC>();
#endif
    default:
      return path_portable<NC>();
  }
}

void put(Lanes& to, const Vector3& low, const Vector3& high) noexcept {
  for (int i = 0; i < 3; ++i) {
    to.v[i] = low[i];
    to.v[4 + i] = high[i];
  }
}
template <typename Twelve>
void put_state(Lanes& pose, Lanes& rate, const Twelve& x) noexcept {
  put(pose, x.template segment<3>(0), x.template segment<3>(3));
  put(rate, x.template segment<3>(6), x.template segment<3>(9));
}

template <int NC>
class Solver final : public StructuredSolver {
 public:
  Solver(Sizes sizes, double typical_force, int max_iterations, Simd simd)
      : sizes_(sizes),
        path_(path_of<NC>(simd)),
        max_rows_(static_cast<std::size_t>(padded(sizes.num_stages * NC))),
        max_columns_(std::min(kFaces * max_rows_, static_cast<std::size_t>(kMaxColumns))),
        max_held_columns_(std::min(kFaces * max_rows_, static_cast<std::size_t>(kMaxHeldColumns))),
        max_active_(std::min(kFaces * max_rows_, static_cast<std::size_t>(kMaxActive))),
        stages_(num_stages(), Stage<NC>{}),
        gains_(num_stages(), Gain<NC>{}),
        held_gains_(num_stages(), Gain<NC>{}),
        held_costs_(num_stages(), Cost{}),
        states_(2 * num_stages(), Lanes{}),
        feedforward_(num_stages() * Stage<NC>::kPairs, Lanes{}),
        lane_states_(6 * max_rows_, Lanes{}),
        lane_feedforward_(num_stages() * 3 * NC, Lanes{}),
        lane_right_(num_stages() * 3 * NC, Lanes{}),
        row_numbers_(3 * max_rows_),
        state_numbers_(30 * max_rows_),
        multipliers_(2 * kFaces * max_rows_),
        columns_(max_columns_ * 3 * max_rows_),
        held_columns_(max_held_columns_ * 6 * max_rows_),
        set_numbers_(6 * stride()),
        L_inverse_((max_active_ + 8) * stride()),
        columns_of_set_(max_active_ + 1, nullptr),
        row_stage_(max_rows_, 0),
        constraint_column_(2 * kFaces * max_rows_, -1),
        column_constraint_(max_columns_ + max_held_columns_, 0),
        candidates_(kFaces * max_rows_, 0),
        guesses_(kFaces * max_rows_, 0),
        set_constraint_(max_active_ + 1),
        held_(2 * max_rows_, 0),
        status_(kFaces * max_rows_, kIdle),
        active_in_row_(max_rows_, 0),
        contact_of_slot_(num_stages()),
        start_(num_stages(), 0.0),
        duration_(num_stages(), 0.0),
        remembered_(num_stages()),
        remembered_end_(num_stages(), 0.0) {
    Workspace<NC>& w = w_;
    w.num_stages = sizes.num_stages;
    w.tolerance = kTolerance * typical_force;
    w.max_iterations = max_iterations;
    w.stages = stages_.data();
    w.gains = gains_.data();
    w.held = held_.data();
    w.next_held = w.held + max_rows_;
    w.held_gains = held_gains_.data();
    w.held_costs = held_costs_.data();
    w.row_stage = row_stage_.data();
    w.fz_min = row_numbers_.data();
    w.fz_max = w.fz_min + max_rows_;
    w.violation = w.fz_max + max_rows_;
    w.z_pose = states_.data();
    w.z_rate = w.z_pose + num_stages();
    w.feedforward = feedforward_.data();
    w.free_columns = {static_cast<int>(max_columns_), 0, constraint_column_.data(), column_constraint_.data(),
                      columns_.data()};
    w.held_columns = {static_cast<int>(max_held_columns_), 0, w.free_columns.of + kFaces * max_rows_,
                      w.free_columns.constraint + max_columns_, held_columns_.data()};
    w.lane_states = lane_states_.data();
    w.lane_feedforward = lane_feedforward_.data();
    w.lane_right = lane_right_.data();
    w.max_active = static_cast<int>(max_active_);
    w.constraint = set_constraint_.data();
    w.multiplier = set_numbers_.data();
    w.excess = w.multiplier + stride();
    w.M.stride = static_cast<int>(stride());
    w.M.L_inverse = L_inverse_.data();
    w.M.sign = w.excess + stride();
    w.M.right = w.M.sign + stride();
    w.M.half = w.M.right + stride();
    w.M.direction = w.M.half + stride();
    w.column = columns_of_set_.data();
    w.status = status_.data();
    w.active_in_row = active_in_row_.data();
    w.start = state_numbers_.data();
    w.state = w.start + 6 * max_rows_;
    w.way = w.state + 6 * max_rows_;
    w.before = w.way + 6 * max_rows_;
    w.side = w.before + 3 * max_rows_;
    w.still = w.side + 3 * max_rows_;
    w.to_zero = w.still + 3 * max_rows_;
    w.guess_multiplier = multipliers_.data();
    w.last_multiplier = w.guess_multiplier + kFaces * max_rows_;
    w.candidates = candidates_.data();
    w.guesses = guesses_.data();
  }

  bool take_matrices(const Problem& problem) noexcept override {
    Workspace<NC>& w = w_;
    w.friction = problem.friction;
    int row = 0;
    double time = 0.0;
    for (std::size_t k = 0; k < num_stages(); ++k) {
      take_stage(problem.stages[k], k, row);
      for (int slot = 0; slot < w.stages[k].slots; ++slot) w.row_stage[row++] = static_cast<int>(k);
      start_[k] = time;
      duration_[k] = problem.stages[k].dynamics.A(3, 9);
      time += duration_[k];
    }
    w.rows = row;
    w.padded_rows = padded(row);
    for (; row < w.padded_rows; ++row) {
      w.fz_min[row] = w.fz_max[row] = 0.0;
      for (int d = 0; d < 6; ++d) w.start[d * w.padded_rows + row] = w.state[d * w.padded_rows + row] = 0.0;
    }
    const bool is_convex = take_terminal_cost(problem);
    path_.take_stages(w);
    return is_convex || path_.factor(w);
  }

  void take_vectors(const Problem& problem) noexcept override {
    put_state(w_.x0_pose, w_.x0_rate, problem.x0);
    for (std::size_t k = 0; k < num_stages(); ++k) {
      const StageData& data = problem.stages[k];
      Stage<NC>& s = stages_[k];
      put_state(s.g_pose, s.g_rate, data.dynamics.g);
      put_state(s.x_ref_pose, s.x_ref_rate, data.x_ref);
      for (int slot = 0; slot < s.slots; ++slot) {
        const int contact = contact_of_slot_[k][static_cast<std::size_t>(slot)];
        for (int d = 0; d < 3; ++d) {
          s.f_ref[slot / 2].v[slot % 2 * 4 + d] = contact < 0 ? 0.0 : data.f_ref[3 * contact + d];
        }
      }
    }
  }

  QpStatus solve() noexcept override {
    guess();
    const Outcome outcome = path_.solve(w_);
    if (outcome != Outcome::kSolved) {
      reset();
      return QpStatus::kMaxIterations;
    }
    remember();
    return QpStatus::kSolved;
  }

  void refine() noexcept override { path_.refine(w_); }
  void take_ahead() noexcept override { path_.take_ahead(w_); }
  int iterations() const noexcept override { return w_.iterations; }
  bool holds() const noexcept override { return w_.holds; }

  void forces(std::vector<ForceVector>& out) const noexcept override {
    for (std::size_t k = 0; k < num_stages(); ++k) {
      out[k].setZero();
      for (int slot = 0; slot < stages_[k].slots; ++slot) {
        const int contact = contact_of_slot_[k][static_cast<std::size_t>(slot)];
        if (contact < 0) continue;
        for (int d = 0; d < 3; ++d) {
          out[k][3 * contact + d] = w_.state[d * w_.padded_rows + stages_[k].first_row + slot];
        }
      }
    }
  }

  void reset() noexcept override {
    for (auto& stage : remembered_) std::fill_n(stage.begin(), sizes_.num_contacts, Remembered{});
    any_remembered_ = false;
  }

 private:
  std::size_t num_stages() const { return static_cast<std::size_t>(sizes_.num_stages); }
  std::size_t stride() const { return (max_active_ + 7) / 8 * 8 + 8; }

  void take_stage(const StageData& data, std::size_t k, int first_row) noexcept {
    Stage<NC>& s = stages_[k];
    auto& contacts = contact_of_slot_[k];
    contacts.fill(-1);
    int stance = 0;
    for (int contact = 0; contact < sizes_.num_contacts; ++contact) {
      if (data.fz_max[static_cast<std::size_t>(contact)] > 0.0) contacts[static_cast<std::size_t>(stance++)] = contact;
    }
    s.slots = stance <= 1 ? 1 : stance == 2 ? 2 : 4;
    s.first_row = first_row;

    const Dynamics& dynamics = data.dynamics;
    s.coupled = !dynamics.A.block<3, 3>(6, 3).isZero(0.0);
    for (int j = 0; j < 3; ++j) {
      put(s.D[j], dynamics.A.block<3, 1>(0, 6 + j), dynamics.A.block<3, 1>(3, 9 + j));
      put(s.C[j], dynamics.A.block<3, 1>(6, 3 + j), Vector3::Zero());
    }
    for (Lanes& R : s.R) R = Lanes{};
    for (int slot = 0; slot < s.slots; ++slot) {
      const int contact = contacts[static_cast<std::size_t>(slot)];
      const auto bounds = static_cast<std::size_t>(contact);
      for (int d = 0; d < 3; ++d) {
        Lanes& column = s.B[3 * slot + d];
        s.R[slot / 2].v[slot % 2 * 4 + d] = contact < 0 ? 1.0 : data.R[3 * contact + d];
        if (contact < 0) {
          column = Lanes{};
        } else {
          put(column, dynamics.B.block<3, 1>(6, 3 * contact + d), dynamics.B.block<3, 1>(9, 3 * contact + d));
        }
      }
      w_.fz_min[first_row + slot] = contact < 0 ? 0.0 : std::max(data.fz_min[bounds], 0.0);
      w_.fz_max[first_row + slot] = contact < 0 ? 0.0 : data.fz_max[bounds];
    }
    put_state(s.Q_pose, s.Q_rate, data.Q);
  }

  /// Whether the cost is convex for certain: where it is not, the factor tells.
  bool take_terminal_cost(const Problem& problem) noexcept {
    Cost& P = w_.terminal;
    if (w_.has_terminal_cost && !problem.has_terminal_cost) P = Cost{};  // off the diagonal it is zero else
    w_.has_terminal_cost = problem.has_terminal_cost;
    for (int j = 0; j < 6; ++j) {
      if (problem.has_terminal_cost) {
        put_state(P.pose_pose[j], P.rate_pose[j], problem.terminal_cost.col(j));
        put_state(P.pose_rate[j], P.rate_rate[j], problem.terminal_cost.col(6 + j));
      } else {
        P.pose_pose[j].v[j + j / 3] = problem.stages.back().Q[j];
        P.rate_rate[j].v[j + j / 3] = problem.stages.back().Q[6 + j];
      }
    }
    if (!problem.has_terminal_cost) return true;
    if (problem.terminal_cost != terminal_cost_) {
      terminal_cost_ = problem.terminal_cost;
      is_positive_ = terminal_cost_.llt().info() == Eigen::Success;
    }
    return is_positive_;
  }

  /// The set to begin with, its multipliers, and the forces: of each stage what they were at its middle in the last
  /// solution, whose stages began one stage earlier. A contact that did not stand then had none.
  void guess() noexcept {
    w_.num_guesses = 0;
    if (!any_remembered_) return;
    std::size_t then = 0;
    for (std::size_t k = 0; k < num_stages(); ++k) {
      const double middle = remembered_shift_ + start_[k] + 0.5 * duration_[k];
      while (then + 1 < num_stages() && remembered_end_[then] <= middle) ++then;
      for (int slot = 0; slot < stages_[k].slots; ++slot) {
        const int contact = contact_of_slot_[k][static_cast<std::size_t>(slot)];
        if (contact < 0) continue;
        const Remembered& of = remembered_[then][static_cast<std::size_t>(contact)];
        const int row = stages_[k].first_row + slot;
        for (int d = 0; d < 3; ++d) w_.state[d * w_.padded_rows + row] = of.force[d];
        for (int face = 0; face < kFaces; ++face) {
          if ((of.faces >> face & 1U) == 0U) continue;
          w_.guess_multiplier[w_.num_guesses] = of.multiplier[face];
          guesses_[w_.num_guesses++] = kFaces * row + face;
        }
      }
    }
  }

  void remember() noexcept {
    if (any_remembered_) reset();
    for (int row = 0; row < w_.rows && !any_remembered_; ++row) any_remembered_ = w_.active_in_row[row] > 0;
    if (!any_remembered_) return;
    for (int row = 0; row < w_.rows; ++row) {
      const auto k = static_cast<std::size_t>(w_.row_stage[row]);
      const int contact = contact_of_slot_[k][static_cast<std::size_t>(row - stages_[k].first_row)];
      if (contact < 0) continue;
      Remembered& of = remembered_[k][static_cast<std::size_t>(contact)];
      for (int d = 0; d < 3; ++d) of.force[d] = w_.state[d * w_.padded_rows + row];
      for (int face = 0; face < kFaces && w_.active_in_row[row] > 0; ++face) {
        const int i = kFaces * row + face;
        if (w_.status[i] != kActive) continue;
        of.faces |= 1U << face;
        of.multiplier[face] = w_.last_multiplier[i];
      }
    }
    remembered_shift_ = duration_.front();
    for (std::size_t k = 0; k < num_stages(); ++k) remembered_end_[k] = start_[k] + duration_[k];
  }

  Sizes sizes_;
  const Path<NC>& path_;
  std::size_t max_rows_;
  std::size_t max_columns_;
  std::size_t max_held_columns_;
  std::size_t max_active_;
  std::vector<Stage<NC>> stages_;
  std::vector<Gain<NC>> gains_, held_gains_;
  std::vector<Cost> held_costs_;
  std::vector<Lanes> states_, feedforward_, lane_states_, lane_feedforward_, lane_right_;
  Numbers row_numbers_, state_numbers_, multipliers_, columns_, held_columns_, set_numbers_, L_inverse_;
  std::vector<const double*> columns_of_set_;
  std::vector<int> row_stage_, constraint_column_, column_constraint_, candidates_, guesses_;
  std::vector<Constraint> set_constraint_;
  std::vector<std::uint8_t> held_;
  std::vector<Status> status_;
  std::vector<std::int8_t> active_in_row_;
  std::vector<std::array<int, NC>> contact_of_slot_;  ///< -1 where none fills it
  std::vector<double> start_, duration_;              ///< s, of the stages
  struct Remembered {
    unsigned faces = 0;  ///< bits: active in the last solution
    double multiplier[kFaces] = {};
    double force[3] = {};  ///< N
  };
  std::vector<std::array<Remembered, kMaxContacts>> remembered_;
  std::vector<double> remembered_end_;  ///< s, of its stages
  double remembered_shift_ = 0.0;       ///< s, from its first stage to now
  bool any_remembered_ = false;
  StateMatrix terminal_cost_ = StateMatrix::Zero();
  bool is_positive_ = true;  ///< definite, terminal_cost_ (or zero)
  Workspace<NC> w_{};
};

}  // namespace
}  // namespace structured

const std::vector<Simd>& available_simd() {
  static const std::vector<Simd> available = [] {
    std::vector<Simd> found = {Simd::kPortable};
#ifdef STANCE_X86
    __builtin_cpu_init();
    const bool fma = __builtin_cpu_supports("fma") != 0;
    if (fma && __builtin_cpu_supports("avx2")) found.push_back(Simd::kAvx2);
    if (fma && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) found.push_back(Simd::kAvx512);
#endif
    return found;
  }();
  return available;
}

const char* name(Simd simd) noexcept {
  switch (simd) {
    case Simd::kAvx512:
      return "AVX-512";
    case Simd::kAvx2:
      return "AVX2";
    default:
      return "portable";
  }
}

std::unique_ptr<StructuredSolver> make_structured_solver(Sizes sizes, double typical_force, int max_iterations,
                                                         Simd simd) {
  switch (sizes.num_contacts) {
    case 1:
      return std::make_unique<structured::Solver<1>>(sizes, typical_force, max_iterations, simd);
    case 2:
      return std::make_unique<structured::Solver<2>>(sizes, typical_force, max_iterations, simd);
    default:
      return std::make_unique<structured::Solver<4>>(sizes, typical_force, max_iterations, simd);
  }
}

}  // namespace stance::force_qp
