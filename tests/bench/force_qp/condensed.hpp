#pragma once
// The force QP without its states, as dense solvers take it:   min 1/2 u'H u + q'u   s.t.   C u <= 0,  lower <= u_z <=
// upper
//
// u: forces of the contacts in stance, in units of the typical force; where their number differs from tick to tick, of
// all contacts, so that sizes stay. C: four friction faces of each contact.
#include <Eigen/Core>
#include <vector>

#include "tests/bench/force_qp/sequence.hpp"

namespace stance::bench {

class Condensed {
 public:
  Condensed(const Sequence& sequence, int num_stages);

  /// H, bounds and q, or q alone.
  void update(const force_qp::Problem& problem, bool matrices_changed);
  void forces(const force_qp::Problem& problem, const double* u, std::vector<force_qp::ForceVector>& out) const;

  int num_variables() const { return static_cast<int>(3 * contacts_.size()); }
  int num_contacts() const { return static_cast<int>(contacts_.size()); }

  Eigen::MatrixXd H;  ///< both triangles
  Eigen::VectorXd q;
  Eigen::VectorXd lower, upper;  ///< of each contact's u_z

 private:
  struct Contact {
    int stage;
    int contact;
  };
  void list_contacts(const force_qp::Problem& problem);
  void hessian(const force_qp::Problem& problem);
  void gradient(const force_qp::Problem& problem);

  double typical_force_;  ///< N
  bool all_contacts_ = false;
  std::vector<Contact> contacts_;
  using Column = Eigen::Matrix<double, 12, 3>;
  std::vector<Column> response_;  ///< of x_(k+1) to a contact's forces
  std::vector<force_qp::StateVector> error_;
};

/// Rows +x, -x, +y, -y of |u_x|, |u_y| <= mu u_z.
inline Eigen::Matrix<double, 4, 3> friction_faces(double friction) {
  Eigen::Matrix<double, 4, 3> rows;
  rows << 1.0, 0.0, -friction, -1.0, 0.0, -friction, 0.0, 1.0, -friction, 0.0, -1.0, -friction;
  return rows;
}

/// C, with `rows_per_contact` rows for each contact: the friction faces first, then zeros for whoever adds bounds.
Eigen::MatrixXd friction_rows(const Condensed& condensed, double friction, int rows_per_contact);

/// The inequalities as solvers with bounds on variables take them:   C u <= 0,  lower <= u <= upper
struct Boxed {
  /// `none` stands for infinity.
  Boxed(const Condensed& condensed, double friction, double none);
  /// To be called where the condensed problem's matrices have changed.
  void take_bounds(const Condensed& condensed);

  Eigen::MatrixXd C;
  Eigen::VectorXd C_lower, C_upper;
  Eigen::VectorXd lower, upper;
};

}  // namespace stance::bench
