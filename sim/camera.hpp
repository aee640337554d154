#pragma once
// A camera that sees the ball, in frame K: a frame each `period_steps`, told `latency` later, with white noise,
// frames without a ball and outliers; and the points by which it is calibrated against the arm.
#include <array>
#include <cstdint>
#include <optional>
#include <stance_msgs/ball_observation_t.hpp>
#include <stance_msgs/calibration_points_t.hpp>

#include "controller/math/se3.hpp"
#include "sim/random.hpp"

namespace stance::sim {

inline constexpr int kMaxCameraLatency = 20;  ///< control periods

struct CameraModel {
  int period = 1;                           ///< control periods from a frame to the next
  int latency = 0;                          ///< control periods from a frame to its message
  double sigma = 0.0;                       ///< m, of each axis
  double dropout = 0.0;                     ///< share of the frames that show no ball though there is one
  double outlier_share = 0.0;               ///< of the frames
  double outlier_size = 0.0;                ///< m, standard deviation of an outlier's error, each axis
  RigidTransform T_WK;                      ///< its pose
  int points = 0;                           ///< of its calibration
  double point_sigma = 0.0;                 ///< m, of each axis of a point as the arm has it
  Vector3 points_from_K = Vector3::Zero();  ///< m, the box in which they are
  Vector3 points_to_K = Vector3::Zero();
};

class Camera {
 public:
  Camera(const CameraModel& model, std::uint64_t seed);

  /// The instant of control period `period`, stamped `utime` [us], with the ball at `p_WBall` [m] if there is one.
  void look(std::int64_t period, std::int64_t utime, const std::optional<Vector3>& p_WBall) noexcept;
  /// What is told at that instant, else null.
  const stance_msgs::ball_observation_t* observation() const noexcept { return due_ ? &observation_ : nullptr; }

  /// Pairs of points, the same in the whole run.
  const stance_msgs::calibration_points_t& calibration_points() const noexcept { return points_; }
  /// Stamps the points and what comes after.
  void begin(std::int64_t utime, std::int64_t run_id) noexcept;

 private:
  CameraModel model_;
  Random random_;
  std::array<stance_msgs::ball_observation_t, kMaxCameraLatency + 1> frames_{};  ///< ring: of period k at k mod size
  stance_msgs::ball_observation_t observation_{};
  bool due_ = false;
  std::int64_t run_id_ = 0;
  std::int64_t seq_ = 0;
  stance_msgs::calibration_points_t points_{};
};

}  // namespace stance::sim
