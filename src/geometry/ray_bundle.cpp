#include "internal/geometry/ray_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "geometry/mesh_ray.h"
#include "geometry/ray_kernels.h"
#include "geometry/solid_element.h"

namespace ist {
namespace {

// 1 / d, with the sign of d, finite.
float reciprocal_of(float d) {
  constexpr float kSmallest = 1e-18F;
  return 1.0F / (d < 0.0F ? std::min(d, -kSmallest) : std::max(d, kSmallest));
}

// @param o  [m] the rays' origin from the middle of the mesh
Beam beam_of(const Eigen::Vector3d& o, const Eigen::AlignedBox3d& directions, double radius,
             double last) {
  constexpr double kRounding = 1e-6;
  Beam beam;
  const double length =
      std::max(directions.min().cwiseAbs().maxCoeff(), directions.max().cwiseAbs().maxCoeff());
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    beam.origin[i] = static_cast<float>(o[axis]);
    const auto low = static_cast<float>(directions.min()[axis] - kRounding * length);
    const auto high = static_cast<float>(directions.max()[axis] + kRounding * length);
    beam.at_high[i] = {reciprocal_of(high), high >= 0.0F};
    beam.at_low[i] = {reciprocal_of(low), low < 0.0F};
  }
  constexpr double kLargest = 1e18;
  beam.last = static_cast<float>(std::min(last * (1.0 + kRounding), kLargest));
  beam.margin = static_cast<float>(kRounding * (radius + o.norm()));
  return beam;
}

}  // namespace

std::size_t TriangleBvh::leaves_on_rays(const Eigen::Vector3d& origin_M,
                                        const Eigen::AlignedBox3d& directions_M, double max_t,
                                        Boxes* leaves, std::size_t capacity) const {
  if (triangles_.empty()) return 0;
  const Beam beam =
      beam_of(origin_M - bounds_.center(), directions_M, 0.5 * bounds_.sizes().norm(), max_t);
  return find_leaves(view(), beam, leaves, capacity);
}

TriangleBvh::RayCrossing TriangleBvh::first_crossing(const Boxes* leaves, std::size_t count,
                                                     const Eigen::Vector3d& origin_M,
                                                     const Eigen::Vector3d& direction_M,
                                                     double max_t) const {
  // The origin is moved near the mesh, where float is exact enough, as in the search for one ray.
  const Eigen::Vector3d middle = bounds_.center();
  const double radius = 0.5 * bounds_.sizes().norm();
  const double shift = (middle - origin_M).dot(direction_M) / direction_M.squaredNorm();
  const Eigen::Vector3d o_M = origin_M + shift * direction_M;
  if ((o_M - middle).norm() > radius * (1.0 + 1e-6)) return {};
  const double first = -shift, last = max_t - shift;
  const mesh_ray::FloatRay ray =
      mesh_ray::float_ray(o_M - middle, direction_M, radius, first, last);
  RayCrossing crossing = find_crossing(view(), leaves, count, ray, o_M, direction_M, first, last);
  if (std::isfinite(crossing.t)) crossing.t = std::max(crossing.t + shift, 0.0);
  return crossing;
}

void RayBundle::begin(const Solid& solid, const Eigen::Vector3d& origin_L,
                      const Eigen::AlignedBox3d& directions_L, double max_t) {
  solid_ = &solid;
  origin_L_ = origin_L;
  part_count_ = leaf_count_ = 0;
  const std::size_t elements = elements_of(solid).size();
  is_whole_ = elements > kMostParts;
  if (is_whole_) {
    part_count_ = 1;
    return;
  }
  for (std::size_t i = 0; i < elements; ++i) add_element(i, origin_L, directions_L, max_t);
}

void RayBundle::add_element(std::size_t index, const Eigen::Vector3d& origin_L,
                            const Eigen::AlignedBox3d& directions_L, double max_t) {
  const SolidElement& element = elements_of(*solid_)[index];
  Part part{index, leaf_count_, leaf_count_};
  if (element.is_mesh()) {
    // The box of the directions is turned into the element's frame.
    const Eigen::Matrix3d R_EL = element.X_EL.linear();
    const Eigen::Vector3d middle = R_EL * directions_L.center(),
                          half = R_EL.cwiseAbs() * (0.5 * directions_L.sizes());
    const std::size_t room = kMostLeaves - leaf_count_;
    const std::size_t found = element.bvh.leaves_on_rays(
        element.X_EL * origin_L, Eigen::AlignedBox3d(middle - half, middle + half), max_t,
        leaves_.data() + leaf_count_, room);
    if (found == 0) return;
    if (found <= TriangleBvh::kWidth * room) {
      part.last = leaf_count_ += (found + TriangleBvh::kWidth - 1) / TriangleBvh::kWidth;
    }
  }
  parts_[part_count_++] = part;
}

RayHit RayBundle::cast(const Eigen::Vector3d& direction_L, double max_t) const {
  if (is_whole_) return ray_cast(*solid_, origin_L_, direction_L, max_t);
  RayHit best;
  double limit = max_t;
  for (std::size_t i = 0; i < part_count_; ++i) {
    const Part& part = parts_[i];
    const SolidElement& element = elements_of(*solid_)[part.element];
    const Eigen::Vector3d o = element.X_EL * origin_L_, d = element.X_EL.linear() * direction_L;
    RayHit hit;
    if (part.first == part.last) {
      hit = cast_element(element, o, d, limit);
    } else {
      const TriangleBvh::RayCrossing crossing = element.bvh.first_crossing(
          leaves_.data() + part.first, part.last - part.first, o, d, limit);
      hit.t = crossing.t;
      if (std::isfinite(crossing.t)) hit.normal = element.bvh.triangle(crossing.slot).normal();
    }
    if (!(hit.t <= limit) || !std::isfinite(hit.t)) continue;
    limit = hit.t;
    best.t = hit.t;
    best.normal = element.X_LE.linear() * hit.normal;
  }
  if (best.normal.dot(direction_L) > 0.0) best.normal = -best.normal;
  return best;
}

}  // namespace ist
