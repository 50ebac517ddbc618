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
struct GroupSums {
  alignas(64) float x[kWidth] = {}, y[kWidth] = {}, z[kWidth] = {};
  alignas(64) float weight[kWidth] = {}, undirected[kWidth] = {};
};

// weights: by point, or box.
template <class Tile>
HWY_INLINE void AddTile(const Tile& tile, const float* weights, const PosedGroup& group,
                        float nearest, float per_smoothing, GroupSums* sums) {
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

// The middle of some points, each with its weight.
struct Middle {
  float x = 0.0F, y = 0.0F, z = 0.0F, weight = 0.0F;
};

HWY_INLINE Middle FindMiddle(const ThinnedTile& tile, int begin, int end, const float* weights) {
  Middle middle;
  for (int i = begin; i < end; ++i) {
    middle.x += weights[i] * tile.x[i];
    middle.y += weights[i] * tile.y[i];
    middle.z += weights[i] * tile.z[i];
    middle.weight += weights[i];
  }
  const float scale = middle.weight > 0.0F ? 1.0F / middle.weight : 0.0F;
  middle.x *= scale;
  middle.y *= scale;
  middle.z *= scale;
  return middle;
}

HWY_INLINE void Accumulate(V v, float* sum) {
  const Tag d;
  hn::Store(hn::Add(hn::Load(d, sum), v), d, sum);
}

// The slopes of a group's sums.
HWY_INLINE void AddSlopes(const Middle& middle, const PosedGroup& group, std::size_t g,
                          float nearest, float per_smoothing, SphereSums* sums) {
  const Tag d;
  // [m] Nearer to a centre than the points of a tile are to one another, slopes mean nothing.
  constexpr float kLeast = 5e-3F;
  const V slope = hn::Set(d, per_smoothing);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const std::size_t slot = g * kWidth + k;
    const Offset o = {hn::Sub(hn::Load(d, group.x + k), hn::Set(d, middle.x)),
                      hn::Sub(hn::Load(d, group.y + k), hn::Set(d, middle.y)),
                      hn::Sub(hn::Load(d, group.z + k), hn::Set(d, middle.z))};
    const V squared = hn::Max(SquaredNorm(o), hn::Set(d, kLeast * kLeast));
    const V inverse = InverseRoot(squared);
    const V d_min = hn::Add(hn::Load(d, group.radius + k), hn::Set(d, nearest));
    const V root = hn::Max(
        hn::MulAdd(hn::NegMulAdd(squared, inverse, d_min), slope, hn::Set(d, 1.0F)), hn::Zero(d));
    const V part = hn::Mul(root, hn::Set(d, middle.weight));
    const V per_length = hn::Mul(hn::Mul(part, root), inverse);
    const V weight_slope = hn::Mul(part, hn::Set(d, -2.0F * per_smoothing));
    const V over_sq = hn::Mul(hn::Sub(weight_slope, per_length), hn::Mul(inverse, inverse));
    const V over = hn::Mul(weight_slope, inverse);
    const V x = hn::Mul(over_sq, o.x), y = hn::Mul(over_sq, o.y), z = hn::Mul(over_sq, o.z);
    Accumulate(per_length, sums->per_length + slot);
    Accumulate(weight_slope, sums->weight_slope + slot);
    Accumulate(hn::Mul(over, o.x), sums->slope[0] + slot);
    Accumulate(hn::Mul(over, o.y), sums->slope[1] + slot);
    Accumulate(hn::Mul(over, o.z), sums->slope[2] + slot);
    Accumulate(hn::Mul(x, o.x), sums->outer[0] + slot);
    Accumulate(hn::Mul(y, o.y), sums->outer[1] + slot);
    Accumulate(hn::Mul(z, o.z), sums->outer[2] + slot);
    Accumulate(hn::Mul(x, o.y), sums->outer[3] + slot);
    Accumulate(hn::Mul(y, o.z), sums->outer[4] + slot);
    Accumulate(hn::Mul(z, o.x), sums->outer[5] + slot);
  }
}

// Neighbours are taken for one point where the tile is small, as in a dense cloud.
HWY_INLINE void AddTileSlopes(const ThinnedTile& tile, const float* weights,
                              const PosedGroup& group, std::size_t g, const Band& band,
                              SphereSums* sums) {
  constexpr float kSmall = 0.6F;  // of the smoothing
  constexpr int kNeighbours = 4;
  const SingleBox& box = tile.box;
  const float x = box.max_x[0] - box.min_x[0], y = box.max_y[0] - box.min_y[0],
              z = box.max_z[0] - box.min_z[0];
  const float small = kSmall * band.smoothing;
  const int step = x * x + y * y + z * z < small * small ? kNeighbours : 1;
  for (int i = 0; i < tile.count; i += step) {
    const Middle middle = FindMiddle(tile, i, std::min(i + step, tile.count), weights);
    AddSlopes(middle, group, g, band.nearest, 1.0F / band.smoothing, sums);
  }
}

HWY_INLINE float Sum(V v) { return hn::GetLane(hn::SumOfLanes(Tag(), v)); }

HWY_INLINE PairSums Total(const GroupSums& sums, const PosedGroup& group) {
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
                               Deadline* deadline, SphereSums* by_sphere) {
  if (by_sphere != nullptr) *by_sphere = {};
  PosedLink link;
  Pose(spheres, &link);
  std::array<GroupSums, kMaxGroups> sums;
  const float limit = band.nearest + band.smoothing;
  alignas(64) float weights[kWidth];
  std::fill_n(weights, kWidth, 1.0F);
  VisitTiles(index, link, limit, deadline, [&](const auto& tile, std::uint32_t groups) {
    if constexpr (std::is_same_v<Index, ThinnedCloud>) CellWeights(tile, weights);
    for (; groups != 0; groups &= groups - 1) {
      const std::size_t g = hwy::Num0BitsBelowLS1Bit_Nonzero32(groups);
      AddTile(tile, weights, link.groups[g], band.nearest, 1.0F / band.smoothing, &sums[g]);
      if constexpr (std::is_same_v<Index, ThinnedCloud>) {
        if (by_sphere != nullptr) AddTileSlopes(tile, weights, link.groups[g], g, band, by_sphere);
      }
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
