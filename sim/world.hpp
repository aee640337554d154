#pragma once
// The robot in Bullet: one Featherstone multibody over the ground, double precision, stepped at 1 kHz.
//
// Settings that matter: no damping of Bullet's own, gyroscopic term on, exact friction cone, contacts solved to
// 1e-12 m/s or 50 iterations, no softness, no restitution, never asleep. The joints' ranges are stops of the physics.
// Every body meets the ground, and the other bodies but its neighbours in the tree, with the collision shapes of the
// URDF.
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "controller/rigid_body/dynamics.hpp"
#include "controller/rigid_body/model.hpp"
#include "sim/ball.hpp"
#include "sim/terrain.hpp"

namespace stance::sim {

inline constexpr int kStepsPerPeriod = 10;  ///< physics and drive steps in a control period
inline constexpr double kPhysicsStep = kControlPeriod / kStepsPerPeriod;  ///< s

/// Force on the base at B's origin and moment about it, in W.
struct Wrench {
  Vector3 force = Vector3::Zero();   ///< N
  Vector3 moment = Vector3::Zero();  ///< N m
};

/// Whole-robot quantities that no sensor sees.
struct Mechanics {
  Vector3 p_WC = Vector3::Zero();   ///< m
  Vector3 v_WC = Vector3::Zero();   ///< m/s
  Vector3 L_C_W = Vector3::Zero();  ///< kg m^2/s
  double energy = 0.0;              ///< J, kinetic, and potential over W's origin
};

/// Of the tree in this state.
Mechanics mechanics(const rigid_body::Model& model, const rigid_body::State& state) noexcept;

/// Foot tips (the spheres' centres) of the tree in this state, in W [m].
ContactVectors foot_tips(const rigid_body::Model& model, const std::vector<rigid_body::Foot>& feet,
                         const rigid_body::State& state) noexcept;

struct WorldSetup {
  rigid_body::Model model;
  std::vector<rigid_body::Foot> feet;  ///< at most kMaxContacts
  std::vector<rigid_body::CollisionShape> shapes;
  double friction = 0.0;  ///< between the ground and the robot; between its bodies, the square
  Terrain terrain;
  bool floating = true;  ///< false: the base is fixed where it starts
  rigid_body::State initial;
  std::optional<BallModel> ball;  ///< where there is one, its restitution and friction are those of all that it meets
};

/// A ball that is there.
struct BallState {
  Vector3 p_W = Vector3::Zero();  ///< m, its centre
  Vector3 v_W = Vector3::Zero();  ///< m/s
};

class World {
 public:
  explicit World(const WorldSetup& setup);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// One step of kPhysicsStep under joint torques [N m] and a wrench on the base.
  void step(const JointVector& torque, const Wrench& push);

  /// Puts the ball at `p_W` [m] with `v_W` [m/s], wherever it was. Only where the set-up has one.
  void throw_ball(const Vector3& p_W, const Vector3& v_W);
  /// Takes it away.
  void take_ball();
  /// Nothing while it is not there.
  const std::optional<BallState>& ball() const { return ball_; }

  const rigid_body::State& state() const { return state_; }
  Mechanics mechanics() const noexcept { return sim::mechanics(model_, state_); }
  /// Foot tips (the spheres' centres) in W [m].
  ContactVectors foot_tips_W() const noexcept { return foot_tips(model_, feet_, state_); }
  /// Forces of the ground on the feet in W, mean over the last step [N].
  const ContactVectors& foot_force_W() const { return foot_force_W_; }
  /// Index of a body that bore on the ground in the last step with more than its foot, -1 where none did.
  int body_on_ground() const { return body_on_ground_; }

 private:
  struct Bullet;
  void read_state();
  void read_contacts();
  void read_ball();
  /// Whose ball the body's shape is; -1 for what is no foot's.
  int foot_of(int body, int shape) const noexcept;

  rigid_body::Model model_;
  std::vector<rigid_body::Foot> feet_;
  std::unique_ptr<Bullet> bullet_;
  Matrix3 R_BI_ = Matrix3::Identity();  // the base's principal axes
  rigid_body::State state_;
  std::optional<BallModel> ball_model_;
  std::optional<BallState> ball_;
  ContactVectors foot_force_W_{};
  std::array<int, kMaxContacts> foot_shape_{};  // of each foot's ball among its body's shapes
  int body_on_ground_ = -1;
};

}  // namespace stance::sim
