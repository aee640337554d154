#include "tests/bench/force_qp/condensed.hpp"

#include <algorithm>

namespace stance::bench {

using force_qp::Problem;
using force_qp::StageData;
using force_qp::StateVector;

namespace {

// With A = [I 0 D 0; 0 I 0 E; 0 C I 0; 0 0 0 I]: x <- A x and x <- A'x.
template <typename X>
void multiply(const StageData& stage, X& x) {
  const auto& A = stage.dynamics.A;
  const Matrix3 C = A.block<3, 3>(6, 3);
  const auto p = x.template middleRows<3>(3).eval();
  x.template topRows<3>() += A.block<3, 3>(0, 6).lazyProduct(x.template middleRows<3>(6));
  x.template middleRows<3>(3) += A.block<3, 3>(3, 9).lazyProduct(x.template bottomRows<3>());
  if (!C.isZero(0.0)) x.template middleRows<3>(6) += C.lazyProduct(p);
}
template <typename X>
void multiply_transposed(const StageData& stage, X& x) {
  const auto& A = stage.dynamics.A;
  const Matrix3 C = A.block<3, 3>(6, 3);
  const auto omega = x.template middleRows<3>(6).eval();
  x.template middleRows<3>(6) += A.block<3, 3>(0, 6).transpose().lazyProduct(x.template topRows<3>());
  x.template bottomRows<3>() += A.block<3, 3>(3, 9).transpose().lazyProduct(x.template middleRows<3>(3));
  if (!C.isZero(0.0)) x.template middleRows<3>(3) += C.transpose().lazyProduct(omega);
}

}  // namespace

Condensed::Condensed(const Sequence& sequence, int num_stages) : typical_force_(sequence.typical_force) {
  Problem problem({num_stages, sequence.ticks.front().sizes.num_contacts});
  sequence.cut(0, num_stages, problem);
  list_contacts(problem);
  const std::size_t number = contacts_.size();
  for (std::size_t tick = 0; tick < sequence.ticks.size() && !all_contacts_; ++tick) {
    sequence.cut(tick, num_stages, problem);
    list_contacts(problem);
    all_contacts_ = contacts_.size() != number;
  }
  list_contacts(problem);
  response_.resize(problem.stages.size());
  error_.resize(problem.stages.size());
  H.setZero(num_variables(), num_variables());
  q.setZero(num_variables());
}

void Condensed::list_contacts(const Problem& problem) {
  contacts_.clear();
  for (std::size_t k = 0; k < problem.stages.size(); ++k) {
    for (int c = 0; c < problem.sizes.num_contacts; ++c) {
      const bool stands = problem.stages[k].fz_max[static_cast<std::size_t>(c)] > 0.0;
      if (stands || all_contacts_) contacts_.push_back({static_cast<int>(k), c});
    }
  }
  lower.resize(num_contacts());
  upper.resize(num_contacts());
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const StageData& stage = problem.stages[static_cast<std::size_t>(contacts_[i].stage)];
    const auto c = static_cast<std::size_t>(contacts_[i].contact);
    lower[static_cast<Eigen::Index>(i)] = std::max(stage.fz_min[c], 0.0) / typical_force_;
    upper[static_cast<Eigen::Index>(i)] = stage.fz_max[c] / typical_force_;
  }
}

void Condensed::update(const Problem& problem, bool matrices_changed) {
  if (matrices_changed) {
    list_contacts(problem);
    hessian(problem);
  }
  gradient(problem);
}

void Condensed::hessian(const Problem& problem) {
  const int N = problem.sizes.num_stages;
  const double F = typical_force_;
  const auto stage = [&](int k) -> const StageData& { return problem.stages[static_cast<std::size_t>(k)]; };
  const auto block = [&](const Contact& c) { return stage(c.stage).dynamics.B.block<6, 3>(6, 3 * c.contact); };
  for (int a = 0; a < num_contacts(); ++a) {
    const Contact& at = contacts_[static_cast<std::size_t>(a)];
    // Forward: what this force does to every later state. Backward: what that costs every later force.
    Column g = Column::Zero();
    g.bottomRows<6>() = F * block(at);
    for (int k = at.stage; k < N; ++k) {
      if (k > at.stage) multiply(stage(k), g);
      response_[static_cast<std::size_t>(k)] = g;
    }
    Column costate = Column::Zero();
    int b = num_contacts() - 1;
    for (int k = N - 1; k >= at.stage; --k) {
      if (k + 1 < N) multiply_transposed(stage(k + 1), costate);
      if (k + 1 == N && problem.has_terminal_cost) {
        costate.noalias() += problem.terminal_cost.lazyProduct(response_[static_cast<std::size_t>(k)]);
      } else {
        costate.noalias() += stage(k).Q.asDiagonal() * response_[static_cast<std::size_t>(k)];
      }
      for (; b >= a && contacts_[static_cast<std::size_t>(b)].stage == k; --b) {
        Matrix3 h;
        h.noalias() =
            F * block(contacts_[static_cast<std::size_t>(b)]).transpose().lazyProduct(costate.bottomRows<6>());
        if (b == a) h.diagonal() += F * F * stage(k).R.segment<3>(3 * at.contact);
        H.block<3, 3>(3 * b, 3 * a) = h;
        if (b != a) H.block<3, 3>(3 * a, 3 * b) = h.transpose();
      }
    }
  }
}

void Condensed::gradient(const Problem& problem) {
  StateVector x = problem.x0;
  for (std::size_t k = 0; k < problem.stages.size(); ++k) {
    multiply(problem.stages[k], x);
    x += problem.stages[k].dynamics.g;
    error_[k] = x - problem.stages[k].x_ref;
  }
  StateVector costate = StateVector::Zero();
  int b = num_contacts() - 1;
  for (int k = problem.sizes.num_stages - 1; k >= 0; --k) {
    const auto at = static_cast<std::size_t>(k);
    const bool last = at + 1 == problem.stages.size();
    if (!last) multiply_transposed(problem.stages[at + 1], costate);
    if (last && problem.has_terminal_cost) {
      costate += problem.terminal_cost * error_[at];
    } else {
      costate += problem.stages[at].Q.cwiseProduct(error_[at]);
    }
    for (; b >= 0 && contacts_[static_cast<std::size_t>(b)].stage == k; --b) {
      const int c = 3 * contacts_[static_cast<std::size_t>(b)].contact;
      const StageData& stage = problem.stages[at];
      q.segment<3>(3 * b).noalias() =
          typical_force_ * stage.dynamics.B.block<6, 3>(6, c).transpose().lazyProduct(costate.tail<6>());
      q.segment<3>(3 * b) -= typical_force_ * stage.R.segment<3>(c).cwiseProduct(stage.f_ref.segment<3>(c));
    }
  }
}

void Condensed::forces(const Problem& problem, const double* u, std::vector<force_qp::ForceVector>& out) const {
  for (force_qp::ForceVector& f : out) f.setZero(3 * problem.sizes.num_contacts);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const Eigen::Map<const Vector3> force(u + 3 * i);
    out[static_cast<std::size_t>(contacts_[i].stage)].segment<3>(3 * contacts_[i].contact) = typical_force_ * force;
  }
}

Eigen::MatrixXd friction_rows(const Condensed& condensed, double friction, int rows_per_contact) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(rows_per_contact * condensed.num_contacts(), condensed.num_variables());
  for (int c = 0; c < condensed.num_contacts(); ++c) {
    rows.block<4, 3>(rows_per_contact * c, 3 * c) = friction_faces(friction);
  }
  return rows;
}

Boxed::Boxed(const Condensed& condensed, double friction, double none)
    : C(friction_rows(condensed, friction, 4)),
      C_lower(Eigen::VectorXd::Constant(C.rows(), -none)),
      C_upper(Eigen::VectorXd::Zero(C.rows())),
      lower(Eigen::VectorXd::Constant(C.cols(), -none)),
      upper(Eigen::VectorXd::Constant(C.cols(), none)) {
  take_bounds(condensed);
}

void Boxed::take_bounds(const Condensed& condensed) {
  lower(Eigen::seqN(2, condensed.num_contacts(), 3)) = condensed.lower;
  upper(Eigen::seqN(2, condensed.num_contacts(), 3)) = condensed.upper;
}

}  // namespace stance::bench
