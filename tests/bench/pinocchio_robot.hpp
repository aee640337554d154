#pragma once
// Our model in pinocchio, behind a header without pinocchio's, which take their own compiler flags.
#include <memory>

#include "controller/rigid_body/model.hpp"

namespace stance::bench {

/// Linear and angular parts as pinocchio has them; joints in our order.
class PinocchioRobot {
 public:
  explicit PinocchioRobot(const rigid_body::Model& model);
  ~PinocchioRobot();
  PinocchioRobot(const PinocchioRobot&) = delete;
  PinocchioRobot& operator=(const PinocchioRobot&) = delete;

  /// m, in the root link's frame: the last joint's frame.
  Vector3 tip_position(const JointVector& q);
  /// An entry of the last joint's Jacobian in its frame, all of which is computed.
  double tip_jacobian(const JointVector& q);
  /// N m
  const Eigen::VectorXd& rnea(const JointVector& q, const JointVector& qd, const JointVector& qdd);
  /// kg m^2, both triangles
  const Eigen::MatrixXd& mass_matrix(const JointVector& q);

 private:
  struct Peer;
  std::unique_ptr<Peer> peer_;
};

}  // namespace stance::bench
