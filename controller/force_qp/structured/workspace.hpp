#pragma once
// What the structured engine works on: plain arrays, the same for every path of simd.hpp. Whoever fills them is
// compiled for any machine, the kernels for one; so there is no function in this header.
#include <cstdint>

namespace stance::force_qp::structured {

inline constexpr int kFaces = 6;  ///< constraints of a contact: +x, -x, +y, -y face, upper, lower bound of fz

/// Two 3-vectors, in lanes 0-2 and 4-6; or any eight numbers. A pose is (theta | p), a rate (omega | v), the forces of
/// two contacts (f | f).
struct alignas(64) Lanes {
  double v[8];
};

/// Stage k of a problem with at most NC contacts. Only contacts in stance take part: they fill the first slots. Slots
/// come in sets of 1, 2 or 4; one that no contact fills has B = 0, R = 1 and bounds of 0.
template <int NC>
struct Stage {
  static constexpr int kPairs = (NC + 1) / 2;
  int slots;        ///< 1, 2 or 4
  int first_row;    ///< of slot 0, in the arrays over all contacts of all stages
  bool coupled;     ///< C is not zero
  Lanes D[3];       ///< columns of D | of E: pose += D rate
  Lanes C[3];       ///< columns of C, low half: omega += C p
  Lanes B[3 * NC];  ///< columns of B: rate += B f
  Lanes R[kPairs];  ///< 1/N^2
  Lanes Q_pose, Q_rate;
  Lanes g_pose, g_rate;
  Lanes x_ref_pose, x_ref_rate;
  Lanes f_ref[kPairs];  ///< N
  // Made by the kernels from the above:
  Lanes D_rows[3];      ///< rows of D | of E
  Lanes C_rows[3];      ///< rows of C, high half: p += C' omega
  Lanes B_rows[NC][3];  ///< of each contact: rows omega_j (low half) and v_j (high half) of its columns
};

/// What one backward step leaves behind: K = Quu^-1 Qux and Quu^-1.
template <int NC>
struct Gain {
  static constexpr int kPairs = (NC + 1) / 2;
  Lanes K_pose[3 * NC], K_rate[3 * NC];  ///< rows of K
  Lanes K_columns[NC][6];  ///< of each contact's rows: columns theta_j (low half) and p_j, omega_j and v_j (high half)
  Lanes Quu_inverse[kPairs][3 * NC];  ///< columns
};

/// A symmetric 12 x 12 matrix in 6 x 6 blocks of columns: lanes are the rows, pose or rate.
struct Cost {
  Lanes pose_pose[6], pose_rate[6], rate_pose[6], rate_rate[6];
};

/// A constraint c_i f <= b_i of one contact: c_i f = side f[side_at] + up f[up_at].
struct Constraint {
  double side, up;
  double bound;
  int side_at, up_at;
  int id;  ///< kFaces row + face
};

enum class Outcome : std::int8_t { kSolved, kOutOfBudget, kSingular };

/// All memory of an engine. Arrays over contacts ("rows") have one entry for each slot of each stage, padded to a
/// multiple of eight with contacts of bounds 0; vectors of forces have x of every row, then y, then z.
template <int NC>
struct Workspace {
  // The problem
  int num_stages;
  int rows, padded_rows;
  double friction;
  double tolerance;  ///< N, violation that counts as none
  int max_iterations;
  bool has_terminal_cost;
  Lanes x0_pose, x0_rate;
  Stage<NC>* stages;  ///< num_stages
  int* row_stage;     ///< padded_rows
  double* fz_min;     ///< padded_rows, N
  double* fz_max;
  Cost terminal;  ///< P, or Q of the last stage
  // The factor
  Gain<NC>* gains;  ///< num_stages
  // The factor within faces that are held
  std::uint8_t* held;  ///< padded_rows, a bit a face
  bool ends_held;      ///< the last solution was found within held faces, not by the active set
  Gain<NC>* held_gains;
  Cost* held_costs;  ///< num_stages, the cost-to-go of x_k, Q included
  double* gradient;  ///< 3 padded_rows
  // One sweep
  Lanes* z_pose;  ///< num_stages, x_ref's distance to the nominal path
  Lanes* z_rate;
  Lanes* feedforward;  ///< num_stages x pairs
  // Columns H^-1 c_i, kept as long as the factor
  int max_columns, num_columns;
  int ahead;               ///< constraints before this one have their columns
  int* column_of;          ///< of constraint i, -1 where it has none
  int* column_constraint;  ///< the other way round
  double* columns;         ///< max_columns x 3 padded_rows
  Lanes* eight_forces;     ///< 3 padded_rows, right-hand sides in the lanes
  Lanes* eight_feedforward;
  // The active set
  int max_active, stride;  ///< of L_inverse's rows
  int active;
  Constraint* constraint;  ///< max_active
  double* multiplier;
  double* excess;  ///< c_i u0 - b_i
  const double** column;
  std::int8_t* is_active;  ///< kFaces x padded_rows
  std::int8_t* active_in_row;
  double* L_inverse;  ///< of L L' = C_A H^-1 C_A'
  double* right;      ///< stride
  double* half;
  double* direction;
  // The iterate
  double* free_forces;  ///< u0, 3 padded_rows
  double* forces;       ///< u
  double* violation;    ///< padded_rows
  int* candidates;      ///< kFaces x padded_rows
  int num_guesses;
  int* guesses;  ///< constraints to begin with
  int iterations;
};

/// The compiled path for one machine and one number of contacts.
template <int NC>
struct Path {
  /// Factors the stages; false where Quu is not positive definite. Forgets all columns.
  bool (*factor)(Workspace<NC>&) noexcept;
  /// Takes eight columns that no solve has asked for yet, as far as there is room.
  void (*take_ahead)(Workspace<NC>&) noexcept;
  Outcome (*solve)(Workspace<NC>&) noexcept;
  /// One step of refinement of forces and multipliers under the active set that `solve` ended with.
  void (*refine)(Workspace<NC>&) noexcept;
};

}  // namespace stance::force_qp::structured
