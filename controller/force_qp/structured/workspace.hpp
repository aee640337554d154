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
  bool moves;  ///< false where held faces leave no force free: K is zero, K_columns are not set
  Lanes K_pose[3 * NC], K_rate[3 * NC];  ///< rows of K
  Lanes K_columns[NC][6];  ///< of each contact's rows: columns theta_j (low half) and p_j, omega_j and v_j (high half)
  Lanes Quu_inverse[kPairs][3 * NC];  ///< columns
  // Where faces are held, what they leave out of the above:
  Lanes Quu[kPairs][3 * NC];                 ///< columns
  Lanes Qux_pose[3 * NC], Qux_rate[3 * NC];  ///< rows
};

/// A symmetric 12 x 12 matrix in 6 x 6 blocks of columns: lanes are the rows, pose or rate.
struct Cost {
  Lanes pose_pose[6], pose_rate[6], rate_pose[6], rate_rate[6];
};

/// A constraint c_i f <= b_i of one contact, or the multiplier of one that is held, from the gradient of that contact:
/// n' (s[at], s[at + padded_rows], s[at + 2 padded_rows]) of a state s.
struct Constraint {
  double n[3];
  double bound;
  int at;
  int id;  ///< kFaces row + face
};

/// What the solver does with a constraint.
enum Status : std::int8_t { kIdle = 0, kActive = 1, kReleased = 2 };

/// Columns of constraints, kept as long as their factor.
struct Columns {
  int max, num;
  int* of;          ///< the column of constraint i, -1 where it has none
  int* constraint;  ///< the other way round
  double* values;   ///< max x length
};

/// M = L S L' of the active set; see signed_factor.hpp. Vectors have `stride` entries.
struct SignedFactor {
  int stride;  ///< of L_inverse's rows
  int size;
  double* L_inverse;
  double* sign;   ///< S
  double* right;  ///< M direction = right
  double* half;   ///< S L^-1 right
  double* direction;
};

enum class Outcome : std::int8_t { kSolved, kOutOfBudget, kSingular };

/// All memory of an engine. Arrays over contacts ("rows") have one entry for each slot of each stage, padded to a
/// multiple of eight with contacts of bounds 0; vectors of forces have x of every row, then y, then z. A state is the
/// forces, and after them, where faces are held, the gradient.
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
  bool rows_stand;  ///< of the stages: D_rows, C_rows, B_rows
  bool factor_stands;
  Gain<NC>* gains;  ///< num_stages
  // The factor within faces that are held
  bool holds;               ///< the solution is a step from the minimiser within held faces, not from the free one
  bool held_factor_stands;  ///< that of `held`
  int held_rows;            ///< with a status of their own, for being held
  double* side;             ///< 3 padded_rows: 1, -1 or 0, the sign of the face of x, y, fz that is held
  double* still;            ///< 3 padded_rows: 1 where that face is held still, 0 where it is released
  double* to_zero;          ///< 3 padded_rows: at which step its multiplier reaches zero
  std::uint8_t* held;       ///< padded_rows, a bit a face: of opposite faces at most one
  std::uint8_t* next_held;
  Gain<NC>* held_gains;
  Cost* held_costs;  ///< num_stages, the cost-to-go of x_k, Q included
  // One sweep
  Lanes* z_pose;  ///< num_stages, x_ref's distance to the nominal path
  Lanes* z_rate;
  Lanes* feedforward;  ///< num_stages x pairs
  // Columns, of the factor and of that within held faces
  Columns free_columns, held_columns;
  int ahead;           ///< constraints before this one have their columns
  Lanes* lane_states;  ///< 6 padded_rows, right-hand sides in the lanes; of four, in the first
  Lanes* lane_feedforward;
  Lanes* lane_right;
  // The active set, or what has changed of the held one
  int max_active;
  SignedFactor M;          ///< a pivot for each constraint of the set, of sign -1 where it is released
  Constraint* constraint;  ///< max_active
  double* multiplier;      ///< or by how far a released one is off its face, N
  double* excess;          ///< c_i u0 - b_i
  const double** column;
  Status* status;  ///< kFaces x padded_rows
  std::int8_t* active_in_row;
  // The iterate: states
  double* start;  ///< of the minimiser from which the columns lead
  double* state;
  double* way;
  double* before;     ///< 3 padded_rows
  double* violation;  ///< padded_rows
  int* candidates;    ///< kFaces x padded_rows
  int num_guesses;
  int* guesses;  ///< constraints to begin with
  double* guess_multiplier;
  double* last_multiplier;  ///< of active constraints
  int iterations;
};

/// The compiled path for one machine and one number of contacts.
template <int NC>
struct Path {
  /// To be called after the stages have changed: forgets factors and columns.
  void (*take_stages)(Workspace<NC>&) noexcept;
  /// Factors the stages, which else waits until a solve asks for it; false where Quu is not positive definite.
  bool (*factor)(Workspace<NC>&) noexcept;
  /// Takes eight columns that no solve has asked for yet, as far as there is room.
  void (*take_ahead)(Workspace<NC>&) noexcept;
  Outcome (*solve)(Workspace<NC>&) noexcept;
  /// One step of refinement of forces and multipliers under the active set that `solve` ended with.
  void (*refine)(Workspace<NC>&) noexcept;
};

}  // namespace stance::force_qp::structured
