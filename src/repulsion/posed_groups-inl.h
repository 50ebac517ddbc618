// A link's groups of spheres in the frame of an index, and the traversal to the tiles near them.
// Compiled once per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_POSED_GROUPS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_POSED_GROUPS_INL_H
#undef IST_PROXIMITY_POSED_GROUPS_INL_H
#else
#define IST_PROXIMITY_POSED_GROUPS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "internal/bvh/traversal_stack.h"
#include "repulsion/blend_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace blend {
namespace hn = hwy::HWY_NAMESPACE;

// Both sides are sixteen wide: children of a node beside each other, and spheres of a group.
static_assert(kSphereGroupWidth == kPointWidth);
constexpr auto kWidth = static_cast<std::size_t>(kSphereGroupWidth);
constexpr std::size_t kMaxGroups = kCoarseSpheres / kWidth;
// Nodes and tiles that are visited between two looks at the clock: some microseconds.
constexpr std::uint32_t kStepsBetweenLooks = 16;
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
struct PosedGroup {
  alignas(64) float x[kWidth], y[kWidth], z[kWidth];
  alignas(64) float arm_x[kWidth], arm_y[kWidth], arm_z[kWidth];
  const float* radius;
  float bound_center[3], bound_radius;
};

HWY_INLINE void Pose(const PosedSpheres& spheres, const SphereGroup& group, PosedGroup* posed) {
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
    posed->bound_center[row] = r[0] * group.bound_center[0] + r[1] * group.bound_center[1] +
                               r[2] * group.bound_center[2] + spheres.p_OL[row];
  }
  posed->radius = group.radius;
  posed->bound_radius = group.bound_radius;
}

HWY_INLINE V Gap(V low, V high, V value) {
  const Tag d;
  return hn::Max(hn::Max(hn::Sub(low, value), hn::Sub(value, high)), hn::Zero(d));
}

// The offsets from a point, or from the nearest point of a box, to the centres of spheres k, k + 1,
// ...
HWY_INLINE Offset ToSpheres(const ThinnedTile& tile, int point, const PosedGroup& group,
                            std::size_t k) {
  const Tag d;
  return {hn::Sub(hn::Load(d, group.x + k), hn::Set(d, tile.x[point])),
          hn::Sub(hn::Load(d, group.y + k), hn::Set(d, tile.y[point])),
          hn::Sub(hn::Load(d, group.z + k), hn::Set(d, tile.z[point]))};
}

// The offset from the nearest number of an interval to v.
HWY_INLINE V FromInterval(float low, float high, V v) {
  const Tag d;
  return hn::Sub(v, hn::Min(hn::Max(v, hn::Set(d, low)), hn::Set(d, high)));
}

template <class Boxes>
HWY_INLINE Offset ToSpheres(const Boxes& boxes, int box, const PosedGroup& group, std::size_t k) {
  const Tag d;
  return {FromInterval(boxes.min_x[box], boxes.max_x[box], hn::Load(d, group.x + k)),
          FromInterval(boxes.min_y[box], boxes.max_y[box], hn::Load(d, group.y + k)),
          FromInterval(boxes.min_z[box], boxes.max_z[box], hn::Load(d, group.z + k))};
}

// [m] Smallest distance of points (or boxes) begin to end to a sphere of the group.
template <class Tile>
HWY_INLINE float Nearest(const Tile& tile, int begin, int end, const PosedGroup& group) {
  const Tag d;
  V nearest = hn::Set(d, kFarAway);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const V radius = hn::Load(d, group.radius + k);
    for (int i = begin; i < end; ++i) {
      const V length = hn::Sqrt(SquaredNorm(ToSpheres(tile, i, group, k)));
      nearest = hn::Min(nearest, hn::Sub(length, radius));
    }
  }
  return hn::GetLane(hn::MinOfLanes(d, nearest));
}

// Bit k for a child whose box is nearer than `limit` to the centre of the group's bounding sphere.
HWY_INLINE std::uint32_t ChildrenWithin(const BoxNode& node, const PosedGroup& group, float limit) {
  const Tag d;
  const V limit_sq = hn::Set(d, limit * limit);
  std::uint32_t near = 0;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const Offset gap = {Gap(hn::Load(d, node.min_x + k), hn::Load(d, node.max_x + k),
                            hn::Set(d, group.bound_center[0])),
                        Gap(hn::Load(d, node.min_y + k), hn::Load(d, node.max_y + k),
                            hn::Set(d, group.bound_center[1])),
                        Gap(hn::Load(d, node.min_z + k), hn::Load(d, node.max_z + k),
                            hn::Set(d, group.bound_center[2]))};
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Lt(SquaredNorm(gap), limit_sq), bits);
    near |= (bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U) << k;
  }
  return near & ((1U << static_cast<std::uint32_t>(node.count)) - 1U);
}

// A link's groups in the index's frame.
struct PosedLink {
  std::array<PosedGroup, kMaxGroups> groups;
  std::size_t count;
};

HWY_INLINE void Pose(const PosedSpheres& spheres, PosedLink* link) {
  link->count = std::min(spheres.count, kMaxGroups);
  for (std::size_t g = 0; g < link->count; ++g) Pose(spheres, spheres.groups[g], &link->groups[g]);
}

// A node or tile that is still to be visited, and the groups that it may be near.
struct Entry {
  std::int32_t child;
  std::uint32_t groups;  // bit g: group g
  float bound;           // [m] to the surface of a sphere of these groups
};

// The children of a node that may hold a point nearer than `limit` to a sphere of `groups`.
// @returns bit k: found[k] has been set but for its child
HWY_INLINE std::uint32_t FindChildren(const BoxNode& node, const PosedLink& link,
                                      std::uint32_t groups, float limit,
                                      std::array<Entry, kWidth>* found) {
  std::uint32_t any = 0;
  for (; groups != 0; groups &= groups - 1) {
    const PosedGroup& group = link.groups[hwy::Num0BitsBelowLS1Bit_Nonzero32(groups)];
    const float within = std::min(std::max(limit + group.bound_radius, 0.0F), kFarAway);
    std::uint32_t children = ChildrenWithin(node, group, within);
    for (; children != 0; children &= children - 1) {
      const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(children);
      const auto child = static_cast<int>(k);
      const float bound = Nearest(node, child, child + 1, group);
      if (!(bound < limit)) continue;
      Entry& entry = (*found)[k];
      entry.bound = entry.groups == 0 ? bound : std::min(bound, entry.bound);
      entry.groups |= groups & (0U - groups);
      any |= 1U << k;
    }
  }
  return any;
}

// Calls visit(tile, groups) for the thinned tiles of a leaf that may hold a point nearer than
// `limit` to a sphere of these groups.
template <class Visit>
HWY_INLINE void VisitLeaf(const ThinnedCloud& cloud, std::int32_t leaf, const PosedLink& link,
                          std::uint32_t groups, const float& limit, ThinnedNode* buffer,
                          const Visit& visit) {
  for (const ThinnedTile& tile : cloud.tiles(leaf, buffer)) {
    std::uint32_t near = 0;
    for (std::uint32_t rest = groups; rest != 0; rest &= rest - 1) {
      const PosedGroup& group = link.groups[hwy::Num0BitsBelowLS1Bit_Nonzero32(rest)];
      if (Nearest(tile.box, 0, 1, group) < limit) near |= rest & (0U - rest);
    }
    if (near != 0) visit(tile, near);
  }
}

// The buffer that a traversal lends to an index.
template <class Index>
struct TileBuffer {
  typename Index::Tile tile;
};
template <>
struct TileBuffer<ThinnedCloud> {
  ThinnedNode tile;
};

// Calls visit(tile, groups) for the tiles that may hold a point nearer to a sphere's surface than
// `limit`, depth first, the nearest child first; bit g of `groups`: to a sphere of group g. `visit`
// may lower the limit. Ends early once the deadline has passed.
template <class Index, class Visit>
HWY_INLINE void VisitTiles(const Index& index, const PosedLink& link, const float& limit,
                           Deadline* deadline, const Visit& visit) {
  TileBuffer<Index> buffer;
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kWidth)> stack;
  stack.push({index.root(), (1U << link.count) - 1U, -kFarAway});
  while (!stack.empty()) {
    const Entry entry = stack.pop();
    if (!(entry.bound < limit)) continue;
    if (deadline->passed_now_and_then(kStepsBetweenLooks)) return;
    if constexpr (!std::is_same_v<Index, ThinnedCloud>) {
      if (entry.child < 0) {
        visit(index.tile(static_cast<std::size_t>(~entry.child), &buffer.tile), entry.groups);
        continue;
      }
    }
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(entry.child)];
    if constexpr (std::is_same_v<Index, ThinnedCloud>) {
      if (ThinnedCloud::is_leaf(node)) {
        VisitLeaf(index, entry.child, link, entry.groups, limit, &buffer.tile, visit);
        continue;
      }
    }
    std::array<Entry, kWidth> found{};
    std::uint32_t any = FindChildren(node, link, entry.groups, limit, &found);
    const std::size_t first = stack.size();
    for (; any != 0; any &= any - 1) {
      const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(any);
      found[k].child = node.child[k];
      stack.push_least_on_top<&Entry::bound>(first, found[k]);
    }
  }
}

}  // namespace blend
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif
