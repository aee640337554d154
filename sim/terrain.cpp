#include "sim/terrain.hpp"

#include <algorithm>
#include <cmath>

#include "controller/platform/hash.hpp"
#include "sim/random.hpp"

namespace stance::sim {
namespace {

constexpr double kLevelShare = 0.75;  // of a tile's size
constexpr double kLevelStart = 0.35;  // m

/// Point of a triangle next to `p`: by the region of the triangle's plane that `p` is over.
Vector3 next_to(const Vector3& p, const std::array<Vector3, 3>& corners) {
  const auto& [a, b, c] = corners;
  const Vector3 ab = b - a, ac = c - a, bc = c - b;
  const double a_ab = ab.dot(p - a), a_ac = ac.dot(p - a), b_ab = ab.dot(p - b), b_ac = ac.dot(p - b),
               c_ab = ab.dot(p - c), c_ac = ac.dot(p - c);
  if (a_ab <= 0.0 && a_ac <= 0.0) return a;
  if (b_ab >= 0.0 && b_ac <= b_ab) return b;
  if (c_ac >= 0.0 && c_ab <= c_ac) return c;
  // Barycentric coordinates times the squared area of the parallelogram.
  const double of_c = a_ab * b_ac - b_ab * a_ac, of_b = c_ab * a_ac - a_ab * c_ac, of_a = b_ab * c_ac - c_ab * b_ac;
  if (of_c <= 0.0 && a_ab >= 0.0 && b_ab <= 0.0) return a + a_ab / (a_ab - b_ab) * ab;
  if (of_b <= 0.0 && a_ac >= 0.0 && c_ac <= 0.0) return a + a_ac / (a_ac - c_ac) * ac;
  const double from_b = b_ac - b_ab, from_c = c_ab - c_ac;
  if (of_a <= 0.0 && from_b >= 0.0 && from_c >= 0.0) return b + from_b / (from_b + from_c) * bc;
  return (of_a * a + of_b * b + of_c * c) / (of_a + of_b + of_c);
}

std::int64_t half(std::int64_t line) { return line >> 1; }  // rounds down for negative lines, too

}  // namespace

Terrain::Terrain(const TerrainModel& model, std::uint64_t seed)
    : model_(model),
      rise_(std::tan(model.slope.x()), std::tan(model.slope.y())),
      key_(platform::hash("terrain.tiles", platform::hash_step(platform::kHashSeed, seed))) {}

Vector3 Terrain::normal() const { return Vector3(-rise_.x(), -rise_.y(), 1.0).normalized(); }

std::int64_t Terrain::line_before(double coordinate) const {
  const double tiles = coordinate / model_.tile_size;
  const double i = std::floor(tiles);
  return 2 * static_cast<std::int64_t>(i) + (tiles - i >= kLevelShare ? 1 : 0);
}

double Terrain::coordinate(std::int64_t line) const {
  return model_.tile_size * (static_cast<double>(half(line)) + ((line & 1) != 0 ? kLevelShare : 0.0));
}

double Terrain::tile(std::int64_t i, std::int64_t j) const {
  const auto at_start = [&](std::int64_t index) {
    return coordinate(2 * index) < kLevelStart && coordinate(2 * index + 1) > -kLevelStart;
  };
  if (at_start(i) && at_start(j)) return 0.0;
  const auto step = [](std::uint64_t key, std::int64_t index) {
    return platform::hash_step(key, static_cast<std::uint64_t>(index));
  };
  return model_.tile_height * (2.0 * keyed_uniform(step(step(key_, i), j)) - 1.0);
}

Vector3 Terrain::node(std::int64_t x, std::int64_t y) const {
  const Eigen::Vector2d p(coordinate(x), coordinate(y));
  return {p.x(), p.y(), plane(p) + tile(half(x), half(y))};
}

double Terrain::height(const Eigen::Vector2d& p) const {
  if (!model_.has_tiles()) return plane(p);
  const auto [x, y] = cell(p);
  const Vector3 near = node(x, y), far = node(x + 1, y + 1);
  const double u = (p.x() - near.x()) / (far.x() - near.x()), v = (p.y() - near.y()) / (far.y() - near.y());
  if (u >= v) {
    const double corner = node(x + 1, y).z();
    return near.z() + u * (corner - near.z()) + v * (far.z() - corner);
  }
  const double corner = node(x, y + 1).z();
  return near.z() + v * (corner - near.z()) + u * (far.z() - corner);
}

void Terrain::contacts(const Vector3& centre, double reach, std::vector<GroundContact>& out) const {
  constexpr double same = 1e-9;  // m
  struct Face {
    std::array<Vector3, 3> corners;
    Vector3 nearest;
    double distance;
  };
  out.clear();
  const Eigen::Vector2d around(reach, reach), p = centre.head<2>();
  if (centre.z() - reach > highest(p - around, p + around)) return;
  std::vector<Face> faces;
  triangles(p - around, p + around, [&](const std::array<Vector3, 3>& corners) {
    const Vector3 nearest = next_to(centre, corners);
    faces.push_back({corners, nearest, (centre - nearest).norm()});
  });
  for (const Face& face : faces) {
    if (face.distance > reach) continue;
    // An edge between two faces is no place of its own where one of them comes nearer.
    const auto comes_nearer = [&](const Face& other) {
      return other.distance < face.distance - 1e-3 * same &&
             (next_to(face.nearest, other.corners) - face.nearest).norm() < same;
    };
    const auto known = [&](const GroundContact& contact) { return (contact.point - face.nearest).norm() < same; };
    if (std::any_of(faces.begin(), faces.end(), comes_nearer) || std::any_of(out.begin(), out.end(), known)) continue;
    out.push_back({face.nearest, (centre - face.nearest) / face.distance, face.distance});
  }
}

double Terrain::highest(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const {
  return rise_.cwiseProduct(low).cwiseMax(rise_.cwiseProduct(high)).sum() + model_.tile_height;
}

}  // namespace stance::sim
