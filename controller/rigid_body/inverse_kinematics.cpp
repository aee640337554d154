#include "controller/rigid_body/inverse_kinematics.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

#include "controller/rigid_body/chain_dynamics.hpp"

namespace stance::rigid_body {
namespace {

constexpr double kFirstDamping = 1e-3;
constexpr double kLeastDamping = 1e-12;
constexpr double kMostDamping = 1e12;  ///< where no step of this descends, rounding is all that is left
constexpr double kStationary = 1e-9;   ///< of |A^T b| over |b|
constexpr double kPostureStep = 1e-9;  ///< rad: the last of the null space's steps
constexpr double kArmijo = 1e-4;       ///< share of the predicted decrease that a step must bring
constexpr double kPriorRank = 1e-9;    ///< of a pivot over the largest: below it the tip does not feel a direction
constexpr double kDifference = 1e-5;   ///< rad, of central differences
constexpr int kMaxHalvings = 20;

using Joints = std::array<bool, kMaxJoints>;
/// Over the joints, or over those of them that may move.
using FreeVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;

class Search {
 public:
  Search(const ScrewTree& tree, const Tip& tip, const PoseTask& task, const JointLimits& limits,
         const InverseKinematicsSettings& settings) noexcept
      : tree_(tree), tip_(tip), task_(task), limits_(limits), settings_(settings) {}

  InverseKinematics from(const JointVector& seed) noexcept {
    InverseKinematics out;
    iterations_ = 0;
    out.theta.setZero();
    out.theta.head(tree_.num_joints) = seed.head(tree_.num_joints);
    out.theta = within_limits(out.theta);
    out.status = reach(out.theta);
    if (out.status == InverseKinematicsStatus::kReached && wants_posture()) assume_posture(out.theta);
    out.error = error_of(tip_pose(tree_, tip_, out.theta));
    out.iterations = iterations_;
    return out;
  }

  double posture_cost(const JointVector& theta) const noexcept {
    return 0.5 * (task_.posture - theta).cwiseAbs2().head(n()).dot(task_.posture_weight.head(n()));
  }
  bool wants_posture() const noexcept { return (task_.posture_weight.head(n()).array() > 0.0).any(); }

 private:
  int n() const noexcept { return tree_.num_joints; }

  JointVector within_limits(JointVector theta) const noexcept {
    theta.head(n()) = theta.head(n()).cwiseMax(limits_.lower.head(n())).cwiseMin(limits_.upper.head(n()));
    return theta;
  }

  Vector6 error_of(const RigidTransform& T) const noexcept {
    Vector6 e;
    e << math::log_so3(T.R.transpose() * task_.target.R), T.R.transpose() * (task_.target.p - T.p);
    return e;
  }

  /// b and A at theta.
  Vector6 linearise(const JointVector& theta, JointJacobian& A) const noexcept {
    const Vector6 e = error_of(body_jacobian(tree_, tip_, theta, A));
    const Matrix3 of_rotation = math::left_jacobian_inverse_so3(e.head<3>());
    for (int i = 0; i < n(); ++i) {
      const Vector3 omega = A.col(i).head<3>(), v = A.col(i).tail<3>();
      A.col(i) << of_rotation * omega, v + omega.cross(e.tail<3>());
    }
    A.array().colwise() *= task_.weight.array();
    return task_.weight.cwiseProduct(e);
  }

  /// Would a step along `direction` leave the limits at once?
  bool is_held(int i, const JointVector& theta, double direction) const noexcept {
    return (theta(i) <= limits_.lower(i) && direction < 0.0) || (theta(i) >= limits_.upper(i) && direction > 0.0);
  }

  /// Levenberg-Marquardt from theta on.
  InverseKinematicsStatus reach(JointVector& theta) noexcept {
    double damping = kFirstDamping;
    JointJacobian A;
    Vector6 b = linearise(theta, A);
    for (; iterations_ < settings_.max_iterations; ++iterations_) {
      if (b.norm() <= settings_.tolerance) return InverseKinematicsStatus::kReached;
      const FreeVector descent = A.transpose() * b;
      bool at_limit = false;
      FreeVector slope = descent;
      for (int i = 0; i < n(); ++i) {
        if (!is_held(i, theta, descent(i))) continue;
        at_limit = true;
        slope(i) = 0.0;
        A.col(i).setZero();
      }
      const auto nearest = at_limit ? InverseKinematicsStatus::kNearestAtLimit : InverseKinematicsStatus::kNearest;
      if (slope.norm() <= kStationary * b.norm()) return nearest;
      const JointMatrix normal = A.transpose() * A;
      for (;; damping *= 10.0) {
        if (damping > kMostDamping) return nearest;
        JointMatrix damped = normal;
        damped.diagonal().array() += damping;
        JointVector next = theta;
        next.head(n()) += damped.llt().solve(slope);
        next = within_limits(next);
        JointJacobian A_next;
        const Vector6 b_next = linearise(next, A_next);
        if (!(b_next.squaredNorm() < b.squaredNorm())) continue;
        theta = next;
        b = b_next;
        A = A_next;
        damping = std::max(0.1 * damping, kLeastDamping);
        break;
      }
    }
    return InverseKinematicsStatus::kNotConverged;
  }

  /// The step towards the posture that leaves the tip where it is, to first order.
  JointVector posture_step(const JointVector& theta) const noexcept {
    JointJacobian A;
    (void)linearise(theta, A);
    Joints held{};
    JointVector step;
    // A joint that the step would push over its limit is held, and the step found anew: at most once for each.
    for (int pass = 0; pass <= n(); ++pass) {
      step = null_space_step(A, held, theta);
      bool changed = false;
      for (int i = 0; i < n(); ++i) {
        if (held[i] || !is_held(i, theta, step(i))) continue;
        held[i] = changed = true;
      }
      if (!changed) break;
    }
    return step;
  }

  JointVector null_space_step(const JointJacobian& A, const Joints& held, const JointVector& theta) const noexcept {
    JointVector step = JointVector::Zero();
    std::array<int, kMaxJoints> joint{};
    int free = 0;
    for (int i = 0; i < n(); ++i) {
      if (!held[i]) joint[free++] = i;
    }
    if (free == 0) return step;
    Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMaxJoints, 6> At(free, 6);
    FreeVector weight(free), wanted(free);
    for (int k = 0; k < free; ++k) {
      At.row(k) = A.col(joint[k]).transpose();
      weight(k) = task_.posture_weight(joint[k]);
      wanted(k) = weight(k) * (task_.posture(joint[k]) - theta(joint[k]));
    }
    Eigen::ColPivHouseholderQR<decltype(At)> qr(At);
    qr.setThreshold(kPriorRank);
    const int freedom = free - static_cast<int>(qr.rank());
    if (freedom == 0) return step;
    const JointMatrix Q = qr.householderQ() * JointMatrix::Identity(free, free);
    const JointMatrix Z = Q.rightCols(freedom);
    const Vector6 multipliers = basic_solution(qr, wanted);
    JointMatrix H = Z.transpose() * weight.asDiagonal() * Z;
    // The target's curvature bends the null space: the multipliers' share of the Lagrangian's Hessian, by differences.
    JointMatrix curvature(freedom, freedom);
    for (int c = 0; c < freedom; ++c) {
      JointVector h = JointVector::Zero();
      for (int k = 0; k < free; ++k) h(joint[k]) = kDifference * Z(k, c);
      JointJacobian after, before;
      (void)linearise(theta + h, after);
      (void)linearise(theta - h, before);
      const FreeVector pull = (after - before).transpose() * multipliers / (2.0 * kDifference);
      FreeVector of_free(free);
      for (int k = 0; k < free; ++k) of_free(k) = pull(joint[k]);
      curvature.col(c) = Z.transpose() * of_free;
    }
    const JointMatrix newton = H + 0.5 * (curvature + curvature.transpose());
    if (newton.llt().info() == Eigen::Success) {
      H = newton;
    } else {
      // Far from the nearest posture; and joints of no weight may leave H singular.
      H.diagonal().array() += kPriorRank * weight.maxCoeff();
    }
    const FreeVector found = Z * H.ldlt().solve(Z.transpose() * wanted);
    for (int k = 0; k < free; ++k) step(joint[k]) = found(k);
    return step;
  }

  /// From a theta that reaches the target to the one nearest the posture among its neighbours that do.
  void assume_posture(JointVector& theta) noexcept {
    while (iterations_ < settings_.max_iterations) {
      const JointVector step = posture_step(theta);
      if (step.cwiseAbs().maxCoeff() <= kPostureStep) return;
      const double cost = posture_cost(theta);
      const double slope = task_.posture_weight.cwiseProduct(task_.posture - theta).head(n()).dot(step.head(n()));
      double share = 1.0;
      bool taken = false;
      for (int halving = 0; halving < kMaxHalvings && !taken; ++halving, share *= 0.5) {
        JointVector next = within_limits(theta + share * step);
        taken = reach(next) == InverseKinematicsStatus::kReached && posture_cost(next) < cost - kArmijo * share * slope;
        if (taken) theta = next;
        ++iterations_;
      }
      if (!taken) return;
    }
  }

  const ScrewTree& tree_;
  const Tip& tip_;
  const PoseTask& task_;
  const JointLimits& limits_;
  const InverseKinematicsSettings& settings_;
  int iterations_ = 0;
};

bool is_valid(const ScrewTree& tree, const PoseTask& task, const JointLimits& limits,
              std::span<const JointVector> seeds) noexcept {
  const int n = tree.num_joints;
  bool valid = !seeds.empty() && task.target.R.allFinite() && task.target.p.allFinite() && task.weight.allFinite() &&
               (task.weight.array() >= 0.0).all() && task.posture.head(n).allFinite() &&
               task.posture_weight.head(n).allFinite() && (task.posture_weight.head(n).array() >= 0.0).all() &&
               (limits.lower.head(n).array() <= limits.upper.head(n).array()).all();
  for (const JointVector& seed : seeds) valid = valid && seed.head(n).allFinite();
  return valid;
}

}  // namespace

JointLimits joint_limits(const Model& model) noexcept {
  JointLimits limits;
  for (int i = 0; i < model.num_joints; ++i) {
    limits.lower(i) = model.joints[i].lower;
    limits.upper(i) = model.joints[i].upper;
  }
  return limits;
}

InverseKinematics inverse_kinematics(const ScrewTree& tree, const Tip& tip, const PoseTask& task,
                                     const JointLimits& limits, std::span<const JointVector> seeds,
                                     const InverseKinematicsSettings& settings) noexcept {
  InverseKinematics best;
  if (!is_valid(tree, task, limits, seeds)) return best;
  Search search(tree, tip, task, limits, settings);
  const auto is_reached = [](const InverseKinematics& x) { return x.status == InverseKinematicsStatus::kReached; };
  const auto is_better = [&](const InverseKinematics& a, const InverseKinematics& b) {
    if (is_reached(a) != is_reached(b)) return is_reached(a);
    if (is_reached(a)) return search.posture_cost(a.theta) < search.posture_cost(b.theta);
    return task.weight.cwiseProduct(a.error).norm() < task.weight.cwiseProduct(b.error).norm();
  };
  int iterations = 0;
  for (int s = 0; s < static_cast<int>(seeds.size()); ++s) {
    InverseKinematics found = search.from(seeds[s]);
    found.seed = s;
    iterations += found.iterations;
    if (s == 0 || is_better(found, best)) best = found;
    if (is_reached(best) && !search.wants_posture()) break;
  }
  best.iterations = iterations;
  return best;
}

}  // namespace stance::rigid_body
