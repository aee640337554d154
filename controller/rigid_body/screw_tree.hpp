#pragma once
// A tree of rigid bodies by screws: what the kinematics (chain.hpp) and the dynamics (newton_euler.hpp) of this folder
// run on. An open chain is the tree in which joint i's parent is body i.
//
// Body 0 is the base and body i + 1 hangs on joint i. Link frames stand at the bodies' centres of mass, so that a
// spatial inertia is G_i = diag(I_i, m_i 1). A joint moves its link against its parent p by
//   T_(i,p) = exp(-[A_i] theta_i) M_(i,p)                                               (8.50)
// and turns, slides or does both by its screw A_i, of any norm. Reference: Lynch and Park, Modern Robotics (2017),
// sections 4.1, 8.3.
#include <array>
#include <cmath>
#include <span>

#include "controller/math/se3.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::rigid_body {

/// G = diag(inertia, mass 1), in a frame at the centre of mass.
struct SpatialInertia {
  Matrix3 inertia = Matrix3::Zero();  ///< kg m^2
  double mass = 0.0;                  ///< kg

  Vector6 operator*(const Vector6& V) const noexcept {
    Vector6 out;
    out << inertia * V.head<3>(), mass * V.tail<3>();
    return out;
  }
};

/// T_(i,p) of a joint as a sum, all of whose terms but theta's functions are known beforehand:
///   T = T_0 + sin(w theta) T_s + (1 - cos(w theta)) T_c + theta (0, p_t),   w = |omega| of the screw A = (omega, v)
/// With k = omega / w: T_0 = M;  T_s = (-[k] R_M, -[k] p_M + [k]^2 v / w);  T_c = ([k]^2 R_M, [k]^2 p_M + [k] v / w);
/// p_t = -(v + [k]^2 v), the slide along the axis, 0 for a joint that only turns.
class ScrewMotion {
 public:
  ScrewMotion() = default;
  ScrewMotion(const RigidTransform& M, const Vector6& A) noexcept;

  RigidTransform operator()(double theta) const noexcept {
    const double sine = std::sin(w_ * theta), versine = 1.0 - std::cos(w_ * theta);
    return {R_0_ + sine * R_s_ + versine * R_c_, p_0_ + sine * p_s_ + versine * p_c_ + theta * p_t_};
  }

 private:
  double w_ = 0.0;
  Matrix3 R_0_ = Matrix3::Identity(), R_s_ = Matrix3::Zero(), R_c_ = Matrix3::Zero();
  Vector3 p_0_ = Vector3::Zero(), p_s_ = Vector3::Zero(), p_c_ = Vector3::Zero(), p_t_ = Vector3::Zero();
};

struct ScrewTree {
  int num_joints = 0;
  std::array<int, kMaxJoints> parent{};        ///< body index of joint i's parent, at most i
  std::array<Vector6, kMaxJoints> A;           ///< joint i's screw in its child link's frame; of any norm
  std::array<ScrewMotion, kMaxJoints> motion;  ///< T_(i,p) of joint i's child link at its angle: 8.50
  std::array<SpatialInertia, kMaxBodies> G;    ///< of the bodies, base first

  /// Adds joint `num_joints` and its link; M = M_(i,p) takes coordinates in the parent to those in the link at theta =
  /// 0.
  void add_joint(int parent_body, const RigidTransform& M, const Vector6& screw,
                 const SpatialInertia& inertia) noexcept;
};

/// The model's tree with link frames at the centres of mass, axes of the model's link frames.
ScrewTree screw_tree(const Model& model) noexcept;

/// The open chain of n links that the book's lists describe: `M[i]` = M_(i,i+1), the home pose of link i + 1's frame in
/// that of link i; `G[i]`, the inertia of link i + 1; `S[i]`, joint i's screw in the base's frame at home (angular
/// first). The base has no mass. Throws std::invalid_argument where the lists differ in length, are empty or longer
/// than kMaxJoints.
ScrewTree screw_chain(std::span<const RigidTransform> M, std::span<const SpatialInertia> G, std::span<const Vector6> S);

/// A frame fixed to a body, such as a hand's or a foot's.
struct Tip {
  int body = 0;           ///< body index
  RigidTransform T_body;  ///< the tip's pose in the tree's frame of the body
};

/// The tip at `T_link` in the model's link frame of `body`, for screw_tree(model).
Tip tip_on_link(const Model& model, int body, const RigidTransform& T_link) noexcept;

}  // namespace stance::rigid_body
