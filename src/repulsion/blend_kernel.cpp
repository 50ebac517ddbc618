// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "repulsion/blend_kernel.cpp"
#include "repulsion/blend_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "repulsion/pair_sums-inl.h"
#include "repulsion/posed_groups-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace blend {

template <class Index>
HWY_INLINE float NearestPair(const Index& index, const PosedSpheres& spheres, float limit,
                             Deadline* deadline) {
  PosedLink link;
  Pose(spheres, &link);
  VisitTiles(index, link, limit, deadline, [&](const auto& tile, std::uint32_t groups) {
    for (; groups != 0; groups &= groups - 1) {
      const PosedGroup& group = link.groups[hwy::Num0BitsBelowLS1Bit_Nonzero32(groups)];
      limit = std::min(limit, Nearest(tile, 0, tile.count, group));
    }
  });
  return limit;
}

// The nearest points of a group's spheres.
HWY_INLINE void KeepNearest(const ThinnedTile& tile, const PosedGroup& group, std::size_t g,
                            NearestPoints* points) {
  const Tag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const std::size_t slot = g * kWidth + k;
    const V radius = hn::Load(d, group.radius + k);
    V nearest = hn::Load(d, points->distance + slot);
    V x = hn::Load(d, points->offset[0] + slot), y = hn::Load(d, points->offset[1] + slot),
      z = hn::Load(d, points->offset[2] + slot);
    for (int i = 0; i < tile.count; ++i) {
      const Offset o = ToSpheres(tile, i, group, k);
      const V distance = hn::Sub(hn::Sqrt(SquaredNorm(o)), radius);
      const auto is_nearer = hn::Lt(distance, nearest);
      nearest = hn::Min(distance, nearest);
      x = hn::IfThenElse(is_nearer, o.x, x);
      y = hn::IfThenElse(is_nearer, o.y, y);
      z = hn::IfThenElse(is_nearer, o.z, z);
    }
    hn::Store(nearest, d, points->distance + slot);
    hn::Store(x, d, points->offset[0] + slot);
    hn::Store(y, d, points->offset[1] + slot);
    hn::Store(z, d, points->offset[2] + slot);
  }
}

// [m] The least distance of a group's nearest points.
HWY_INLINE float Least(const NearestPoints& points, std::size_t g) {
  const Tag d;
  V least = hn::Set(d, kFarAway);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    least = hn::Min(least, hn::Load(d, points.distance + g * kWidth + k));
  }
  return hn::GetLane(hn::MinOfLanes(d, least));
}

HWY_INLINE float NearestBySphere(const ThinnedCloud& cloud, const PosedSpheres& spheres,
                                 float limit, Deadline* deadline, float slack,
                                 NearestPoints* points) {
  PosedLink link;
  Pose(spheres, &link);
  std::fill_n(points->distance, kCoarseSpheres, kFarAway);
  std::fill_n(&points->offset[0][0], 3 * kCoarseSpheres, 0.0F);
  float nearest = limit, within = limit + slack;
  VisitTiles(cloud, link, within, deadline, [&](const ThinnedTile& tile, std::uint32_t groups) {
    for (; groups != 0; groups &= groups - 1) {
      const std::size_t g = hwy::Num0BitsBelowLS1Bit_Nonzero32(groups);
      KeepNearest(tile, link.groups[g], g, points);
      nearest = std::min(nearest, Least(*points, g));
      within = nearest + slack;
    }
  });
  return nearest;
}

template <class Index>
HWY_INLINE PairSums BlendPairs(const Index& index, const PosedSpheres& spheres, const Band& band,
                               Deadline* deadline, SphereSums* by_sphere) {
  if (by_sphere != nullptr) *by_sphere = {};
  PosedLink link;
  Pose(spheres, &link);
  std::array<GroupSums, kMaxGroups> sums;
  const float limit = band.nearest + band.smoothing;
  VisitTiles(index, link, limit, deadline, [&](const auto& tile, std::uint32_t groups) {
    for (; groups != 0; groups &= groups - 1) {
      const std::size_t g = hwy::Num0BitsBelowLS1Bit_Nonzero32(groups);
      Add(tile, link.groups[g], g, band, &sums[g], by_sphere);
    }
  });
  PairSums total;
  for (std::size_t g = 0; g < link.count; ++g) total.add(Total(sums[g], link.groups[g]));
  for (std::size_t g = 0; by_sphere != nullptr && g < link.count; ++g) {
    std::copy_n(sums[g].x, kWidth, by_sphere->force[0] + g * kWidth);
    std::copy_n(sums[g].y, kWidth, by_sphere->force[1] + g * kWidth);
    std::copy_n(sums[g].z, kWidth, by_sphere->force[2] + g * kWidth);
    std::copy_n(sums[g].weight, kWidth, by_sphere->weight + g * kWidth);
  }
  return total;
}

}  // namespace blend

// HWY_EXPORT asks for these here.
float NearestPointPair(const ThinnedCloud& cloud, const PosedSpheres& spheres, float limit,
                       Deadline* deadline, float slack, NearestPoints* points) {
  if (points != nullptr) {
    return blend::NearestBySphere(cloud, spheres, limit, deadline, slack, points);
  }
  return blend::NearestPair(cloud, spheres, limit, deadline);
}
float NearestBoxPair(const BoxBvh& index, const PosedSpheres& spheres, float limit,
                     Deadline* deadline) {
  return blend::NearestPair(index, spheres, limit, deadline);
}
PairSums BlendPointPairs(const ThinnedCloud& cloud, const PosedSpheres& spheres, const Band& band,
                         Deadline* deadline, SphereSums* by_sphere) {
  return blend::BlendPairs(cloud, spheres, band, deadline, by_sphere);
}
PairSums BlendBoxPairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band,
                       Deadline* deadline, SphereSums* by_sphere) {
  return blend::BlendPairs(index, spheres, band, deadline, by_sphere);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(NearestPointPair);
HWY_EXPORT(NearestBoxPair);
HWY_EXPORT(BlendPointPairs);
HWY_EXPORT(BlendBoxPairs);

void PairSums::add(const PairSums& other) {
  weight += other.weight;
  undirected += other.undirected;
  for (int i = 0; i < 3; ++i) {
    force[i] += other.force[i];
    torque[i] += other.torque[i];
    undirected_arm[i] += other.undirected_arm[i];
  }
}

float nearest_pair(const ThinnedCloud& cloud, const PosedSpheres& spheres, float limit,
                   Deadline* deadline, float slack, NearestPoints* points) {
  if (cloud.empty()) return limit;
  return HWY_DYNAMIC_DISPATCH(NearestPointPair)(cloud, spheres, limit, deadline, slack, points);
}

float nearest_pair(const BoxBvh& index, const PosedSpheres& spheres, float limit,
                   Deadline* deadline) {
  if (index.empty()) return limit;
  return HWY_DYNAMIC_DISPATCH(NearestBoxPair)(index, spheres, limit, deadline);
}

PairSums blend_pairs(const ThinnedCloud& cloud, const PosedSpheres& spheres, const Band& band,
                     Deadline* deadline, SphereSums* by_sphere) {
  if (cloud.empty()) return {};
  return HWY_DYNAMIC_DISPATCH(BlendPointPairs)(cloud, spheres, band, deadline, by_sphere);
}

PairSums blend_pairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band,
                     Deadline* deadline, SphereSums* by_sphere) {
  if (index.empty()) return {};
  return HWY_DYNAMIC_DISPATCH(BlendBoxPairs)(index, spheres, band, deadline, by_sphere);
}

}  // namespace ist
#endif
