#include "sim/camera.hpp"

#include "controller/platform/hash.hpp"

namespace stance::sim {
namespace {

using stance_msgs::calibration_points_t;

void copy(const Vector3& from, double (&to)[3]) noexcept {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

std::uint64_t keyed(const char* name, std::uint64_t seed) {
  return platform::hash(std::string_view(name), platform::hash_step(platform::kHashSeed, seed));
}

}  // namespace

Camera::Camera(const CameraModel& model, std::uint64_t seed) : model_(model), random_(keyed("camera", seed)) {
  Random points(keyed("calibration", seed));
  points_.seq = 1;
  points_.num_points = model_.points;
  for (std::size_t i = 0; i < static_cast<std::size_t>(model_.points); ++i) {
    Vector3 p_K;
    for (int axis = 0; axis < 3; ++axis) {
      p_K[axis] =
          model_.points_from_K[axis] + points.uniform() * (model_.points_to_K[axis] - model_.points_from_K[axis]);
    }
    copy(p_K, points_.p_K[i]);
    copy(model_.T_WK * p_K + model_.point_sigma * normal3(points), points_.p_A[i]);
  }
}

void Camera::begin(std::int64_t utime, std::int64_t run_id) noexcept {
  run_id_ = run_id;
  points_.utime = utime;
  points_.run_id = run_id;
}

void Camera::look(std::int64_t period, std::int64_t utime, const std::optional<Vector3>& p_WBall) noexcept {
  const auto slot = [this](std::int64_t k) -> auto& { return frames_[static_cast<std::size_t>(k) % frames_.size()]; };
  if (period % model_.period == 0) {
    // Every frame draws the same numbers, so that one more error of one kind leaves the others as they are.
    const Vector3 noise = normal3(random_), outlier = normal3(random_);
    const bool dropped = random_.uniform() < model_.dropout;
    const bool stray = random_.uniform() < model_.outlier_share;
    stance_msgs::ball_observation_t& frame = slot(period);
    frame.utime = utime;
    frame.seq = ++seq_;
    frame.run_id = run_id_;
    frame.valid = p_WBall && !dropped ? 1 : 0;
    copy(Vector3::Zero(), frame.p_KBall);
    if (frame.valid != 0) {
      copy(model_.T_WK.inverse() * *p_WBall + model_.sigma * noise + (stray ? model_.outlier_size : 0.0) * outlier,
           frame.p_KBall);
    }
  }
  const std::int64_t told = period - model_.latency;
  due_ = told >= 0 && told % model_.period == 0;
  if (due_) observation_ = slot(told);
}

}  // namespace stance::sim
