#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "geometry/solid_element.h"
#include "internal/geometry/ray_cast.h"
#include "internal/geometry/triangle_bvh.h"

namespace ist {

/// The first hit of a ray with one element of a solid.
/// @param o  [m] origin, element frame
/// @param d  direction, of any length but 0
RayHit cast_element(const SolidElement& element, const Eigen::Vector3d& o, const Eigen::Vector3d& d,
                    double max_t);

namespace mesh_ray {

constexpr double kNoCrossing = std::numeric_limits<double>::infinity();

// A ray in float about the middle of a mesh: origin + t direction for t in [first, last].
struct FloatRay {
  std::array<float, 3> origin, direction, reciprocal;
  float first, last;
  float margin;       // [m] more than what float rounds off of a coordinate
  float edge_margin;  // [m^2] the same of an edge function
};

// @param o  [m] the ray's origin from the middle of the mesh, near it
inline FloatRay float_ray(const Eigen::Vector3d& o, const Eigen::Vector3d& d, double radius,
                          double first, double last) {
  constexpr float kLargest = 1e18F;  // a reciprocal of 0 would make 0 times infinity
  FloatRay ray;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    ray.origin[i] = static_cast<float>(o[axis]);
    ray.direction[i] = static_cast<float>(d[axis]);
    const float r = 1.0F / ray.direction[i];
    ray.reciprocal[i] = std::isfinite(r) ? std::clamp(r, -kLargest, kLargest) : kLargest;
  }
  ray.first = static_cast<float>(first) - 1e-6F * static_cast<float>(std::abs(first));
  ray.last = static_cast<float>(last) + 1e-6F * static_cast<float>(std::abs(last));
  const double size = radius + o.norm();
  ray.margin = static_cast<float>(1e-6 * size);
  ray.edge_margin = static_cast<float>(2e-6 * size * size * d.norm());
  return ray;
}

// The parameters at which the ray enters the children's boxes; infinite where it misses them.
inline void enter_boxes(const TriangleBvh::Boxes& boxes, const FloatRay& ray,
                        float enter[TriangleBvh::kWidth]) {
  for (std::size_t k = 0; k < TriangleBvh::kWidth; ++k) {
    float first = ray.first, last = ray.last;
    for (std::size_t i = 0; i < 3; ++i) {
      const float a = (boxes.min[i][k] - ray.margin - ray.origin[i]) * ray.reciprocal[i];
      const float b = (boxes.max[i][k] + ray.margin - ray.origin[i]) * ray.reciprocal[i];
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    const float slack = 1e-6F * (std::abs(first) + std::abs(last));
    enter[k] = first <= last + slack ? first : std::numeric_limits<float>::infinity();
  }
}

// The parameter up to which crossings nearer than one at t may lie.
inline float last_of(double t) {
  return static_cast<float>(t) + 1e-6F * static_cast<float>(std::abs(t)) + 1e-30F;
}

// Bit k: the line of the ray may cross triangle k. The edge functions of a triangle that is crossed
// have one sign.
inline std::uint32_t crossed(const TriangleBvh::Leaf& leaf, const FloatRay& ray) {
  float hit[TriangleBvh::kWidth];
  const float dx = ray.direction[0], dy = ray.direction[1], dz = ray.direction[2];
  for (std::size_t k = 0; k < TriangleBvh::kWidth; ++k) {
    float p[3][3];
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < 3; ++i) p[c][i] = leaf.corner[3 * c + i][k] - ray.origin[i];
    }
    const auto edge = [dx, dy, dz](const float* a, const float* b) {
      return dx * (a[1] * b[2] - a[2] * b[1]) + dy * (a[2] * b[0] - a[0] * b[2]) +
             dz * (a[0] * b[1] - a[1] * b[0]);
    };
    const float ab = edge(p[0], p[1]), bc = edge(p[1], p[2]), ca = edge(p[2], p[0]);
    const float least = std::min(ab, std::min(bc, ca)), most = std::max(ab, std::max(bc, ca));
    hit[k] = std::max(least, -most);
  }
  std::uint32_t bits = 0;
  for (std::uint32_t k = 0; k < leaf.count; ++k) {
    bits |= static_cast<std::uint32_t>(hit[k] >= -ray.edge_margin) << k;
  }
  return bits;
}

// The parameter at which the line crosses the triangle; inf if it does not. Neighbours see the same
// number for the edge that they share, with the opposite sign. Through a corner, where rounding
// alone decides, a line crosses all triangles about it; so no line passes between neighbours.
inline double cross_triangle(const TriangleBvh::Triangle& triangle, const Eigen::Vector3d& o,
                             const Eigen::Vector3d& d) {
  const Eigen::Vector3d a = triangle.a - o, b = triangle.b - o, c = triangle.c - o;
  const double ab = d.dot(a.cross(b)), bc = d.dot(b.cross(c)), ca = d.dot(c.cross(a));
  const double size_sq = std::max({a.squaredNorm(), b.squaredNorm(), c.squaredNorm()});
  const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * d.norm() * size_sq;
  const double least = std::min({ab, bc, ca}), most = std::max({ab, bc, ca});
  if (least < -rounding && most > rounding) return kNoCrossing;
  const Eigen::Vector3d n = (b - a).cross(c - a);
  const double along = n.dot(d);
  return along == 0.0 ? kNoCrossing : n.dot(a) / along;
}

}  // namespace mesh_ray
}  // namespace ist
