#include "hole_obstacles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "internal/geometry/hole_caps.h"

namespace ist {
namespace {

// Obstacles are larger than necessary by this share, so that they stand for the openings between
// those that were found, too; by at least half the tolerance and at most a few times it.
constexpr double kObstacleExcess = 0.15;
constexpr double kMaxExcess = 3.0;
// An opening is looked for where the distance to the mesh is at least this share of the radius.
constexpr double kMinDistance = 0.25;
constexpr int kBisections = 5;
constexpr std::size_t kMaxSpheres = 2000;

// Points with a smaller winding number are outside, or so near to it that no sphere should contain
// them.
constexpr double kMinInside = 0.52;
// A winding number this near to an integer shows that no hole is near; the second value, that a
// hole is far away.
constexpr double kNoHole = 0.02, kFarHole = 0.1;

constexpr int kDirections = 120;
constexpr int kStride = 67;  // successive directions are far apart
constexpr int kMarchSteps = 16;
constexpr int kMaxSteps = 12;  // of a pattern search
// The ray that comes nearest to an opening is turned by angles of this range [rad].
constexpr double kMaxTurn = 0.16, kMinTurn = 0.015;
constexpr int kTurns = 6;

// Evenly spread on the unit sphere (a Fibonacci lattice).
std::array<Eigen::Vector3d, kDirections> make_directions() {
  constexpr double kGoldenAngle = 2.39996322972865332;
  std::array<Eigen::Vector3d, kDirections> directions;
  for (int k = 0; k < kDirections; ++k) {
    const int i = k * kStride % kDirections;
    const double z = 1.0 - (2.0 * i + 1.0) / kDirections, radius = std::sqrt(1.0 - z * z);
    directions[static_cast<std::size_t>(k)] = {radius * std::cos(kGoldenAngle * i),
                                               radius * std::sin(kGoldenAngle * i), z};
  }
  return directions;
}

}  // namespace

HoleObstacles::HoleObstacles(const TriangleMesh& mesh, const MeshSurface& surface, double tolerance,
                             PackingWatch* watch)
    : bvh_(surface.bvh), watch_(*watch), tolerance_(tolerance) {
  const std::vector<OpenEdge>& open = surface.open_edges;
  if (open.empty()) return;
  TriangleMesh edges;
  edges.vertices = mesh.vertices;
  for (const OpenEdge& edge : open) edges.triangles.push_back({edge.from, edge.to, edge.to});
  edges_ = TriangleBvh(edges, [this] { return !keeps_on(); });
  search_caps(hole_caps(mesh, open));
}

// Searches an opening that the sphere comes too near to, along a ray from its centre (sphere
// tracing: the distance to the mesh is a safe step). Along the ray, t less the distance to the mesh
// does not fall; where it exceeds the radius, no point is too near any more.
// @param margin  [m] of a ray that meets no such opening but ends outside: by how much it is not
// too
//                near; else +inf
HoleObstacles::OpeningPoint HoleObstacles::opening_along(const Eigen::Vector3d& center,
                                                         double radius, const Eigen::Vector3d& ray,
                                                         double* margin) const {
  *margin = std::numeric_limits<double>::infinity();
  double inside = 0.0, t = radius;
  for (int k = 0; k < kMarchSteps; ++k) {
    const double distance = distance_to_mesh(center + t * ray);
    if (distance + radius <= 1.0001 * t) {
      const bool is_hole = distance > std::max(tolerance_, kMinDistance * radius);
      if (is_hole && is_outside(center + t * ray)) *margin = t - distance - radius;
      return std::nullopt;
    }
    if (is_outside(center + t * ray)) {
      double outside = t;
      for (int i = 0; i < kBisections; ++i) {
        const double middle = 0.5 * (inside + outside);
        (is_outside(center + middle * ray) ? outside : inside) = middle;
      }
      return center + outside * ray;
    }
    inside = t;
    t = std::min(radius + distance, t + 0.98 * distance);  // short of the mesh
    if (t <= 1.001 * inside) return std::nullopt;
  }
  return std::nullopt;
}

bool HoleObstacles::may_be_near(const Eigen::Vector3d& center, double radius) const {
  const double w = bvh_.winding_number(center), off = std::abs(w - std::round(w));
  if (off < kNoHole) return false;
  if (off > kFarHole) return true;
  return uncertain_.size() > 0 && uncertain_.best(&center, 1, 0).cost < radius;
}

bool HoleObstacles::admits(const Eigen::Vector3d& center, double radius) {
  if (!bvh_.is_inside(center)) return false;
  if (is_closed() || !may_be_near(center, radius)) return true;
  static const std::array<Eigen::Vector3d, kDirections> kRays = make_directions();
  double margin, min_margin = std::numeric_limits<double>::infinity();
  Eigen::Vector3d nearest = kRays[0];
  OpeningPoint opening;
  for (std::size_t i = 0; i < kRays.size() && !opening; ++i) {
    if (!keeps_on()) return false;
    opening = opening_along(center, radius, kRays[i], &margin);
    if (margin < min_margin) nearest = kRays[i];
    min_margin = std::min(min_margin, margin);
  }
  if (!opening && std::isfinite(min_margin)) {
    opening = opening_near(center, radius, nearest, min_margin);
  }
  if (!opening) return true;
  if (spheres_.size() < kMaxSpheres) add_obstacle(*opening);
  return false;
}

// Turns the ray that comes nearest to an opening as long as it comes nearer (pattern search).
HoleObstacles::OpeningPoint HoleObstacles::opening_near(const Eigen::Vector3d& center,
                                                        double radius, Eigen::Vector3d ray,
                                                        double margin) const {
  double turned_margin;
  double turn = kMaxTurn;
  for (int step = 0; step < kMaxSteps && turn > kMinTurn; ++step) {
    const Eigen::Vector3d u = ray.unitOrthogonal(), v = ray.cross(u);
    Eigen::Vector3d best = ray;
    double best_margin = margin;
    for (int i = 0; i < kTurns && keeps_on(); ++i) {
      const double angle = 2.0 * M_PI * i / kTurns;
      const Eigen::Vector3d turned =
          (ray + turn * (std::cos(angle) * u + std::sin(angle) * v)).normalized();
      if (auto opening = opening_along(center, radius, turned, &turned_margin)) return opening;
      if (turned_margin < best_margin) best = turned;
      best_margin = std::min(best_margin, turned_margin);
    }
    if (!(best_margin < 0.9 * margin)) turn *= 0.5;
    ray = best;
    margin = best_margin;
  }
  return std::nullopt;
}

HoleObstacles::Obstacle HoleObstacles::nearest(const Eigen::Vector3d& x,
                                               double max_distance) const {
  Obstacle obstacle{x, 0.0, max_distance};
  const double edge_distance = max_distance + tolerance_;
  if (is_closed() || edge_distance <= 0.0) return obstacle;
  const ClosestPoint edge = edges_.closest(x, edge_distance * edge_distance);
  if (std::isfinite(edge.distance_sq)) {
    const double distance = std::sqrt(edge.distance_sq) - tolerance_;
    if (distance < obstacle.distance) obstacle = {edge.point, tolerance_, distance};
  }
  if (spheres_.size() == 0) return obstacle;
  const SphereSearch::Match match = spheres_.best(&x, 1, 0);
  if (match.cost < obstacle.distance) {
    obstacle = {spheres_.center(match.sphere), spheres_.weight(match.sphere), match.cost};
  }
  return obstacle;
}

bool HoleObstacles::is_outside(const Eigen::Vector3d& p) const {
  double error;
  const double quick = bvh_.quick_winding_number(p, &error);
  if (std::abs(quick - kMinInside) > error) return quick < kMinInside;
  return bvh_.winding_number(p) < kMinInside;
}

double HoleObstacles::distance_to_mesh(const Eigen::Vector3d& p) const {
  return std::sqrt(bvh_.closest(p).distance_sq);
}

void HoleObstacles::add_obstacle(const Eigen::Vector3d& opening) {
  const double distance = distance_to_mesh(opening);
  const double excess =
      std::clamp(kObstacleExcess * distance, 0.5 * tolerance_, kMaxExcess * tolerance_);
  spheres_.add(opening, distance + excess);
}

}  // namespace ist
