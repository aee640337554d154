#include "controller/force_qp/active_set.hpp"

#include <cmath>

namespace stance::force_qp {
namespace {

/// f = T w + t of one contact, and the diagonal of T'RT.
void substitution(const ContactActivity& active, double friction, double fz_min, double fz_max, const Vector3& R,
                  Matrix3& T, Vector3& t, Vector3& T_R_T) noexcept {
  const Vector3 edge(active.x * friction, active.y * friction, 1.0);  // f for fz = 1 along the active faces
  T.setZero();
  t.setZero();
  if (active.x == 0) T(0, 0) = 1.0;
  if (active.y == 0) T(1, 1) = 1.0;
  if (active.z == 0) {
    T.col(2) = edge;
  } else {
    const double bound = active.z < 0 ? fz_min : fz_max;
    t = bound * edge;
    if (bound <= 0.0) T.setZero();  // the apex: the faces leave no room for fx and fy
  }
  for (int i = 0; i < 3; ++i) {
    T_R_T(i) = T.col(i).isZero(0.0) ? 1.0 : T.col(i).cwiseAbs2().dot(R);
  }
}

std::int8_t sign(double value) noexcept { return static_cast<std::int8_t>((value > 0.0) - (value < 0.0)); }

}  // namespace

void activity_of_bounds(const Problem& problem, Activity& activity) noexcept {
  for (std::size_t k = 0; k < activity.size(); ++k) {
    activity[k].fill({});
    for (std::size_t c = 0; c < static_cast<std::size_t>(problem.sizes.num_contacts); ++c) {
      if (problem.stages[k].fz_min[c] >= problem.stages[k].fz_max[c]) activity[k][c].z = 1;
    }
  }
}

ContactActivity next_activity(const ContactActivity& now, const Vector3& f, const Vector3& d, double friction,
                              double fz_min, double fz_max, double f_tolerance, double d_tolerance) noexcept {
  if (fz_max <= 0.0) return now;  // swing
  const bool at_apex = now.z < 0 && fz_min <= 0.0;
  // At the apex every face holds; the ones that -d pushes against carry the multipliers.
  const std::int8_t side_x = at_apex ? sign(-d.x()) : now.x;
  const std::int8_t side_y = at_apex ? sign(-d.y()) : now.y;
  const double multiplier_x = -side_x * d.x();
  const double multiplier_y = -side_y * d.y();
  const double multiplier_z = now.z * (friction * (multiplier_x + multiplier_y) - d.z());

  ContactActivity next;
  if (now.z != 0) {
    const bool fixed = fz_min >= fz_max;
    next.z = fixed || multiplier_z >= -d_tolerance ? now.z : std::int8_t{0};
  } else {
    if (f.z() < fz_min - f_tolerance) next.z = -1;
    if (f.z() > fz_max + f_tolerance) next.z = 1;
  }
  const auto face = [&](std::int8_t side, double multiplier, double component) noexcept {
    if (side != 0) return multiplier >= -d_tolerance ? side : std::int8_t{0};
    return std::abs(component) > friction * f.z() + f_tolerance ? sign(component) : std::int8_t{0};
  };
  next.x = face(side_x, multiplier_x, f.x());
  next.y = face(side_y, multiplier_y, f.y());
  return next;
}

template <int NU>
ActiveSetProblem<NU>::ActiveSetProblem(Sizes sizes) : stages_(static_cast<std::size_t>(sizes.num_stages)) {}

template <int NU>
bool ActiveSetProblem<NU>::factor(const Problem& problem, const Activity& activity, int last) noexcept {
  const std::size_t N = stages_.size();
  for (std::size_t k = static_cast<std::size_t>(last) + 1; k-- > 0;) {
    const StageData& data = problem.stages[k];
    Stage& stage = stages_[k];

    // V
    if (k + 1 == N) {
      if (problem.has_terminal_cost) {
        stage.V = 0.5 * (problem.terminal_cost + problem.terminal_cost.transpose());
      } else {
        stage.V = data.Q.asDiagonal();
      }
    } else {
      const Stage& after = stages_[k + 1];
      const StateMatrix& A = problem.stages[k + 1].dynamics.A;
      StateMatrix VA = after.V;
      times_A(A, VA);
      StateMatrix S = VA.transpose();  // A'V; times A it is A'VA
      times_A(A, S);
      // K' Qux = W' W with W = L^-1 Qux = L' K
      const Eigen::Matrix<double, NU, 12> W = after.Quu.matrixU() * after.K;
      S.noalias() -= W.transpose().lazyProduct(W);
      stage.V = 0.5 * (S + S.transpose());
      stage.V.diagonal() += data.Q;
    }

    // T, t, B T and T'RT
    Input T_R_T;
    for (int c = 0; c < NU / 3; ++c) {
      const auto contact = static_cast<std::size_t>(c);
      Vector3 t;
      Vector3 weight;
      substitution(activity[k][contact], problem.friction, data.fz_min[contact], data.fz_max[contact],
                   data.R.template segment<3>(3 * c), stage.T[contact], t, weight);
      stage.t.template segment<3>(3 * c) = t;
      T_R_T.template segment<3>(3 * c) = weight;
      stage.B.template middleCols<3>(3 * c).noalias() =
          data.dynamics.B.template block<6, 3>(6, 3 * c).lazyProduct(stage.T[contact]);
    }

    // Quu and K
    Eigen::Matrix<double, NU, 12> Qux;
    Qux.noalias() = stage.B.transpose().lazyProduct(stage.V.template bottomRows<6>());
    Eigen::Matrix<double, NU, NU> Quu = T_R_T.asDiagonal();
    Quu.noalias() += Qux.template rightCols<6>().lazyProduct(stage.B);
    times_A(data.dynamics.A, Qux);
    stage.Quu.compute(Quu);
    if (stage.Quu.info() != Eigen::Success) return false;
    stage.K = stage.Quu.solve(Qux);
  }
  return true;
}

template <int NU>
void ActiveSetProblem<NU>::solve(const Problem& problem, std::vector<ForceVector>& forces) noexcept {
  const std::size_t N = stages_.size();
  const auto offset = [&](std::size_t k) noexcept {
    const StageData& data = problem.stages[k];
    StateVector d = data.dynamics.g - data.x_ref;
    d.noalias() += data.dynamics.A.lazyProduct(k == 0 ? problem.x0 : problem.stages[k - 1].x_ref);
    d.tail<6>().noalias() += data.dynamics.B.bottomRows<6>().lazyProduct(stages_[k].t);
    return d;
  };

  StateVector s = StateVector::Zero();
  for (std::size_t k = N; k-- > 0;) {
    const StageData& data = problem.stages[k];
    Stage& stage = stages_[k];
    StateVector h = s;
    h.noalias() += stage.V.lazyProduct(offset(k));
    Input su;
    su.noalias() = stage.B.transpose().lazyProduct(h.tail<6>());
    for (int c = 0; c < NU / 3; ++c) {
      const Vector3 R = data.R.template segment<3>(3 * c);
      const Vector3 from_reference = stage.t.template segment<3>(3 * c) - data.f_ref.template segment<3>(3 * c);
      su.template segment<3>(3 * c) +=
          stage.T[static_cast<std::size_t>(c)].transpose() * R.cwiseProduct(from_reference);
    }
    stage.kf = stage.Quu.solve(su);
    s.noalias() = data.dynamics.A.transpose().lazyProduct(h);
    s.noalias() -= stage.K.transpose().lazyProduct(su);
  }

  StateVector z = StateVector::Zero();
  for (std::size_t k = 0; k < N; ++k) {
    const StageData& data = problem.stages[k];
    const Stage& stage = stages_[k];
    Input w = -stage.kf;
    w.noalias() -= stage.K.lazyProduct(z);
    for (int c = 0; c < NU / 3; ++c) {
      forces[k].template segment<3>(3 * c) =
          stage.T[static_cast<std::size_t>(c)] * w.template segment<3>(3 * c) + stage.t.template segment<3>(3 * c);
    }
    const StateVector previous = z;
    z = offset(k);
    z.noalias() += data.dynamics.A.lazyProduct(previous);
    z.tail<6>().noalias() += stage.B.lazyProduct(w);
  }
}

template class ActiveSetProblem<3>;
template class ActiveSetProblem<6>;
template class ActiveSetProblem<9>;
template class ActiveSetProblem<12>;

}  // namespace stance::force_qp
