#include "internal/geometry/ray_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "geometry/mesh_ray.h"
#include "geometry/solid_element.h"

namespace ist {
namespace {

constexpr float kFar = 1e18F;  // [m]

// The points origin + t d with d in a box of directions, as inequalities: in each axis,
// t high >= box.min - origin and t low <= box.max - origin. Each bounds t from one side.
struct Beam {
  struct Bound {
    float reciprocal;  // of the direction
    bool is_lower;     // whether it bounds t from below
  };
  std::array<float, 3> origin;   // [m] from the middle of the mesh
  std::array<Bound, 3> at_high;  // of box.min - origin
  std::array<Bound, 3> at_low;   // of box.max - origin
  float last;
  float margin;  // [m] more than what float rounds off of a coordinate
};

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

// The parameters at which the beam enters the children's boxes; infinite where it misses them.
void enter_boxes(const TriangleBvh::Boxes& boxes, const Beam& beam,
                 float enter[TriangleBvh::kWidth]) {
  float first[TriangleBvh::kWidth], last[TriangleBvh::kWidth];
  for (std::size_t k = 0; k < TriangleBvh::kWidth; ++k) {
    first[k] = 0.0F;
    last[k] = beam.last;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    for (const bool is_min : {true, false}) {
      const Beam::Bound& bound = is_min ? beam.at_high[i] : beam.at_low[i];
      const float* plane = is_min ? boxes.min[i] : boxes.max[i];
      const float shift = beam.origin[i] + (is_min ? beam.margin : -beam.margin);
      float* t = bound.is_lower ? first : last;
      const float sign = bound.is_lower ? 1.0F : -1.0F;
      for (std::size_t k = 0; k < TriangleBvh::kWidth; ++k) {
        const float crossing = sign * (plane[k] - shift) * bound.reciprocal;
        t[k] = sign * std::max(sign * t[k], crossing);
      }
    }
  }
  for (std::size_t k = 0; k < TriangleBvh::kWidth; ++k) {
    const float slack = 1e-6F * (std::abs(first[k]) + std::abs(last[k]));
    enter[k] = first[k] <= last[k] + slack ? std::max(first[k] - slack, 0.0F)
                                           : std::numeric_limits<float>::infinity();
  }
}

// Copies a leaf and its box to a slot; those before it are used.
void copy_child(const TriangleBvh::Boxes& from, std::size_t k, TriangleBvh::Boxes* to,
                std::size_t slot) {
  for (std::size_t i = 0; i < 3; ++i) {
    to->min[i][slot] = from.min[i][k];
    to->max[i][slot] = from.max[i][k];
  }
  to->child[slot] = from.child[k];
  to->count = static_cast<std::int32_t>(slot + 1);
  if (slot != 0) return;
  // The other slots are far away.
  for (std::size_t rest = 1; rest < TriangleBvh::kWidth; ++rest) {
    for (std::size_t i = 0; i < 3; ++i) to->min[i][rest] = to->max[i][rest] = kFar;
  }
}

}  // namespace

std::size_t TriangleBvh::leaves_on_rays(const Eigen::Vector3d& origin_M,
                                        const Eigen::AlignedBox3d& directions_M, double max_t,
                                        Boxes* leaves, std::size_t capacity) const {
  if (triangles_.empty()) return 0;
  const Beam beam =
      beam_of(origin_M - bounds_.center(), directions_M, 0.5 * bounds_.sizes().norm(), max_t);
  struct Entry {
    std::int32_t node;
    float enter;
  };
  Stack<Entry> stack;
  stack.push({0, 0.0F});
  std::size_t count = 0;
  while (!stack.empty()) {
    const Boxes& boxes = boxes_[static_cast<std::size_t>(stack.pop().node)];
    float enter[kWidth];
    enter_boxes(boxes, beam, enter);
    const std::size_t siblings = stack.size();
    for (std::size_t k = 0; k < static_cast<std::size_t>(boxes.count); ++k) {
      if (!std::isfinite(enter[k])) continue;
      if (boxes.child[k] >= 0) {
        stack.push_least_on_top<&Entry::enter>(siblings, {boxes.child[k], enter[k]});
        continue;
      }
      if (count == kWidth * capacity) return count + 1;
      copy_child(boxes, k, leaves + count / kWidth, count % kWidth);
      ++count;
    }
  }
  return count;
}

TriangleBvh::RayCrossing TriangleBvh::first_crossing(const Boxes* leaves, std::size_t count,
                                                     const Eigen::Vector3d& origin_M,
                                                     const Eigen::Vector3d& direction_M,
                                                     double max_t) const {
  // As in the search for one ray, its origin is moved near the mesh, where float is exact enough.
  RayCrossing best;
  const Eigen::Vector3d middle = bounds_.center();
  const double radius = 0.5 * bounds_.sizes().norm();
  const double shift = (middle - origin_M).dot(direction_M) / direction_M.squaredNorm();
  const Eigen::Vector3d o_M = origin_M + shift * direction_M;
  if ((o_M - middle).norm() > radius * (1.0 + 1e-6)) return best;
  const double first = -shift;
  double limit = max_t - shift;
  mesh_ray::FloatRay ray = mesh_ray::float_ray(o_M - middle, direction_M, radius, first, limit);
  for (std::size_t i = 0; i < count; ++i) {
    float enter[kWidth];
    mesh_ray::enter_boxes(leaves[i], ray, enter);
    for (std::size_t k = 0; k < static_cast<std::size_t>(leaves[i].count); ++k) {
      if (enter[k] > ray.last) continue;
      const Leaf& leaf = leaves_[static_cast<std::size_t>(~leaves[i].child[k])];
      const std::uint32_t bits = mesh_ray::crossed(leaf, ray);
      for (std::uint32_t j = 0; bits >> j != 0; ++j) {
        if ((bits >> j & 1U) == 0) continue;
        const double t = mesh_ray::cross_triangle(triangle(leaf.first + j), o_M, direction_M);
        if (!(t >= first && t <= limit)) continue;
        limit = t;
        best = {std::max(t + shift, 0.0), leaf.first + j};
        ray.last = mesh_ray::last_of(t);
      }
    }
  }
  return best;
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
