#include "hole_guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/hole_caps.h"

namespace ist {
namespace {

// How much larger than needed an obstacle is, as a share of what is needed: exits between those
// that were found have theirs. At least half the tolerance, at most a few times it.
constexpr double kSlackShare = 0.15;
constexpr double kMaxSlack = 3.0;
// Caps are divided down to this share of their way to the mesh, and so many tolerances.
constexpr double kCapShare = 0.5;
constexpr double kSmallestCap = 8.0;
// Where the way to the mesh is this share of a cap's size, it is worth to look for an exit.
constexpr double kRoom = 0.25;
constexpr std::size_t kMaxCaps = 50000;
// A climb from a cap's middle to where the mesh is farther.
constexpr int kMaxSteps = 12;
constexpr double kShortestStep = 0.05;
constexpr double kGrowth = 0.2;  // of a step that the distance may lag behind
// Where exits are looked for across a cap, as shares of its way to the mesh.
constexpr double kOffsets[] = {0.02, 0.15, 0.4};
constexpr int kHalvings = 5;
constexpr std::size_t kMaxSpheres = 2000;

// Outside, or so near to it that a sphere should not rely on being inside.
constexpr double kOpen = 0.52;
// So near to an integer, the winding number tells of no hole; elsewhere of one that is far.
constexpr double kWhole = 0.02, kAboutWhole = 0.1;

constexpr int kDirections = 120;
constexpr int kStride = 67;  // far apart one after the other
constexpr int kMarchSteps = 16;
// From the ray that comes nearest to an exit, further ones are so many radians away.
constexpr double kWidestTurn = 0.16, kLeastTurn = 0.015;
constexpr int kTurns = 6;

// Evenly spread on the unit sphere (Fibonacci's spiral).
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

HoleGuard::HoleGuard(const TriangleMesh& mesh, const TriangleBvh& bvh, double tolerance)
    : bvh_(bvh), tolerance_(tolerance) {
  const std::vector<OpenEdge> open = open_edges(mesh);
  if (open.empty()) return;
  TriangleMesh edges;
  edges.vertices = mesh.vertices;
  for (const OpenEdge& edge : open) edges.triangles.push_back({edge.from, edge.to, edge.to});
  edges_ = TriangleBvh(edges);
  close(hole_caps(mesh, open));
}

// The farthest from the mesh first: obstacles in the middle of a hole spare those at its rim.
void HoleGuard::close(const TriangleMesh& caps) {
  struct Cap {
    Corners corners;
    double distance;
  };
  std::vector<Cap> sorted;
  sorted.reserve(caps.triangles.size());
  for (std::size_t t = 0; t < caps.triangles.size(); ++t) {
    const Corners c{caps.corner(t, 0), caps.corner(t, 1), caps.corner(t, 2)};
    sorted.push_back({c, to_mesh((c.a + c.b + c.c) / 3.0)});
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Cap& x, const Cap& y) { return x.distance > y.distance; });
  for (const Cap& cap : sorted) look_about(cap.corners);
}

void HoleGuard::look_about(const Corners& cap) {
  const Eigen::Vector3d y = (cap.a + cap.b + cap.c) / 3.0;
  const double size = std::max({(cap.a - y).norm(), (cap.b - y).norm(), (cap.c - y).norm()});
  const ClosestPoint closest = bvh_.closest(y);
  const double distance = std::sqrt(closest.distance_sq);
  ++caps_seen_;
  if (distance + size <= tolerance_ || is_held(cap, closest.point)) return;
  const Eigen::Vector3d normal = (cap.b - cap.a).cross(cap.c - cap.a).stableNormalized();
  if (distance > std::max(0.5 * tolerance_, kRoom * size)) {
    const auto exit = exit_across(y, normal, distance);
    if (exit) {
      const Eigen::Vector3d middle = climbed(y, normal, closest);
      const auto farther = exit_across(middle, normal, to_mesh(middle));
      add(farther ? *farther : *exit);
    }
    if (is_held(cap, closest.point)) return;
  }
  if (size <= std::max(kCapShare * distance, kSmallestCap * tolerance_) || caps_seen_ > kMaxCaps) {
    doubtful_.add(y, 2.0 * size + 1.25 * distance);
    return;
  }
  // At the middle of the longest edge.
  const double ab = (cap.b - cap.a).squaredNorm(), bc = (cap.c - cap.b).squaredNorm(),
               ca = (cap.a - cap.c).squaredNorm();
  Corners turned = cap;  // its longest edge is ab
  if (bc >= ab && bc >= ca) turned = {cap.b, cap.c, cap.a};
  if (ca > bc && ca >= ab) turned = {cap.c, cap.a, cap.b};
  const Eigen::Vector3d middle = 0.5 * (turned.a + turned.b);
  look_about({turned.a, middle, turned.c});
  look_about({middle, turned.b, turned.c});
}

// Whether an obstacle holds the spheres about all points of the cap that reach to the mesh:
// |x - center| + |x - q| is convex, and no less than what x needs, for any point q of the mesh.
bool HoleGuard::is_held(const Corners& cap, const Eigen::Vector3d& q) const {
  if (spheres_.size() == 0) return false;
  const Eigen::Vector3d y = (cap.a + cap.b + cap.c) / 3.0;
  const SphereSearch::Match match = spheres_.best(&y, 1, 0);
  const Eigen::Vector3d& center = spheres_.center(match.sphere);
  const auto holds = [&](const Eigen::Vector3d& x) {
    return (x - center).norm() + (x - q).norm() <= spheres_.weight(match.sphere);
  };
  return holds(cap.a) && holds(cap.b) && holds(cap.c);
}

// From y in the cap's plane away from the mesh, as long as the sphere there that reaches to the
// mesh holds the one before: in the middle of a hole one obstacle stands for most of it.
Eigen::Vector3d HoleGuard::climbed(const Eigen::Vector3d& y, const Eigen::Vector3d& normal,
                                   const ClosestPoint& closest) const {
  Eigen::Vector3d x = y, q = closest.point;
  double distance = std::sqrt(closest.distance_sq), step = 0.5 * distance;
  for (int i = 0; i < kMaxSteps && step > kShortestStep * distance; ++i) {
    const Eigen::Vector3d away = x - q, along = away - normal.dot(away) * normal;
    if (along.norm() <= 0.0) break;
    const Eigen::Vector3d next = x + step * along.normalized();
    const ClosestPoint there = bvh_.closest(next);
    const double beyond = std::sqrt(there.distance_sq);
    if (distance + step > beyond + kGrowth * step) {
      step *= 0.5;
      continue;
    }
    x = next;
    q = there.point;
    distance = beyond;
  }
  return x;
}

// On the line through y across the cap.
std::optional<Eigen::Vector3d> HoleGuard::exit_across(const Eigen::Vector3d& y,
                                                      const Eigen::Vector3d& normal,
                                                      double reach) const {
  double low = -kOffsets[0] * reach, high = -low;
  bool low_is_open = is_open(y + low * normal), high_is_open = is_open(y + high * normal);
  for (std::size_t i = 1; low_is_open == high_is_open; ++i) {
    if (i == std::size(kOffsets)) return std::nullopt;
    const double offset = kOffsets[i] * reach;
    if (is_open(y - offset * normal) != low_is_open) {
      high = low;
      low = -offset;
      low_is_open = !low_is_open;
    } else if (is_open(y + offset * normal) != high_is_open) {
      low = high;
      high = offset;
      high_is_open = !high_is_open;
    }
  }
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (is_open(y + middle * normal) == low_is_open ? low : high) = middle;
  }
  return y + 0.5 * (low + high) * normal;
}

// A point outside keeps the sphere as far away as the mesh. Along a ray, the way less the distance
// to the mesh does not fall: beyond where it comes to the radius nothing matters.
std::optional<Eigen::Vector3d> HoleGuard::exit_along(const Eigen::Vector3d& center, double radius,
                                                     const Eigen::Vector3d& ray,
                                                     double* margin) const {
  *margin = std::numeric_limits<double>::infinity();
  double inside = 0.0, way = radius;
  for (int k = 0; k < kMarchSteps; ++k) {
    const double distance = to_mesh(center + way * ray);
    if (distance + radius <= 1.0001 * way) {
      const bool is_hole = distance > std::max(tolerance_, kRoom * radius);
      if (is_hole && is_open(center + way * ray)) *margin = way - distance - radius;
      return std::nullopt;
    }
    if (is_open(center + way * ray)) {
      double outside = way;
      for (int i = 0; i < kHalvings; ++i) {
        const double middle = 0.5 * (inside + outside);
        (is_open(center + middle * ray) ? outside : inside) = middle;
      }
      return center + outside * ray;
    }
    inside = way;
    way = std::min(radius + distance, way + 0.98 * distance);  // short of the mesh
    if (way <= 1.001 * inside) return std::nullopt;
  }
  return std::nullopt;
}

bool HoleGuard::may_be_near(const Eigen::Vector3d& center, double radius) const {
  const double w = bvh_.winding_number(center), off = std::abs(w - std::round(w));
  if (off < kWhole) return false;
  if (off > kAboutWhole) return true;
  return doubtful_.size() > 0 && doubtful_.best(&center, 1, 0).cost < radius;
}

bool HoleGuard::admits(const Eigen::Vector3d& center, double radius) {
  if (!bvh_.is_inside(center)) return false;
  if (is_closed() || !may_be_near(center, radius)) return true;
  static const std::array<Eigen::Vector3d, kDirections> kRays = make_directions();
  double margin, least = std::numeric_limits<double>::infinity();
  Eigen::Vector3d nearest = kRays[0];
  std::optional<Eigen::Vector3d> exit;
  for (std::size_t i = 0; i < kRays.size() && !exit; ++i) {
    exit = exit_along(center, radius, kRays[i], &margin);
    if (margin < least) nearest = kRays[i];
    least = std::min(least, margin);
  }
  if (!exit && std::isfinite(least)) exit = exit_about(center, radius, nearest, least);
  if (!exit) return true;
  if (spheres_.size() < kMaxSpheres) add(*exit);
  return false;
}

// Turns the ray that comes nearest to an exit as long as it comes nearer.
std::optional<Eigen::Vector3d> HoleGuard::exit_about(const Eigen::Vector3d& center, double radius,
                                                     Eigen::Vector3d ray, double least) const {
  double margin;
  double turn = kWidestTurn;
  for (int step = 0; step < kMaxSteps && turn > kLeastTurn; ++step) {
    const Eigen::Vector3d u = ray.unitOrthogonal(), v = ray.cross(u);
    Eigen::Vector3d best = ray;
    double best_margin = least;
    for (int i = 0; i < kTurns; ++i) {
      const double angle = 2.0 * M_PI * i / kTurns;
      const Eigen::Vector3d turned =
          (ray + turn * (std::cos(angle) * u + std::sin(angle) * v)).normalized();
      if (auto exit = exit_along(center, radius, turned, &margin)) return exit;
      if (margin < best_margin) best = turned;
      best_margin = std::min(best_margin, margin);
    }
    if (!(best_margin < 0.9 * least)) turn *= 0.5;
    ray = best;
    least = best_margin;
  }
  return std::nullopt;
}

HoleGuard::Obstacle HoleGuard::nearest(const Eigen::Vector3d& x, double at_most) const {
  Obstacle obstacle{x, 0.0, at_most};
  const double reach = at_most + tolerance_;
  if (is_closed() || reach <= 0.0) return obstacle;
  const ClosestPoint edge = edges_.closest(x, reach * reach);
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

bool HoleGuard::is_open(const Eigen::Vector3d& p) const {
  const double quick = bvh_.quick_winding_number(p);
  if (std::abs(quick - kOpen) > TriangleBvh::kQuickWindingError) return quick < kOpen;
  return bvh_.winding_number(p) < kOpen;
}

double HoleGuard::to_mesh(const Eigen::Vector3d& p) const {
  return std::sqrt(bvh_.closest(p).distance_sq);
}

void HoleGuard::add(const Eigen::Vector3d& exit) {
  const double needed = to_mesh(exit);
  spheres_.add(exit,
               needed + std::clamp(kSlackShare * needed, 0.5 * tolerance_, kMaxSlack * tolerance_));
}

}  // namespace ist
