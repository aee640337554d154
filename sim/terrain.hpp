#pragma once
// The ground, through W's origin:  z(x, y) = tan(slope_x) x + tan(slope_y) y + tile(x, y)
//
// Tiles stand on a grid of `tile_size`. Tile i begins at i tile_size, is level for 3/4 of that and ramps to the next
// one over the rest, along x as along y; corners between four tiles are two triangles. Each tile's height is uniform in
// +-tile_height by the run's seed and the tile's place alone, so that the ground has no end; tiles within 0.35 m of W's
// origin, along x and along y, are at 0.
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "controller/math/so3.hpp"

namespace stance::sim {

struct TerrainModel {
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  ///< rad, of the ground's rise along W's x and y
  double tile_size = 0.0;                           ///< m, 0 for no tiles
  double tile_height = 0.0;                         ///< m

  bool has_tiles() const { return tile_size > 0.0; }
  bool is_flat() const { return !has_tiles() && slope.isZero(0.0); }
};

/// Where a sphere is next to the ground.
struct GroundContact {
  Vector3 point;          ///< m, of the ground, in W
  Vector3 normal;         ///< unit vector from there to the sphere's centre, in W
  double distance = 0.0;  ///< m, from the point to the sphere's centre
};

class Terrain {
 public:
  Terrain() = default;  ///< flat
  Terrain(const TerrainModel& model, std::uint64_t seed);

  const TerrainModel& model() const { return model_; }
  /// Upward unit normal of the ground without its tiles.
  Vector3 normal() const;
  /// m, of the ground at a place in W.
  double height(const Eigen::Vector2d& p) const;
  /// m, which no ground over the rectangle from `low` to `high` passes.
  double highest(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const;

  /// Every point of the tiles that is nearer to `centre` than all the ground about it, and no farther than `reach` [m]:
  /// one over level ground and over a ridge, two in a valley.
  void contacts(const Vector3& centre, double reach, std::vector<GroundContact>& out) const;

  /// `visit(corners)`, three points of W [m] at a time, for each triangle of the tiles that meets the rectangle from
  /// `low` to `high`.
  template <typename Visit>
  void triangles(const Eigen::Vector2d& low, const Eigen::Vector2d& high, Visit visit) const {
    const Cell first = cell(low), last = cell(high);
    for (std::int64_t x = first[0]; x <= last[0]; ++x) {
      for (std::int64_t y = first[1]; y <= last[1]; ++y) {
        const Vector3 near = node(x, y), far = node(x + 1, y + 1);
        visit(std::array<Vector3, 3>{near, node(x + 1, y), far});
        visit(std::array<Vector3, 3>{near, far, node(x, y + 1)});
      }
    }
  }

 private:
  // Lines along which the ground may bend: 2 i where tile i begins, 2 i + 1 where its ramp does. A cell has the number
  // of the line that it begins at.
  using Cell = std::array<std::int64_t, 2>;
  std::int64_t line_before(double coordinate) const;
  double coordinate(std::int64_t line) const;
  Cell cell(const Eigen::Vector2d& p) const { return {line_before(p.x()), line_before(p.y())}; }
  double tile(std::int64_t i, std::int64_t j) const;
  Vector3 node(std::int64_t x, std::int64_t y) const;
  double plane(const Eigen::Vector2d& p) const { return rise_.dot(p); }

  TerrainModel model_;
  Eigen::Vector2d rise_ = Eigen::Vector2d::Zero();  // m/m
  std::uint64_t key_ = 0;
};

}  // namespace stance::sim
