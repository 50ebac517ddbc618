// The obstacles of HoleObstacles that are found at construction: openings of the mesh near the caps
// that close its holes.

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "hole_obstacles.h"

namespace ist {
namespace {

// Caps are divided until they are this share of their distance to the mesh, or so many tolerances.
constexpr double kMinCap = 0.5;
constexpr double kMinCapTolerances = 8.0;
// An opening is looked for where the distance to the mesh is at least this share of a cap's size.
constexpr double kLeastCapDistance = 0.25;
constexpr std::size_t kMaxCaps = 50000;
// Climb from a cap's centroid to a point farther from the mesh.
constexpr int kMaxClimbs = 12;
constexpr double kLeastClimb = 0.05;  // share of the distance to the mesh
constexpr double kMaxLag = 0.2;       // share of a step by which the distance may fall short of it
// Openings are searched across a cap at these shares of its distance to the mesh.
constexpr double kOffsets[] = {0.02, 0.15, 0.4};
constexpr int kCapBisections = 5;

}  // namespace

// Caps farthest from the mesh come first: an obstacle in the middle of a hole covers most of it.
void HoleObstacles::search_caps(const TriangleMesh& caps) {
  struct Entry {
    Cap cap;
    double distance;
  };
  std::vector<Entry> sorted;
  sorted.reserve(caps.triangles.size());
  for (std::size_t t = 0; t < caps.triangles.size() && keeps_on(); ++t) {
    const Cap cap{caps.corner(t, 0), caps.corner(t, 1), caps.corner(t, 2)};
    sorted.push_back({cap, distance_to_mesh(cap.centroid())});
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Entry& x, const Entry& y) { return x.distance > y.distance; });
  for (const Entry& entry : sorted) {
    if (!keeps_on()) return;
    search_cap(entry.cap);
  }
}

// Adds obstacles until they cover the cap, dividing it where that is needed.
void HoleObstacles::search_cap(const Cap& cap) {
  if (!keeps_on()) return;
  const Eigen::Vector3d y = cap.centroid();
  const double size = std::max({(cap.a - y).norm(), (cap.b - y).norm(), (cap.c - y).norm()});
  const ClosestPoint closest = bvh_.closest(y);
  const double distance = std::sqrt(closest.distance_sq);
  ++cap_count_;
  if (distance + size <= tolerance_ || is_covered(cap, closest.point)) return;
  const Eigen::Vector3d normal = (cap.b - cap.a).cross(cap.c - cap.a).stableNormalized();
  if (distance > std::max(0.5 * tolerance_, kLeastCapDistance * size)) {
    const OpeningPoint opening = opening_across(y, normal, distance);
    if (opening) {
      const Eigen::Vector3d middle = climb_in_plane(y, normal, closest);
      const OpeningPoint farther = opening_across(middle, normal, distance_to_mesh(middle));
      add_obstacle(farther ? *farther : *opening);
    }
    if (is_covered(cap, closest.point)) return;
  }
  const double min_size = std::max(kMinCap * distance, kMinCapTolerances * tolerance_);
  if (size <= min_size || cap_count_ > kMaxCaps) {
    uncertain_.add(y, 2.0 * size + 1.25 * distance);
  } else {
    search_halves(cap);
  }
}

// Divides the cap at the middle of its longest edge.
void HoleObstacles::search_halves(const Cap& cap) {
  const double ab = (cap.b - cap.a).squaredNorm(), bc = (cap.c - cap.b).squaredNorm(),
               ca = (cap.a - cap.c).squaredNorm();
  Cap turned = cap;  // its longest edge is ab
  if (bc >= ab && bc >= ca) turned = {cap.b, cap.c, cap.a};
  if (ca > bc && ca >= ab) turned = {cap.c, cap.a, cap.b};
  const Eigen::Vector3d middle = 0.5 * (turned.a + turned.b);
  search_cap({turned.a, middle, turned.c});
  search_cap({middle, turned.b, turned.c});
}

// Whether one obstacle contains the spheres (x, D(x)) about all points x of the cap. It does if
// |x - center| + |x - q| is at most its radius for a point q of the mesh, since |x - q| >= D(x);
// the sum is convex, so the corners decide.
bool HoleObstacles::is_covered(const Cap& cap, const Eigen::Vector3d& q) const {
  if (spheres_.size() == 0) return false;
  const Eigen::Vector3d y = cap.centroid();
  const SphereSearch::Match match = spheres_.best(&y, 1, 0);
  const Eigen::Vector3d& center = spheres_.center(match.sphere);
  const auto covers = [&](const Eigen::Vector3d& x) {
    return (x - center).norm() + (x - q).norm() <= spheres_.weight(match.sphere);
  };
  return covers(cap.a) && covers(cap.b) && covers(cap.c);
}

// Climbs from y in the cap's plane away from the mesh, as long as the sphere (x, D(x)) contains the
// one before. In the middle of a hole one obstacle stands for most of it.
Eigen::Vector3d HoleObstacles::climb_in_plane(const Eigen::Vector3d& y,
                                              const Eigen::Vector3d& normal,
                                              const ClosestPoint& closest) const {
  Eigen::Vector3d x = y, q = closest.point;
  double distance = std::sqrt(closest.distance_sq), step = 0.5 * distance;
  for (int i = 0; i < kMaxClimbs && step > kLeastClimb * distance; ++i) {
    const Eigen::Vector3d away = x - q, in_plane = away - normal.dot(away) * normal;
    if (in_plane.norm() <= 0.0) break;
    const Eigen::Vector3d next = x + step * in_plane.normalized();
    const ClosestPoint next_closest = bvh_.closest(next);
    const double next_distance = std::sqrt(next_closest.distance_sq);
    if (distance + step > next_distance + kMaxLag * step) {
      step *= 0.5;
      continue;
    }
    x = next;
    q = next_closest.point;
    distance = next_distance;
  }
  return x;
}

// Searches an opening on the normal through y, by bisection between two points on different sides.
HoleObstacles::OpeningPoint HoleObstacles::opening_across(const Eigen::Vector3d& y,
                                                          const Eigen::Vector3d& normal,
                                                          double distance) const {
  double low = -kOffsets[0] * distance, high = -low;
  bool low_is_outside = is_outside(y + low * normal);
  bool high_is_outside = is_outside(y + high * normal);
  for (std::size_t i = 1; low_is_outside == high_is_outside; ++i) {
    if (i == std::size(kOffsets)) return std::nullopt;
    const double offset = kOffsets[i] * distance;
    if (is_outside(y - offset * normal) != low_is_outside) {
      high = low;
      low = -offset;
      low_is_outside = !low_is_outside;
    } else if (is_outside(y + offset * normal) != high_is_outside) {
      low = high;
      high = offset;
      high_is_outside = !high_is_outside;
    }
  }
  for (int i = 0; i < kCapBisections; ++i) {
    const double middle = 0.5 * (low + high);
    (is_outside(y + middle * normal) == low_is_outside ? low : high) = middle;
  }
  return y + 0.5 * (low + high) * normal;
}

}  // namespace ist
