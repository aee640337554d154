#include "tests/bench/force_qp/reference.hpp"

#include <algorithm>
#include <cmath>

namespace stance::bench {

using namespace force_qp;

std::vector<ForceVector> Reference::solve(const Problem& problem, bool matrices_changed,
                                          const std::vector<ForceVector>& guess) {
  constexpr int kMaxCorrections = 200;
  constexpr Real kGuess = 1e-7L;  // N, distance of a guessed force from a constraint that is taken for active
  const auto N = static_cast<Eigen::Index>(problem.stages.size());
  struct Contact {
    Eigen::Index stage, contact;
  };
  std::vector<Contact> contacts;
  for (Eigen::Index k = 0; k < N; ++k) {
    for (Eigen::Index c = 0; c < problem.sizes.num_contacts; ++c) {
      if (problem.stages[static_cast<std::size_t>(k)].fz_max[static_cast<std::size_t>(c)] > 0.0)
        contacts.push_back({k, c});
    }
  }
  const auto n = static_cast<Eigen::Index>(3 * contacts.size());
  const auto stage_of = [&](const Contact& c) -> const StageData& {
    return problem.stages[static_cast<std::size_t>(c.stage)];
  };
  const auto weight = [&](Eigen::Index k) -> Matrix {
    if (k + 1 == N && problem.has_terminal_cost) return problem.terminal_cost.cast<Real>();
    return Matrix(problem.stages[static_cast<std::size_t>(k)].Q.cast<Real>().asDiagonal());
  };

  if (matrices_changed) {
    response_ = Matrix::Zero(12 * N, n);
    Matrix X = Matrix::Zero(12, n);
    Matrix H = Matrix::Zero(n, n);
    for (Eigen::Index k = 0; k < N; ++k) {
      const Dynamics& dynamics = problem.stages[static_cast<std::size_t>(k)].dynamics;
      X = (dynamics.A.cast<Real>() * X).eval();
      Eigen::Index known = 0;  // columns of forces up to now
      for (std::size_t i = 0; i < contacts.size(); ++i) {
        if (contacts[i].stage > k) break;
        known = static_cast<Eigen::Index>(3 * i) + 3;
        if (contacts[i].stage < k) continue;
        X.middleCols(known - 3, 3) += dynamics.B.middleCols(3 * contacts[i].contact, 3).cast<Real>();
      }
      response_.middleRows(12 * k, 12) = X;
      H.topLeftCorner(known, known).noalias() += X.leftCols(known).transpose() * (weight(k) * X.leftCols(known));
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const Contact& c = contacts[static_cast<std::size_t>(i / 3)];
      H(i, i) += static_cast<Real>(stage_of(c).R(3 * c.contact + i % 3));
    }
    hessian_.compute(H);
  }

  Vector h = Vector::Zero(n);
  Vector x = problem.x0.cast<Real>();
  for (Eigen::Index k = 0; k < N; ++k) {
    const StageData& stage = problem.stages[static_cast<std::size_t>(k)];
    x = (stage.dynamics.A.cast<Real>() * x).eval() + stage.dynamics.g.cast<Real>();
    h.noalias() += response_.middleRows(12 * k, 12).transpose() * (weight(k) * (x - stage.x_ref.cast<Real>()));
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const Contact& c = contacts[static_cast<std::size_t>(i / 3)];
    const Eigen::Index row = 3 * c.contact + i % 3;
    h(i) -= static_cast<Real>(stage_of(c).R(row)) * static_cast<Real>(stage_of(c).f_ref(row));
  }
  const Vector free = -hessian_.solve(h);

  const auto mu = static_cast<Real>(problem.friction);
  const auto along = [&](const Constraint& c, const auto& f) -> Real {
    const Real z = f(3 * c.contact + 2);
    if (c.face >= 4) return c.face == 4 ? z : -z;
    const Real side = f(3 * c.contact + c.face / 2);
    return (c.face % 2 == 0 ? side : -side) - mu * z;
  };
  const auto bound = [&](const Constraint& c) -> Real {
    const Contact& at = contacts[static_cast<std::size_t>(c.contact)];
    if (c.face < 4) return 0.0L;
    const double upper = stage_of(at).fz_max[static_cast<std::size_t>(at.contact)];
    const double lower = std::max(stage_of(at).fz_min[static_cast<std::size_t>(at.contact)], 0.0);
    return c.face == 4 ? static_cast<Real>(upper) : -static_cast<Real>(lower);
  };

  Vector f(n);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    f.segment<3>(static_cast<Eigen::Index>(3 * i)) =
        guess[static_cast<std::size_t>(contacts[i].stage)].segment<3>(3 * contacts[i].contact).cast<Real>();
  }
  std::vector<Constraint> active;
  for (Eigen::Index i = 0; 3 * i < n; ++i) {
    for (int face = 0; face < 6; ++face) {
      const Constraint c{i, face};
      if (along(c, f) - bound(c) > -kGuess) active.push_back(c);
    }
  }
  for (int correction = 0; correction < kMaxCorrections; ++correction) {
    // Rows that depend on others are left out: y of a least-norm solution would do as well.
    Matrix columns(n, static_cast<Eigen::Index>(active.size()));
    for (std::size_t a = 0; a < active.size(); ++a) {
      Vector normal = Vector::Zero(n);
      const Constraint& c = active[a];
      if (c.face >= 4) {
        normal(3 * c.contact + 2) = c.face == 4 ? 1.0L : -1.0L;
      } else {
        normal(3 * c.contact + c.face / 2) = c.face % 2 == 0 ? 1.0L : -1.0L;
        normal(3 * c.contact + 2) = -mu;
      }
      columns.col(static_cast<Eigen::Index>(a)) = hessian_.solve(normal);
    }
    Matrix small(active.size(), active.size());
    Vector excess(active.size());
    for (std::size_t a = 0; a < active.size(); ++a) {
      for (std::size_t b = 0; b < active.size(); ++b) {
        small(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) =
            along(active[a], columns.col(static_cast<Eigen::Index>(b)));
      }
      excess(static_cast<Eigen::Index>(a)) = along(active[a], free) - bound(active[a]);
    }
    const Eigen::LDLT<Matrix> factor(small);
    Vector y = factor.solve(excess);
    y += factor.solve(excess - small * y);
    f = free - columns * y;

    const Real largest = y.size() > 0 ? y.cwiseAbs().maxCoeff() : 0.0L;
    Real most_negative = -kCertified * largest;
    int drop = -1;
    for (Eigen::Index a = 0; a < y.size(); ++a) {
      if (y(a) < most_negative) {
        most_negative = y(a);
        drop = static_cast<int>(a);
      }
    }
    if (drop >= 0) {
      active.erase(active.begin() + drop);
      continue;
    }
    Real worst = kCertified;
    Constraint add{-1, 0};
    for (Eigen::Index i = 0; 3 * i < n; ++i) {
      for (int face = 0; face < 6; ++face) {
        const Real violation = along({i, face}, f) - bound({i, face});
        if (violation <= worst) continue;
        worst = violation;
        add = {i, face};
      }
    }
    if (add.contact < 0) {
      std::vector<ForceVector> forces(problem.stages.size(), ForceVector::Zero(3 * problem.sizes.num_contacts));
      for (std::size_t i = 0; i < contacts.size(); ++i) {
        forces[static_cast<std::size_t>(contacts[i].stage)].segment<3>(3 * contacts[i].contact) =
            f.segment<3>(static_cast<Eigen::Index>(3 * i)).cast<double>();
      }
      return forces;
    }
    active.push_back(add);
  }
  return {};
}

}  // namespace stance::bench
