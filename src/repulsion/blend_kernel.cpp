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

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Both sides are sixteen wide: children of a node beside each other, and spheres of a group.
static_assert(kSphereGroupWidth == kPointWidth);
constexpr auto kWidth = static_cast<std::size_t>(kSphereGroupWidth);
constexpr std::size_t kMostGroups = kCoarseSpheres / kWidth;
using Tag = hn::CappedTag<float, kWidth>;
using V = hn::Vec<Tag>;

struct Offset {
  V x, y, z;
};

HWY_INLINE V SquaredNorm(const Offset& o) {
  return hn::MulAdd(o.x, o.x, hn::MulAdd(o.y, o.y, hn::Mul(o.z, o.z)));
}

// Within 3e-7 of 1 / sqrt(v): one step of Newton's method.
HWY_INLINE V InverseRoot(V v) {
  const Tag d;
  const V guess = hn::ApproximateReciprocalSqrt(v);
  const V half = hn::Mul(hn::Mul(v, hn::Set(d, 0.5F)), guess);
  return hn::Mul(guess, hn::NegMulAdd(half, guess, hn::Set(d, 1.5F)));
}

// A group in the index's frame. Arms are from the link's origin to the centres.
struct Posed {
  alignas(64) float x[kWidth], y[kWidth], z[kWidth];
  alignas(64) float arm_x[kWidth], arm_y[kWidth], arm_z[kWidth];
  const float* radius;
  float center[3], reach;
};

HWY_INLINE void Pose(const PosedSpheres& spheres, const SphereGroup& group, Posed* posed) {
  const Tag d;
  float* center[3] = {posed->x, posed->y, posed->z};
  float* arm[3] = {posed->arm_x, posed->arm_y, posed->arm_z};
  for (int row = 0; row < 3; ++row) {
    const float* r = spheres.R_OL + 3 * row;
    for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
      const V sum = hn::MulAdd(hn::Set(d, r[0]), hn::Load(d, group.x + k),
                               hn::MulAdd(hn::Set(d, r[1]), hn::Load(d, group.y + k),
                                          hn::Mul(hn::Set(d, r[2]), hn::Load(d, group.z + k))));
      hn::Store(sum, d, arm[row] + k);
      hn::Store(hn::Add(sum, hn::Set(d, spheres.p_OL[row])), d, center[row] + k);
    }
    posed->center[row] = r[0] * group.center[0] + r[1] * group.center[1] + r[2] * group.center[2] +
                         spheres.p_OL[row];
  }
  posed->radius = group.radius;
  posed->reach = group.reach;
}

HWY_INLINE V Gap(V low, V high, V value) {
  const Tag d;
  return hn::Max(hn::Max(hn::Sub(low, value), hn::Sub(value, high)), hn::Zero(d));
}

// From a point, or from the nearest point of a box, to the centres of spheres k, k + 1, ...
HWY_INLINE Offset ToSpheres(const PointTile& tile, int point, const Posed& spheres, std::size_t k) {
  const Tag d;
  return {hn::Sub(hn::Load(d, spheres.x + k), hn::Set(d, tile.x[point])),
          hn::Sub(hn::Load(d, spheres.y + k), hn::Set(d, tile.y[point])),
          hn::Sub(hn::Load(d, spheres.z + k), hn::Set(d, tile.z[point]))};
}

HWY_INLINE V Beyond(float low, float high, V v) {
  const Tag d;
  return hn::Sub(v, hn::Min(hn::Max(v, hn::Set(d, low)), hn::Set(d, high)));
}

template <class Boxes>
HWY_INLINE Offset ToSpheres(const Boxes& boxes, int box, const Posed& spheres, std::size_t k) {
  const Tag d;
  return {Beyond(boxes.min_x[box], boxes.max_x[box], hn::Load(d, spheres.x + k)),
          Beyond(boxes.min_y[box], boxes.max_y[box], hn::Load(d, spheres.y + k)),
          Beyond(boxes.min_z[box], boxes.max_z[box], hn::Load(d, spheres.z + k))};
}

// [m] Smallest distance of points (or boxes) begin to end to a sphere of the group.
template <class Tile>
HWY_INLINE float Nearest(const Tile& tile, int begin, int end, const Posed& spheres) {
  const Tag d;
  V nearest = hn::Set(d, kFarAway);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const V radius = hn::Load(d, spheres.radius + k);
    for (int i = begin; i < end; ++i) {
      const V length = hn::Sqrt(SquaredNorm(ToSpheres(tile, i, spheres, k)));
      nearest = hn::Min(nearest, hn::Sub(length, radius));
    }
  }
  return hn::GetLane(hn::MinOfLanes(d, nearest));
}

// Bit k for a child whose box is nearer to the group's centre than `reach`.
HWY_INLINE std::uint32_t Near(const BoxNode& node, const Posed& spheres, float reach) {
  const Tag d;
  const V limit = hn::Set(d, reach * reach);
  std::uint32_t near = 0;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const Offset gap = {Gap(hn::Load(d, node.min_x + k), hn::Load(d, node.max_x + k),
                            hn::Set(d, spheres.center[0])),
                        Gap(hn::Load(d, node.min_y + k), hn::Load(d, node.max_y + k),
                            hn::Set(d, spheres.center[1])),
                        Gap(hn::Load(d, node.min_z + k), hn::Load(d, node.max_z + k),
                            hn::Set(d, spheres.center[2]))};
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Lt(SquaredNorm(gap), limit), bits);
    near |= (bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U) << k;
  }
  return near & ((1U << static_cast<std::uint32_t>(node.count)) - 1U);
}

// A link's groups in the index's frame.
struct PosedLink {
  std::array<Posed, kMostGroups> groups;
  std::size_t count;
};

HWY_INLINE void Pose(const PosedSpheres& spheres, PosedLink* link) {
  link->count = std::min(spheres.count, kMostGroups);
  for (std::size_t g = 0; g < link->count; ++g) Pose(spheres, spheres.groups[g], &link->groups[g]);
}

// Calls visit(tile, groups) for the tiles that may hold a point nearer to a sphere's surface than
// `limit`, the nearest first; bit g of `groups`: to a sphere of group g. The limit may shrink
// meanwhile.
template <class Index, class Visit>
HWY_INLINE void VisitTiles(const Index& index, const PosedLink& link, const float& limit,
                           const Visit& visit) {
  struct Entry {
    std::int32_t child;
    std::uint32_t groups;
    float bound;
  };
  typename Index::Tile room;
  std::array<Entry, 160> stack;  // sixteen on each of the levels that 2^31 tiles can have
  std::size_t top = 0;
  stack[top++] = {index.root(), (1U << link.count) - 1U, -kFarAway};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (!(entry.bound < limit)) continue;
    if (entry.child < 0) {
      visit(index.tile(static_cast<std::size_t>(~entry.child), &room), entry.groups);
      continue;
    }
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(entry.child)];
    std::array<Entry, kWidth> found{};
    std::uint32_t any = 0;
    for (std::uint32_t left = entry.groups; left != 0; left &= left - 1) {
      const Posed& spheres = link.groups[hwy::Num0BitsBelowLS1Bit_Nonzero32(left)];
      const float reach = std::min(std::max(limit + spheres.reach, 0.0F), kFarAway);
      for (std::uint32_t near = Near(node, spheres, reach); near != 0; near &= near - 1) {
        const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(near);
        const auto child = static_cast<int>(k);
        const float bound = Nearest(node, child, child + 1, spheres);
        if (!(bound < limit)) continue;
        found[k].bound = found[k].groups == 0 ? bound : std::min(bound, found[k].bound);
        found[k].groups |= left & (0U - left);
        any |= 1U << k;
      }
    }
    const std::size_t begin = top;
    for (; any != 0; any &= any - 1) {
      const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(any);
      found[k].child = node.child[k];
      std::size_t at = top++;
      for (; at > begin && stack[at - 1].bound < found[k].bound; --at) stack[at] = stack[at - 1];
      stack[at] = found[k];
    }
  }
}

template <class Index>
HWY_INLINE float NearestPair(const Index& index, const PosedSpheres& spheres, float limit) {
  PosedLink link;
  Pose(spheres, &link);
  VisitTiles(index, link, limit, [&](const auto& tile, std::uint32_t groups) {
    for (; groups != 0; groups &= groups - 1) {
      const Posed& posed = link.groups[hwy::Num0BitsBelowLS1Bit_Nonzero32(groups)];
      limit = std::min(limit, Nearest(tile, 0, tile.count, posed));
    }
  });
  return limit;
}

// How much of its cell a surface through each point covers.
HWY_INLINE void CellWeights(const PointTile& tile, const CellGrid& grid, float* weights) {
  const Tag d;
  const V half = hn::Set(d, 0.5F), scale = hn::Set(d, grid.per_meter);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const auto off = [&](const float* v, float offset) {
      const V cells = hn::MulAdd(hn::Load(d, v + k), scale, hn::Set(d, offset));
      return hn::Sub(hn::Sub(cells, hn::Floor(cells)), half);
    };
    const Offset off_centre = {off(tile.x, grid.offset[0]), off(tile.y, grid.offset[1]),
                               off(tile.z, grid.offset[2])};
    // Squared distance to the centre over that of a corner, 3/4.
    const V part = hn::Mul(SquaredNorm(off_centre), hn::Set(d, 1.0F / kCornerSquared));
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
HWY_INLINE void AddTile(const Tile& tile, const float* weights, const Posed& spheres, float nearest,
                        float per_smoothing, SphereSums* sums) {
  const Tag d;
  // Shorter than this a direction is noise; the weight moves over to the fallback smoothly.
  constexpr float kTiny = 1e-6F;  // [m]
  const V one = hn::Set(d, 1.0F), falls = hn::Set(d, per_smoothing);
  const V tiny_sq = hn::Set(d, kTiny * kTiny), per_tiny_sq = hn::Set(d, 1.0F / (kTiny * kTiny));
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    V x = hn::Load(d, sums->x + k), y = hn::Load(d, sums->y + k), z = hn::Load(d, sums->z + k);
    V weight = hn::Load(d, sums->weight + k), undirected = hn::Load(d, sums->undirected + k);
    // 1 - (d - nearest) / smoothing = start - length / smoothing.
    const V start =
        hn::MulAdd(hn::Add(hn::Load(d, spheres.radius + k), hn::Set(d, nearest)), falls, one);
    for (int i = 0; i < tile.count; ++i) {
      const Offset o = ToSpheres(tile, i, spheres, k);
      const V raw = SquaredNorm(o), squared = hn::Max(raw, tiny_sq);
      const V inverse = InverseRoot(squared);
      const V length = hn::Mul(squared, inverse);
      const V root = hn::Max(hn::NegMulAdd(length, falls, start), hn::Zero(d));
      const V w = hn::Mul(hn::Mul(root, root), hn::Set(d, weights[i]));
      const V directed = hn::Mul(w, inverse);
      x = hn::MulAdd(directed, o.x, x);
      y = hn::MulAdd(directed, o.y, y);
      z = hn::MulAdd(directed, o.z, z);
      weight = hn::Add(weight, w);
      const V lost = hn::Max(hn::NegMulAdd(raw, per_tiny_sq, one), hn::Zero(d));
      undirected = hn::MulAdd(w, lost, undirected);
    }
    hn::Store(x, d, sums->x + k);
    hn::Store(y, d, sums->y + k);
    hn::Store(z, d, sums->z + k);
    hn::Store(weight, d, sums->weight + k);
    hn::Store(undirected, d, sums->undirected + k);
  }
}

HWY_INLINE float Sum(V v) { return hn::GetLane(hn::SumOfLanes(Tag(), v)); }

HWY_INLINE PairSums Total(const SphereSums& sums, const Posed& spheres) {
  const Tag d;
  PairSums total;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const V x = hn::Load(d, sums.x + k), y = hn::Load(d, sums.y + k), z = hn::Load(d, sums.z + k);
    const V ax = hn::Load(d, spheres.arm_x + k), ay = hn::Load(d, spheres.arm_y + k),
            az = hn::Load(d, spheres.arm_z + k);
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
HWY_INLINE PairSums BlendPairs(const Index& index, const PosedSpheres& spheres, const Band& band) {
  PosedLink link;
  Pose(spheres, &link);
  std::array<SphereSums, kMostGroups> sums;
  const float limit = band.nearest + band.smoothing;
  alignas(64) float weights[kWidth];
  std::fill_n(weights, kWidth, 1.0F);
  VisitTiles(index, link, limit, [&](const auto& tile, std::uint32_t groups) {
    if constexpr (std::is_same_v<Index, PointBvh>) CellWeights(tile, band.grid, weights);
    for (; groups != 0; groups &= groups - 1) {
      const std::size_t g = hwy::Num0BitsBelowLS1Bit_Nonzero32(groups);
      AddTile(tile, weights, link.groups[g], band.nearest, 1.0F / band.smoothing, &sums[g]);
    }
  });
  PairSums total;
  for (std::size_t g = 0; g < link.count; ++g) total.add(Total(sums[g], link.groups[g]));
  return total;
}

float NearestPoint(const PointBvh& index, const PosedSpheres& spheres, float limit) {
  return NearestPair(index, spheres, limit);
}
float NearestBox(const BoxBvh& index, const PosedSpheres& spheres, float limit) {
  return NearestPair(index, spheres, limit);
}
PairSums BlendPoints(const PointBvh& index, const PosedSpheres& spheres, const Band& band) {
  return BlendPairs(index, spheres, band);
}
PairSums BlendBoxes(const BoxBvh& index, const PosedSpheres& spheres, const Band& band) {
  return BlendPairs(index, spheres, band);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

CellGrid::CellGrid(const Eigen::Vector3d& origin, double cell)
    : per_meter(static_cast<float>(1.0 / cell)) {
  for (int i = 0; i < 3; ++i) {
    offset[i] = static_cast<float>(origin[i] / cell - std::floor(origin[i] / cell));
  }
}

HWY_EXPORT(NearestPoint);
HWY_EXPORT(NearestBox);
HWY_EXPORT(BlendPoints);
HWY_EXPORT(BlendBoxes);

void PairSums::add(const PairSums& other) {
  weight += other.weight;
  undirected += other.undirected;
  for (int i = 0; i < 3; ++i) {
    force[i] += other.force[i];
    torque[i] += other.torque[i];
    undirected_arm[i] += other.undirected_arm[i];
  }
}

float nearest_pair(const PointBvh& index, const PosedSpheres& spheres, float limit) {
  return index.empty() ? limit : HWY_DYNAMIC_DISPATCH(NearestPoint)(index, spheres, limit);
}

float nearest_pair(const BoxBvh& index, const PosedSpheres& spheres, float limit) {
  return index.empty() ? limit : HWY_DYNAMIC_DISPATCH(NearestBox)(index, spheres, limit);
}

PairSums blend_pairs(const PointBvh& index, const PosedSpheres& spheres, const Band& band) {
  if (index.empty()) return {};
  return HWY_DYNAMIC_DISPATCH(BlendPoints)(index, spheres, band);
}

PairSums blend_pairs(const BoxBvh& index, const PosedSpheres& spheres, const Band& band) {
  if (index.empty()) return {};
  return HWY_DYNAMIC_DISPATCH(BlendBoxes)(index, spheres, band);
}

}  // namespace ist
#endif
