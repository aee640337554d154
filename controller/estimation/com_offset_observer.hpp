#pragma once
// How far the robot's centre of mass lies from where the model and the base's estimate put it, horizontally and across
// the line through the feet: what an accelerometer's bias, the joints' offsets and a payload feign. Added to the centre
// of mass that the controller sees, it takes the lean away.
//
// Standing, gravity alone turns the robot about the line through the feet's ground points (unit vector a, horizontal):
//   L' = m g (x + b)      L = a . (L_C + m r x v_C)
//   x = n . r,  n = a x z      r = p_WC - midpoint of the ground points
// State (L_hat, b), both poles at -w:
//   e = L - L_hat         L_hat += dt (m g (x + b) + 2 w e)         b += dt w^2 / (m g) e,  |b| <= limit
#include <array>

#include "controller/math/so3.hpp"

namespace stance::estimation {

struct CentreOfMassOffsetConfig {
  double bandwidth = 0.0;  ///< rad/s, w
  double limit = 0.0;      ///< m
  void validate() const;   ///< throws std::invalid_argument naming the field, its value and the range
};

struct CentreOfMassOffsetInput {
  Vector3 p_WC = Vector3::Zero();   ///< m, of the model at the estimated state, without the offset
  Vector3 v_WC = Vector3::Zero();   ///< m/s
  Vector3 L_C_W = Vector3::Zero();  ///< kg m^2/s
  std::array<Vector3, 2> p_WF{Vector3::Zero(), Vector3::Zero()};  ///< m, tips, left first
  double yaw = 0.0;                                               ///< rad, heading
  bool standing = false;                                          ///< both feet bear load and stay
};

class CentreOfMassOffsetObserver {
 public:
  /// `mass` [kg] of the whole robot; `foot_radius` [m].
  CentreOfMassOffsetObserver(const CentreOfMassOffsetConfig& config, double mass, double foot_radius);

  /// The vector [m, in W] to add to p_WC: along n while standing; else held, along the heading.
  Vector3 step(const CentreOfMassOffsetInput& input, double dt) noexcept;

  double offset() const noexcept { return offset_; }  ///< m, b
  void reset() noexcept;

 private:
  CentreOfMassOffsetConfig config_;
  double mass_;
  double foot_radius_;
  double offset_ = 0.0;            ///< m
  double angular_momentum_ = 0.0;  ///< kg m^2/s, L_hat
  bool observing_ = false;
};

}  // namespace stance::estimation
