#pragma once
// Inverse kinematics of any chain, by iteration: for chains of which no closed form is known.
//
// The error of a pose is e = (log(R^T R_target), R^T (p_target - p)), (rad, m) in the tip's frame, T_(0,tip) = (R, p),
// and with the weights w of the task's prior on the pose b = diag(w) e. From each seed, within the joints' limits:
//   1. Levenberg-Marquardt on |b|^2 / 2: thetas by (A^T A + lambda 1) d = A^T b, A = -db/dtheta, where a joint at a
//   limit
//      that d would cross stays there. It ends at b = 0, or, with fewer joints than the weights ask for, where |b| has
//      a minimum: the least-squares pose.
//   2. With a prior on the joints and freedom left, Newton's method on sum p_i (posture_i - theta_i)^2 / 2 over the
//   null
//      space Z of A: d = Z H^-1 Z^T P (posture - theta), H = Z^T (P + sum_k mu_k d^2 b_k) Z with the multipliers mu of
//      b = 0, or Z^T P Z where that is not positive definite; each step is led back to b = 0 by 1.
// References: Lynch and Park, Modern Robotics (2017), section 6.2; Nocedal and Wright, Numerical Optimization (2006),
// sections 10.3 and 16.7.
#include <limits>
#include <span>

#include "controller/rigid_body/chain.hpp"

namespace stance::rigid_body {

/// rad (m for a joint that slides); entries past the chain's joints do not count.
struct JointLimits {
  JointVector lower = JointVector::Constant(-std::numeric_limits<double>::infinity());
  JointVector upper = JointVector::Constant(std::numeric_limits<double>::infinity());
};
JointLimits joint_limits(const Model& model) noexcept;

/// What is wanted of a chain's tip and of its joints.
struct PoseTask {
  RigidTransform target;  ///< T_(0,tip) wanted

  /// The prior on the pose: one over the standard deviation of each component of e (1/rad, 1/m), at least 0. A
  /// component of no weight is free; where the joints cannot satisfy all, the larger weights are kept better.
  Vector6 weight = Vector6::Ones();

  JointVector posture = JointVector::Zero();         ///< rad, the prior on the joints
  JointVector posture_weight = JointVector::Zero();  ///< at least 0; all 0: no prior
};

enum class InverseKinematicsStatus {
  kReached,  ///< |b| is below the tolerance, and the joints as near the posture as that and the iterations let them
  kNearest,  ///< |b| is least (locally) and not below the tolerance: the chain has too few joints, or is too short
  kNearestAtLimit,  ///< the same, and a joint's limit holds it back
  kNotConverged,    ///< neither within the iterations
  kInvalid,         ///< no seed, a number that is not finite, a negative weight, a lower limit above its upper one
};

struct InverseKinematicsSettings {
  double tolerance = 1e-11;  ///< of |b|
  int max_iterations = 200;  ///< of Levenberg-Marquardt, for each seed
};

struct InverseKinematics {
  InverseKinematicsStatus status = InverseKinematicsStatus::kInvalid;
  JointVector theta = JointVector::Zero();  ///< rad, within the limits
  Vector6 error = Vector6::Zero();          ///< rad, m: e at theta
  int seed = -1;                            ///< from which it came
  int iterations = 0;                       ///< of all seeds
};

/// The best of what the `seeds` (clamped to the limits) lead to: of those that reach the target the one nearest the
/// posture, or without a prior on the joints the first; else the one of least |b|.
InverseKinematics inverse_kinematics(const ScrewTree& tree, const Tip& tip, const PoseTask& task,
                                     const JointLimits& limits, std::span<const JointVector> seeds,
                                     const InverseKinematicsSettings& settings = {}) noexcept;

}  // namespace stance::rigid_body
