#include "tests/bench/pinocchio_robot.hpp"

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

namespace stance::bench {
namespace {

/// The joint model that is made for the axis, as pinocchio's own parser would choose it.
pinocchio::JointModel joint_about(const Vector3& axis) {
  if (axis == Vector3::UnitX()) return pinocchio::JointModelRX();
  if (axis == Vector3::UnitY()) return pinocchio::JointModelRY();
  if (axis == Vector3::UnitZ()) return pinocchio::JointModelRZ();
  return pinocchio::JointModelRevoluteUnaligned(axis);
}

pinocchio::Model pinocchio_model(const rigid_body::Model& model) {
  pinocchio::Model out;
  for (int i = 0; i < model.num_joints; ++i) {
    const rigid_body::Joint& joint = model.joints[i];
    const rigid_body::Body& body = model.bodies[i + 1];
    const auto id = out.addJoint(static_cast<pinocchio::JointIndex>(joint.parent), joint_about(joint.axis),
                                 pinocchio::SE3(joint.R_PJ, joint.p_PJ), joint.name);
    out.appendBodyToJoint(id, pinocchio::Inertia(body.mass, body.com, body.inertia), pinocchio::SE3::Identity());
  }
  return out;
}

}  // namespace

struct PinocchioRobot::Peer {
  pinocchio::Model model;
  pinocchio::Data data;
  Eigen::VectorXd q, qd, qdd;
  Eigen::MatrixXd J;

  explicit Peer(const rigid_body::Model& from)
      : model(pinocchio_model(from)), data(model), q(model.nq), qd(model.nv), qdd(model.nv), J(6, model.nv) {
    J.setZero();
  }
  pinocchio::JointIndex tip() const { return static_cast<pinocchio::JointIndex>(model.njoints - 1); }
};

PinocchioRobot::PinocchioRobot(const rigid_body::Model& model) : peer_(std::make_unique<Peer>(model)) {}
PinocchioRobot::~PinocchioRobot() = default;

Vector3 PinocchioRobot::tip_position(const JointVector& q) {
  peer_->q = q.head(peer_->q.size());
  pinocchio::forwardKinematics(peer_->model, peer_->data, peer_->q);
  return peer_->data.oMi[peer_->tip()].translation();
}

double PinocchioRobot::tip_jacobian(const JointVector& q) {
  peer_->q = q.head(peer_->q.size());
  pinocchio::computeJointJacobian(peer_->model, peer_->data, peer_->q, peer_->tip(), peer_->J);
  return peer_->J(0, 0);
}

const Eigen::VectorXd& PinocchioRobot::rnea(const JointVector& q, const JointVector& qd, const JointVector& qdd) {
  peer_->q = q.head(peer_->q.size());
  peer_->qd = qd.head(peer_->qd.size());
  peer_->qdd = qdd.head(peer_->qdd.size());
  return pinocchio::rnea(peer_->model, peer_->data, peer_->q, peer_->qd, peer_->qdd);
}

const Eigen::MatrixXd& PinocchioRobot::mass_matrix(const JointVector& q) {
  peer_->q = q.head(peer_->q.size());
  pinocchio::crba(peer_->model, peer_->data, peer_->q);
  peer_->data.M.triangularView<Eigen::StrictlyLower>() =
      peer_->data.M.transpose().triangularView<Eigen::StrictlyLower>();
  return peer_->data.M;
}

}  // namespace stance::bench
