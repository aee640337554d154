#pragma once
// A run: the plant, its drives and sensors, and the scenario's events, in control periods. It speaks the messages of
// lcmtypes/ and knows neither sockets nor clocks: the same scenario, seed and accepted messages give the same bits.
//
// At the instant t_k = k kControlPeriod: state() and truth() are of t_k; what is accepted then takes effect
// `command_latency` of the scenario after t_k; advance() goes on to t_(k+1).
#include <array>
#include <cstdint>
#include <optional>
#include <stance_msgs/ball_observation_t.hpp>
#include <stance_msgs/ball_truth_t.hpp>
#include <stance_msgs/calibration_points_t.hpp>
#include <stance_msgs/catch_plan_t.hpp>
#include <stance_msgs/force_plan_t.hpp>
#include <stance_msgs/joint_command_t.hpp>
#include <stance_msgs/push_t.hpp>
#include <stance_msgs/robot_state_t.hpp>
#include <stance_msgs/truth_t.hpp>
#include <stance_msgs/user_command_t.hpp>
#include <string>
#include <vector>

#include "controller/config/robot_description.hpp"
#include "sim/catch_judge.hpp"
#include "sim/drives.hpp"
#include "sim/scenario.hpp"
#include "sim/sensors.hpp"
#include "sim/single_body.hpp"
#include "sim/world.hpp"

namespace stance::sim {

struct SimulatorOptions {
  std::uint64_t seed = 1;  ///< of the terrain and the sensors' noise; the scenario's random values are drawn by then
  std::int64_t run_id = 1;
  std::int64_t start_utime = 0;  ///< us, stamp of t_0
  std::optional<Plant> plant;    ///< in place of the scenario's
};

class Simulator {
 public:
  /// Throws config::ConfigError and std::invalid_argument. All memory but Bullet's own is taken here.
  Simulator(const config::RobotDescription& robot, const Scenario& scenario, const SimulatorOptions& options);

  const stance_msgs::robot_state_t& state() const { return state_; }
  const stance_msgs::truth_t& truth() const { return truth_; }
  /// The scenario's command in force, sent again and again as an operator's program would: at this instant, else null.
  const stance_msgs::user_command_t* user_command() const { return user_command_due_ ? &user_command_ : nullptr; }

  // Of a robot with a cup, else null.
  /// What the camera tells at this instant, or null.
  const stance_msgs::ball_observation_t* ball_observation() const { return camera_ ? camera_->observation() : nullptr; }
  /// The same points once a second, for whoever comes late; null at other instants.
  const stance_msgs::calibration_points_t* calibration_points() const;
  const stance_msgs::ball_truth_t* ball_truth() const { return camera_ ? &ball_truth_ : nullptr; }
  /// Every throw that is over, as it was then.
  const std::vector<stance_msgs::ball_truth_t>& throws() const { return throws_; }

  Acceptance accept(const stance_msgs::joint_command_t& command) noexcept;
  /// False where the plan is not of this run, of another robot's size, not finite, or older than one before it.
  bool accept(const stance_msgs::force_plan_t& plan) noexcept;
  /// Whoever says it: a robot that is told to lie down, and whose drives damp for it, has not fallen.
  void hear(const stance_msgs::user_command_t& command) noexcept;
  /// False where the plan is not of this run. For the judgement of throws alone.
  bool accept(const stance_msgs::catch_plan_t& plan) noexcept;
  /// Starts now. False where it is not finite, not of this run, or too many are under way.
  bool accept(const stance_msgs::push_t& push) noexcept;

  /// One control period.
  void advance();

  const RefusalCounts& refused() const { return gate_.refused(); }
  /// It lies because it was told to.
  bool lying() const { return lying_; }
  bool fallen() const { return fall_ != kinematics::Fall::kNone; }
  /// What the robot has fallen by, first.
  kinematics::Fall fall() const { return fall_; }
  /// The link that the robot lies on, where its fall is of that kind; empty before.
  const std::string& fallen_on() const { return fallen_on_; }
  double time() const { return static_cast<double>(period_) * kControlPeriod; }  ///< s, since t_0

 private:
  /// What the controller sent, from its acceptance to its effect and after: the newest that is in effect, and those on
  /// their way.
  template <typename Message>
  struct Delayed {
    struct Entry {
      Message message;
      std::int64_t effect_step = 0;
    };
    // One message a period can be on its way (a second in one period replaces the first), and the one in effect.
    static constexpr std::size_t kCapacity = kMaxCommandDelaySteps / kStepsPerPeriod + 2;
    std::array<Entry, kCapacity> waiting{};
    std::size_t num_waiting = 0;
    Message current;
    bool has_current = false;
    std::int64_t last_accepted_step = 0;

    void put(const Message& message, std::int64_t now, std::int64_t delay) noexcept;
    void promote(std::int64_t now) noexcept;
    bool valid(std::int64_t now, std::int64_t timeout_steps) const noexcept;
  };
  struct Sums {
    JointVector torque = JointVector::Zero();
    ContactVectors foot_force{};
    Vector3 push = Vector3::Zero();
  };

  /// What `read` gives of the plant.
  template <typename Read>
  auto plant(Read read) const {
    return world_ ? read(*world_) : read(*single_body_);
  }
  ContactVectors planned_forces() const noexcept;
  void move_single_body(const Wrench& push);
  ContactVectors felt_by_single_body() const noexcept;
  static Sums no_sums() noexcept;
  void step(Sums& sums);
  Wrench push_wrench(const rigid_body::State& state, double now) const noexcept;
  void judge_fall(kinematics::Fall fall) noexcept;
  void move_ball();
  CupPose cup() const noexcept;
  void write_ball_truth() noexcept;
  void write_messages(const Sums& sums) noexcept;

  config::RobotDescription robot_;
  Scenario scenario_;
  SimulatorOptions options_;
  std::size_t num_contacts_;
  std::int64_t timeout_steps_;
  std::optional<World> world_;  // one of these two is the plant
  std::optional<SingleBody> single_body_;
  std::optional<Sensors> sensors_;
  ContactVectors resting_force_W_{};  // N, the weight shared by the feet
  CommandGate gate_;
  Delayed<stance_msgs::joint_command_t> commands_;
  Delayed<stance_msgs::force_plan_t> plans_;
  std::int64_t newest_plan_seq_ = 0;
  std::int64_t newest_plan_state_seq_ = 0;
  std::array<ScheduledPush, 16> requested_pushes_{};  // a finished one is free: duration 0

  std::int64_t period_ = 0;  // control periods since t_0
  std::int64_t step_ = 0;    // physics steps since t_0
  bool drives_damped_ = false;
  kinematics::Fall fall_ = kinematics::Fall::kNone;
  std::string fallen_on_;
  bool told_to_lie_ = false;
  bool lying_ = false;
  std::size_t next_command_ = 0;
  bool user_command_due_ = false;
  std::optional<Camera> camera_;  // these of a robot with a cup
  std::optional<CatchJudge> judge_;
  std::vector<Vector3> launch_velocity_;  // m/s, of the scenario's throws
  std::size_t next_throw_ = 0;
  stance_msgs::ball_truth_t ball_truth_{};
  std::vector<stance_msgs::ball_truth_t> throws_;
  stance_msgs::robot_state_t state_{};
  stance_msgs::truth_t truth_{};
  stance_msgs::user_command_t user_command_{};
};

}  // namespace stance::sim
