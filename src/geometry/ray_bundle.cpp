#include "internal/geometry/ray_bundle.h"

#include <algorithm>
#include <array>
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

// A ray of a packet with its origin moved near the mesh, where a test in double is most exact.
struct NearRay {
  Eigen::Vector3d o_M;
  double shift;  // of the parameter
  bool misses;   // the sphere about the mesh
};
NearRay near_ray(const Eigen::AlignedBox3d& bounds, double radius, const Eigen::Vector3d& origin_M,
                 const Eigen::Vector3d& d_M) {
  const Eigen::Vector3d middle = bounds.center();
  NearRay ray;
  ray.shift = (middle - origin_M).dot(d_M) / d_M.squaredNorm();
  ray.o_M = origin_M + ray.shift * d_M;
  ray.misses = (ray.o_M - middle).norm() > radius * (1.0 + 1e-6);
  return ray;
}

// @param o  [m] the rays' origin from the middle of the mesh
RayPacket packet_of(const Eigen::Vector3d& o, const TriangleBvh::Directions& directions,
                    std::uint32_t rays, const std::array<double, 16>& max_t, double radius) {
  constexpr double kRounding = 1e-6;
  constexpr double kLargest = 1e18;
  RayPacket packet;
  packet.rays = rays;
  // The reference point is where one of the rays is nearest to the middle of the mesh.
  std::size_t first = 0;
  while ((rays >> first & 1U) == 0) ++first;
  const Eigen::Vector3d d = directions.col(static_cast<Eigen::Index>(first));
  const double t = -o.dot(d) / d.squaredNorm();
  const Eigen::Vector3d reference = o + t * d;
  double longest_sq = 0.0, apart_sq = 0.0;
  for (std::size_t k = 0; k < RayPacket::kRays; ++k) {
    const bool is_used = (rays >> k & 1U) != 0;
    const Eigen::Vector3d d_k = is_used ? directions.col(static_cast<Eigen::Index>(k)) : d;
    const Eigen::Vector3d c = t * (d_k - d), moment = c.cross(d_k);
    longest_sq = std::max(longest_sq, d_k.squaredNorm());
    apart_sq = std::max(apart_sq, c.squaredNorm());
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      packet.direction[i][k] = static_cast<float>(d_k[axis]);
      packet.reciprocal[i][k] = reciprocal_of(packet.direction[i][k]);
      packet.moment[i][k] = static_cast<float>(moment[axis]);
    }
    packet.last[k] =
        is_used ? static_cast<float>(std::min(max_t[k] * (1.0 + kRounding), kLargest)) : 0.0F;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    packet.origin[i] = static_cast<float>(o[axis]);
    packet.reference[i] = static_cast<float>(reference[axis]);
  }
  packet.margin = static_cast<float>(kRounding * (radius + o.norm()));
  // An edge function sums products of coordinates and directions: float rounds off less than forty
  // times 2^-24 of the largest.
  constexpr double kBesideEdge = 4e-6;
  const double size = radius + reference.norm() + std::sqrt(apart_sq);
  packet.edge_margin = static_cast<float>(kBesideEdge * size * size * std::sqrt(longest_sq));
  return packet;
}

}  // namespace

std::size_t TriangleBvh::leaves_on_rays(const Eigen::Vector3d& origin_M,
                                        const Eigen::AlignedBox3d& directions_M, double max_t,
                                        RayLeaf* leaves, std::size_t capacity) const {
  if (triangles_.empty()) return 0;
  const Beam beam =
      beam_of(origin_M - bounds_.center(), directions_M, 0.5 * bounds_.sizes().norm(), max_t);
  return find_leaves(view(), beam, leaves, capacity);
}

void TriangleBvh::first_crossings(const RayLeaf* leaves, std::size_t count,
                                  const Eigen::Vector3d& origin_M, const Directions& directions_M,
                                  std::uint32_t rays, const std::array<double, 16>& max_t,
                                  std::array<RayCrossing, 16>* crossings) const {
  static_assert(RayPacket::kRays == 16);
  if (rays == 0) return;
  const double radius = 0.5 * bounds_.sizes().norm();
  RayPacket packet = packet_of(origin_M - bounds_.center(), directions_M, rays, max_t, radius);
  std::array<NearRay, RayPacket::kRays> near;
  std::uint32_t known = 0;
  for (RayCrossing& crossing : *crossings) crossing = {};
  std::array<RayCandidate, kCandidates> candidates;
  for (std::size_t leaf = 0; leaf < count;) {
    const std::size_t found =
        find_candidates(view(), leaves, count, packet, &leaf, candidates.data());
    for (std::size_t i = 0; i < found; ++i) {
      const auto [k, slot] = candidates[i];
      const Eigen::Vector3d d_M = directions_M.col(static_cast<Eigen::Index>(k));
      NearRay& ray = near[k];
      if ((known >> k & 1U) == 0) ray = near_ray(bounds_, radius, origin_M, d_M);
      known |= 1U << k;
      if (ray.misses) continue;
      const double t = mesh_ray::cross_triangle(triangles_[slot], ray.o_M, d_M);
      RayCrossing& best = (*crossings)[k];
      if (!(t >= -ray.shift && t <= std::min(best.t, max_t[k] - ray.shift))) continue;
      best = {t, slot};
      packet.last[k] = mesh_ray::last_of(std::max(t + ray.shift, 0.0));
    }
  }
  for (std::size_t k = 0; k < RayPacket::kRays; ++k) {
    RayCrossing& best = (*crossings)[k];
    if (std::isfinite(best.t)) best.t = std::max(best.t + near[k].shift, 0.0);
  }
}

void RayBundle::begin(const Solid& solid, const Eigen::Vector3d& origin_L,
                      const Directions& directions_L, std::uint32_t rays, double max_t) {
  solid_ = &solid;
  origin_L_ = origin_L;
  directions_L_ = directions_L;
  part_count_ = leaf_count_ = 0;
  const std::size_t elements = elements_of(solid).size();
  is_whole_ = elements > kMostParts;
  if (is_whole_) {
    part_count_ = 1;
    return;
  }
  Eigen::AlignedBox3d box;
  for (std::size_t k = 0; k < kRays; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    const Eigen::Vector3d d_L = directions_L.col(static_cast<Eigen::Index>(k));
    box.extend(d_L);
  }
  for (std::size_t i = 0; i < elements; ++i) add_element(i, box, max_t);
}

void RayBundle::add_element(std::size_t index, const Eigen::AlignedBox3d& directions_L,
                            double max_t) {
  const SolidElement& element = elements_of(*solid_)[index];
  Part part{index, leaf_count_, leaf_count_};
  if (element.is_mesh()) {
    // The box of the directions is turned into the element's frame.
    const Eigen::Matrix3d R_EL = element.X_EL.linear();
    const Eigen::Vector3d middle = R_EL * directions_L.center(),
                          half = R_EL.cwiseAbs() * (0.5 * directions_L.sizes());
    const std::size_t room = kMostLeaves - leaf_count_;
    const std::size_t found = element.bvh.leaves_on_rays(
        element.X_EL * origin_L_, Eigen::AlignedBox3d(middle - half, middle + half), max_t,
        leaves_.data() + leaf_count_, room);
    if (found == 0) return;
    if (found <= room) part.last = leaf_count_ += found;
  }
  parts_[part_count_++] = part;
}

// Casts rays against one element. @param limit  by ray: hits beyond are not found
void RayBundle::cast_part(const Part& part, std::uint32_t rays,
                          const std::array<double, kRays>& limit,
                          std::array<RayHit, kRays>* hits) const {
  const SolidElement& element = elements_of(*solid_)[part.element];
  const Eigen::Vector3d o = element.X_EL * origin_L_;
  Directions directions_E;
  for (std::size_t k = 0; k < kRays; ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    if ((rays >> k & 1U) == 0) continue;
    directions_E.col(column) = element.X_EL.linear() * directions_L_.col(column);
    if (part.first != part.last) continue;
    const Eigen::Vector3d d = directions_E.col(column);
    (*hits)[k] = cast_element(element, o, d, limit[k]);
  }
  if (part.first == part.last) return;
  std::array<TriangleBvh::RayCrossing, kRays> crossings;
  element.bvh.first_crossings(leaves_.data() + part.first, part.last - part.first, o, directions_E,
                              rays, limit, &crossings);
  for (std::size_t k = 0; k < kRays; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    const TriangleBvh::RayCrossing& crossing = crossings[k];
    (*hits)[k].t = crossing.t;
    if (std::isfinite(crossing.t)) (*hits)[k].normal = element.bvh.triangle(crossing.slot).normal();
  }
}

void RayBundle::cast(std::uint32_t rays, const std::array<double, kRays>& max_t,
                     std::array<RayHit, kRays>* hits) const {
  std::array<double, kRays> limit = max_t;
  std::array<RayHit, kRays> found;
  for (std::size_t k = 0; k < kRays; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    const Eigen::Vector3d d_L = directions_L_.col(static_cast<Eigen::Index>(k));
    (*hits)[k] = is_whole_ ? ray_cast(*solid_, origin_L_, d_L, max_t[k]) : RayHit();
  }
  if (is_whole_) return;
  for (std::size_t i = 0; i < part_count_; ++i) {
    cast_part(parts_[i], rays, limit, &found);
    const SolidElement& element = elements_of(*solid_)[parts_[i].element];
    for (std::size_t k = 0; k < kRays; ++k) {
      if ((rays >> k & 1U) == 0) continue;
      if (!(found[k].t <= limit[k]) || !std::isfinite(found[k].t)) continue;
      limit[k] = found[k].t;
      (*hits)[k] = {found[k].t, element.X_LE.linear() * found[k].normal};
    }
  }
  for (std::size_t k = 0; k < kRays; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    RayHit& hit = (*hits)[k];
    if (hit.normal.dot(directions_L_.col(static_cast<Eigen::Index>(k))) > 0.0) {
      hit.normal = -hit.normal;
    }
  }
}

}  // namespace ist
