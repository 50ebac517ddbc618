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

// The weight of each point: how much of its cell a surface through it covers.
HWY_INLINE void CellWeights(const ThinnedTile& tile, float* weights) {
  const Tag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    // Squared distance to the centre over that of a corner, 3/4.
    const V part = hn::Mul(hn::Load(d, tile.offset_sq + k), hn::Set(d, 1.0F / kCornerSquared));
    const V section = hn::Max(hn::Sub(hn::Set(d, 1.0F), part), hn::Zero(d));
    const V weight = hn::MulAdd(hn::Mul(section, section), hn::Set(d, 1.0F - kLeastCellWeight),
                                hn::Set(d, kLeastCellWeight));
    hn::Store(weight, d, weights + k);
  }
}

// The sums of each sphere of a group.
struct SphereSums {
  alignas(64) float x[kWidth] = {}, y[kWidth] = {}, z[kWidth] = {};
  alignas(64) float weight[kWidth] = {}, undirected[kWidth] = {};
};

// weights: by point, or box.
template <class Tile>
HWY_INLINE void AddTile(const Tile& tile, const float* weights, const PosedGroup& group,
                        float nearest, float per_smoothing, SphereSums* sums) {
  const Tag d;
  // A shorter offset has no direction but noise; its weight moves over to the fallback smoothly.
  constexpr float kTiny = 1e-6F;  // [m]
  const V one = hn::Set(d, 1.0F), slope = hn::Set(d, per_smoothing);
  const V tiny_sq = hn::Set(d, kTiny * kTiny), per_tiny_sq = hn::Set(d, 1.0F / (kTiny * kTiny));
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    V x = hn::Load(d, sums->x + k), y = hn::Load(d, sums->y + k), z = hn::Load(d, sums->z + k);
    V weight = hn::Load(d, sums->weight + k), undirected = hn::Load(d, sums->undirected + k);
    // 1 - (d - nearest) / smoothing = start - length / smoothing.
    const V start =
        hn::MulAdd(hn::Add(hn::Load(d, group.radius + k), hn::Set(d, nearest)), slope, one);
    for (int i = 0; i < tile.count; ++i) {
      const Offset o = ToSpheres(tile, i, group, k);
      const V raw = SquaredNorm(o), squared = hn::Max(raw, tiny_sq);
      const V inverse = InverseRoot(squared);
      const V length = hn::Mul(squared, inverse);
      const V root = hn::Max(hn::NegMulAdd(length, slope, start), hn::Zero(d));
      const V w = hn::Mul(hn::Mul(root, root), hn::Set(d, weights[i]));
      const V directed = hn::Mul(w, inverse);
      x = hn::MulAdd(directed, o.x, x);
      y = hn::MulAdd(directed, o.y, y);
      z = hn::MulAdd(directed, o.z, z);
      weight = hn::Add(weight, w);
      const V undefined = hn::Max(hn::NegMulAdd(raw, per_tiny_sq, one), hn::Zero(d));
      undirected = hn::MulAdd(w, undefined, undirected);
    }
    hn::Store(x, d, sums->x + k);
    hn::Store(y, d, sums->y + k);
    hn::Store(z, d, sums->z + k);
    hn::Store(weight, d, sums->weight + k);
    hn::Store(undirected, d, sums->undirected + k);
  }
}

HWY_INLINE float Sum(V v) { return hn::GetLane(hn::SumOfLanes(Tag(), v)); }

HWY_INLINE PairSums Total(const SphereSums& sums, const PosedGroup& group) {
  const Tag d;
  PairSums total;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const V x = hn::Load(d, sums.x + k), y = hn::Load(d, sums.y + k), z = hn::Load(d, sums.z + k);
    const V ax = hn::Load(d, group.arm_x + k), ay = hn::Load(d, group.arm_y + k),
            az = hn::Load(d, group.arm_z + k);
    const V undirected = hn::Load(d, sums.undirected + k);
    total.weight += Sum(hn::Load(d, sums.weight + k));
    total.force[0] += Sum(x);
    total.force[1] += Sum(y);
    total.force[2] += Sum(z);
    total.torque[0] += Sum(hn::NegMulAdd(az, y, hn::Mul(ay, z)));
    total.torque[1] += Sum(hn::NegMulAdd(ax, z, hn::Mul(az, x)));
    total.torque[2] += Sum(hn::NegMulAdd(ay, x, hn::Mul(ax, y)));
    total.undirected += Sum(undirected);
    total.undirected_arm[0] += Sum(hn::Mul(undirected, ax));
    total.undirected_arm[1] += Sum(hn::Mul(undirected, ay));
    total.undirected_arm[2] += Sum(hn::Mul(undirected, az));
  }
  return total;
}

template <class Index>
HWY_INLINE PairSums BlendPairs(const Index& index, const PosedSpheres& spheres, const Band& band,
                               Deadline* deadline) {
  PosedLink link;
  Pose(spheres, &link);
  std::array<SphereSums, kMaxGroups> sums;
  const float limit = band.nearest + band.smoothing;
  alignas(64) float weights[kWidth];
  std::fill_n(weights, kWidth, 1.0F);
  VisitTiles(index, link, limit, deadline, [&](const auto& tile, std::uint32_t groups) {
    if constexpr (std::is_same_v<Index, ThinnedCloud>) CellWeights(tile, weights);
    for (; groups != 0; groups &= groups - 1) {
      const std::size_t g = hwy::Num0BitsBelowLS1Bit_Nonzero32(groups);
      AddTile(tile, weights, link.groups[g], band.nearest, 1.0F / band.smoothing, &sums[g]);
    }
  });
  PairSums total;
  for (std::size_t g = 0; g < link.count; ++g) total.add(Total(sums[g], link.groups[g]));
  return total;
}

}  // namespace blend

// HWY_EXPORT asks for these here.
float NearestPointPair(const ThinnedCloud& cloud, const PosedSpheres& spheres, float limit,
                       Deadline* deadline) {
  return blend::NearestPair(cloud, spheres, limit, deadline);
}
float NearestBoxPair(const BoxBvh& index, const PosedSpheres& spheres, float limit,
                     Deadline* deadline) {
  return blend::NearestPair(index, spheres, limit, deadline);
}
PairSums BlendPointPairs(const ThinnedCloud& cloud, const PosedSpheres& spheres, const Band& band,
                         Deadline* deadline) {
  return blend::BlendPairs(cloud, spheres, band, deadline);
}
PairSums BlendBoxPairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band,
                       Deadline* deadline) {
  return blend::BlendPairs(index, spheres, band, deadline);
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
                   Deadline* deadline) {
  if (cloud.empty()) return limit;
  return HWY_DYNAMIC_DISPATCH(NearestPointPair)(cloud, spheres, limit, deadline);
}

float nearest_pair(const BoxBvh& index, const PosedSpheres& spheres, float limit,
                   Deadline* deadline) {
  if (index.empty()) return limit;
  return HWY_DYNAMIC_DISPATCH(NearestBoxPair)(index, spheres, limit, deadline);
}

PairSums blend_pairs(const ThinnedCloud& cloud, const PosedSpheres& spheres, const Band& band,
                     Deadline* deadline) {
  if (cloud.empty()) return {};
  return HWY_DYNAMIC_DISPATCH(BlendPointPairs)(cloud, spheres, band, deadline);
}

PairSums blend_pairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band,
                     Deadline* deadline) {
  if (index.empty()) return {};
  return HWY_DYNAMIC_DISPATCH(BlendBoxPairs)(index, spheres, band, deadline);
}

}  // namespace ist
#endif
