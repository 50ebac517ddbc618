#include "internal/geometry/ray_cast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "geometry/mesh_ray.h"
#include "geometry/solid_element.h"
#include "internal/geometry/solid_queries.h"
#include "internal/geometry/triangle_bvh.h"

namespace ist {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

RayHit cast_sphere(const Sphere& sphere, const Eigen::Vector3d& o, const Eigen::Vector3d& d,
                   double max_t) {
  const double a = d.squaredNorm(), b = o.dot(d);
  const double middle = -b / a;
  const double gap_sq = sphere.radius * sphere.radius - (o + middle * d).squaredNorm();
  if (gap_sq < 0.0) return {};
  const double half = std::sqrt(gap_sq / a);
  const double t = middle - half >= 0.0 ? middle - half : middle + half;
  if (!(t >= 0.0 && t <= max_t)) return {};
  return {t, (o + t * d) / sphere.radius};
}

// The part of a ray between two planes perpendicular to an axis.
struct Slab {
  double first, last;
};
Slab cast_slab(double o, double d, double half) {
  if (d == 0.0) return std::abs(o) <= half ? Slab{-kNone, kNone} : Slab{kNone, -kNone};
  const double a = (-half - o) / d, b = (half - o) / d;
  return {std::min(a, b), std::max(a, b)};
}

RayHit cast_box(const Box& box, const Eigen::Vector3d& o, const Eigen::Vector3d& d, double max_t) {
  double first = -kNone, last = kNone;
  int first_axis = 0, last_axis = 0;
  for (int i = 0; i < 3; ++i) {
    const Slab slab = cast_slab(o[i], d[i], 0.5 * box.size[i]);
    if (slab.first > first) first = slab.first, first_axis = i;
    if (slab.last < last) last = slab.last, last_axis = i;
  }
  if (first > last) return {};
  const double t = first >= 0.0 ? first : last;
  if (!(t >= 0.0 && t <= max_t)) return {};
  const int axis = first >= 0.0 ? first_axis : last_axis;
  return {t, Eigen::Vector3d::Unit(axis)};
}

RayHit cast_cylinder(const Cylinder& cylinder, const Eigen::Vector3d& o, const Eigen::Vector3d& d,
                     double max_t) {
  const Slab caps = cast_slab(o.z(), d.z(), 0.5 * cylinder.length);
  Slab side{-kNone, kNone};
  const double a = d.head<2>().squaredNorm();
  if (a > 0.0) {
    const double middle = -o.head<2>().dot(d.head<2>()) / a;
    const double gap_sq =
        cylinder.radius * cylinder.radius - (o + middle * d).head<2>().squaredNorm();
    if (gap_sq < 0.0) return {};
    const double half = std::sqrt(gap_sq / a);
    side = {middle - half, middle + half};
  } else if (o.head<2>().norm() > cylinder.radius) {
    return {};
  }
  const double first = std::max(caps.first, side.first), last = std::min(caps.last, side.last);
  if (first > last) return {};
  const double t = first >= 0.0 ? first : last;
  if (!(t >= 0.0 && t <= max_t)) return {};
  const bool on_cap = first >= 0.0 ? caps.first >= side.first : caps.last <= side.last;
  if (on_cap) return {t, Eigen::Vector3d::UnitZ()};
  const Eigen::Vector3d p = o + t * d;
  return {t, Eigen::Vector3d(p.x(), p.y(), 0.0).normalized()};
}

RayHit cast_mesh(const TriangleBvh& bvh, const Eigen::Vector3d& o, const Eigen::Vector3d& d,
                 double max_t) {
  const TriangleBvh::RayCrossing crossing = bvh.first_crossing(o, d, max_t);
  if (!std::isfinite(crossing.t)) return {};
  return {crossing.t, bvh.triangle(crossing.slot).normal()};
}

}  // namespace

RayHit cast_element(const SolidElement& element, const Eigen::Vector3d& o, const Eigen::Vector3d& d,
                    double max_t) {
  if (element.is_mesh()) return cast_mesh(element.bvh, o, d, max_t);
  if (const auto* box = std::get_if<Box>(&element.primitive)) return cast_box(*box, o, d, max_t);
  if (const auto* sphere = std::get_if<Sphere>(&element.primitive)) {
    return cast_sphere(*sphere, o, d, max_t);
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&element.primitive)) {
    return cast_cylinder(*cylinder, o, d, max_t);
  }
  return {};
}

namespace {

// A ray whose origin is its nearest point to the middle of a mesh, where float is exact enough
// however far the sensor is.
struct CenteredRay {
  Eigen::Vector3d o_M;
  double shift = 0.0;               // from the given origin, in lengths of the direction
  double first = 0.0, last = -1.0;  // what is looked at; first > last: the ray misses the mesh
};

CenteredRay centered_ray(const Eigen::AlignedBox3d& bounds, const Eigen::Vector3d& origin_M,
                         const Eigen::Vector3d& direction_M, double max_t) {
  const Eigen::Vector3d middle = bounds.center();
  const double radius = 0.5 * bounds.sizes().norm();
  CenteredRay ray;
  ray.shift = (middle - origin_M).dot(direction_M) / direction_M.squaredNorm();
  ray.o_M = origin_M + ray.shift * direction_M;
  if ((ray.o_M - middle).norm() > radius * (1.0 + 1e-6)) return ray;
  const double span = 1.001 * radius / direction_M.norm();
  ray.first = std::max(-ray.shift, -span);
  ray.last = std::min(max_t - ray.shift, span);
  return ray;
}

}  // namespace

TriangleBvh::RayCrossing TriangleBvh::first_crossing(const Eigen::Vector3d& origin_M,
                                                     const Eigen::Vector3d& direction_M,
                                                     double max_t) const {
  RayCrossing best;
  if (triangles_.empty()) return best;
  const auto [o_M, shift, first, last] = centered_ray(bounds_, origin_M, direction_M, max_t);
  if (first > last) return best;
  mesh_ray::FloatRay ray = mesh_ray::float_ray(o_M - bounds_.center(), direction_M,
                                               0.5 * bounds_.sizes().norm(), first, last);
  double limit = last;

  struct Entry {
    std::int32_t child;
    float enter;
  };
  Stack<Entry> stack;
  stack.push({0, ray.first});
  while (!stack.empty()) {
    const Entry entry = stack.pop();
    if (entry.enter > ray.last) continue;
    if (entry.child < 0) {
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~entry.child)];
      const std::uint32_t bits = mesh_ray::crossed(leaf, ray);
      for (std::uint32_t k = 0; bits >> k != 0; ++k) {
        if ((bits >> k & 1U) == 0) continue;
        const double t = mesh_ray::cross_triangle(triangles_[leaf.first + k], o_M, direction_M);
        if (!(t >= first && t <= limit)) continue;
        limit = t;
        best = {t + shift, leaf.first + k};
        ray.last = mesh_ray::last_of(t);
      }
      continue;
    }
    const Boxes& boxes = boxes_[static_cast<std::size_t>(entry.child)];
    float enter[kWidth];
    mesh_ray::enter_boxes(boxes, ray, enter);
    const std::size_t siblings = stack.size();
    for (std::size_t k = 0; k < static_cast<std::size_t>(boxes.count); ++k) {
      if (std::isfinite(enter[k])) {
        stack.push_least_on_top<&Entry::enter>(siblings, {boxes.child[k], enter[k]});
      }
    }
  }
  if (std::isfinite(best.t)) best.t = std::max(best.t, 0.0);
  return best;
}

RayHit ray_cast(const Solid& solid, const Eigen::Vector3d& origin_L,
                const Eigen::Vector3d& direction_L, double max_t) {
  RayHit best;
  double limit = max_t;
  for (const SolidElement& element : elements_of(solid)) {
    RayHit hit =
        cast_element(element, element.X_EL * origin_L, element.X_EL.linear() * direction_L, limit);
    if (!(hit.t <= limit)) continue;
    if (!std::isfinite(hit.t)) continue;
    limit = hit.t;
    best.t = hit.t;
    best.normal = element.X_LE.linear() * hit.normal;
  }
  if (best.normal.dot(direction_L) > 0.0) best.normal = -best.normal;
  return best;
}

RayApproach nearest_approach(const Solid& solid, const Eigen::Vector3d& origin_L,
                             const Eigen::Vector3d& direction_L, double t, double max_distance) {
  // The distance has the derivative n.d along the ray. Its zero is found by the secant rule: for a
  // sphere it is nearly linear, so that three steps are enough.
  constexpr int kSteps = 4;
  constexpr double kFlat = 0.01;  // no slope: the ray is as near as it comes
  const double length = direction_L.norm();
  RayApproach best;
  double last_t = t, last_slope = 0.0, limit = max_distance;
  for (int step = 0; step < kSteps; ++step) {
    const SignedDistance at = distance_outside(solid, origin_L + t * direction_L, limit);
    if (!std::isfinite(at.distance)) break;
    if (at.distance < best.distance) best = {at.distance, t};
    const double slope = at.normal.dot(direction_L) / length;
    if (std::abs(slope) < kFlat) break;
    const double change = slope - last_slope;
    const bool has_secant = step > 0 && std::abs(change) > 1e-3 * std::abs(slope);
    const double secant = has_secant ? (t - last_t) / change : max_distance / length;
    const double reach = 2.0 * max_distance / length;
    last_t = t;
    last_slope = slope;
    t = std::max(t - std::clamp(slope * secant, -reach, reach), 0.0);
    limit = 3.0 * max_distance;
  }
  return best;
}

}  // namespace ist
