#pragma once
// The open chains of tests/golden in the book's convention.
#include <stdexcept>
#include <vector>

#include "controller/rigid_body/screw_tree.hpp"
#include "tests/support/golden.hpp"

namespace stance::test {

inline RigidTransform rigid_transform(const Eigen::Matrix4d& T) {
  return {T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>()};
}

inline Eigen::Matrix4d homogeneous(const RigidTransform& T) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = T.R;
  out.topRightCorner<3, 1>() = T.p;
  return out;
}

/// Mlist, Glist and Slist.
struct BookChain {
  std::vector<RigidTransform> M;  ///< M_(i,i+1), the last of them the tip's in the last link's frame
  std::vector<rigid_body::SpatialInertia> G;
  std::vector<Vector6> S;

  rigid_body::ScrewTree tree() const { return rigid_body::screw_chain(std::span(M).first(S.size()), G, S); }
  rigid_body::Tip tip() const { return {static_cast<int>(S.size()), M.back()}; }
  RigidTransform home() const {
    RigidTransform T;
    for (const RigidTransform& step : M) T = T * step;
    return T;
  }
};

/// Throws std::runtime_error where an inertia is not diag(I, m 1).
inline BookChain read_book_chain(const YAML::Node& file) {
  BookChain out;
  for (const YAML::Node& M : file["Mlist"]) out.M.push_back(rigid_transform(as_matrix<4, 4>(M)));
  for (const YAML::Node& node : file["Glist"]) {
    const auto G = as_matrix<6, 6>(node);
    Matrix6 expected = Matrix6::Zero();
    expected.topLeftCorner<3, 3>() = G.topLeftCorner<3, 3>();
    expected.bottomRightCorner<3, 3>().diagonal().setConstant(G(3, 3));
    if (G != expected) throw std::runtime_error("a golden inertia is not in a frame at the centre of mass");
    out.G.push_back({G.topLeftCorner<3, 3>(), G(3, 3)});
  }
  const Eigen::MatrixXd S = golden_matrix<6>(file, "Slist");
  for (Eigen::Index i = 0; i < S.cols(); ++i) out.S.push_back(S.col(i));
  return out;
}

}  // namespace stance::test
