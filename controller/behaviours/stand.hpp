#pragma once
// Standing on two point feet: the reference, and the force QP that keeps it.
//
// The QP is written in the heading frame H of the stand, square to the line through the feet (yaw_ref): theta = (roll,
// pitch, yaw - yaw_ref), the rest of x and the forces turned by Rz(yaw_ref)^T. There the model is time-invariant, with
// three things that standing needs:
//   the coupling term (p against the force reference m g, see centroidal.hpp),
//   the inertia I_eff = d L_C / d omega_trunk with the feet held, and omega := I_eff^-1 L_C,
//   the terminal cost P of the discrete Riccati equation.
#include <memory>

#include "controller/behaviours/biped_config.hpp"
#include "controller/behaviours/tick.hpp"
#include "controller/centroidal/centroidal.hpp"

namespace stance::behaviours {

/// Where the robot is, as standing sees it.
struct StandInput {
  Vector3 rpy = Vector3::Zero();                 ///< rad, yaw unwrapped
  Vector3 p_WC = Vector3::Zero();                ///< m, corrected by the offset observer
  Vector3 v_WC = Vector3::Zero();                ///< m/s
  Vector3 L_C_W = Vector3::Zero();               ///< kg m^2/s
  ContactVectors p_WG = zero_contact_vectors();  ///< m, ground points of the feet
  double height_offset = 0.0;                    ///< m, wanted
  int periods = 1;                               ///< control periods since the last call
};

class Stand {
 public:
  /// `nominal_height` [m]: of C over the ground; `inertia` [kg m^2]: I_eff in H. Throws std::invalid_argument.
  Stand(const StandConfig& config, const HeightConfig& height, const ForceLimits& limits, const force_qp::Settings& qp,
        double mass, const Matrix3& inertia, const std::array<Vector3, 2>& nominal_r, double nominal_height);

  /// Takes up the stance: the height integral starts here.
  void enter() noexcept;

  /// The reference, x and the linear model of this tick.
  void plan(const StandInput& input, TickState& out) noexcept;
  void model() noexcept;
  /// m, where it is on its way to the wanted one.
  double height_offset() const noexcept { return height_.offset(); }
  /// Solves, with `time_left` [s] for it; where the status is kSolved, `plan` has the forces in W and the predicted
  /// path.
  QpStatus solve(double time_left, ForcePlan& plan, Trace& trace) noexcept;

 private:
  Height height_;
  centroidal::Parameters parameters_;
  double nominal_height_;
  Matrix3 inertia_inverse_;
  force_qp::Problem problem_;
  force_qp::Solution solution_;
  std::unique_ptr<force_qp::ForceQp> qp_;

  double yaw_ref_ = 0.0;
  Matrix3 R_WH_ = Matrix3::Identity();
  Vector3 p_ref_W_ = Vector3::Zero();
  ContactVectors p_WG_ = zero_contact_vectors();
};

}  // namespace stance::behaviours
