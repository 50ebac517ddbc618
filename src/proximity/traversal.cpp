// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/traversal.cpp"
#include "proximity/traversal.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cassert>
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A pair of a tree node's child and a box. It carries both volumes, so expanding one side does not
// touch the other's memory.
struct Pair {
  float bound;
  std::int32_t sphere, box;  // child indices: >= 0 node, < 0 leaf or tile
  float x, y, z, radius;     // the sphere, posed
  float min[3], max[3];
};

constexpr std::size_t kStackSize = 1024;  // 15 siblings a level, 6 + 6 levels, and room
constexpr std::uint64_t kExpiryInterval = 16;

using SphereTag = hn::CappedTag<float, static_cast<std::size_t>(kSphereWidth)>;
using PointTag = hn::CappedTag<float, static_cast<std::size_t>(kPointWidth)>;

template <class D>
HWY_INLINE hn::Vec<D> Gap(D d, hn::Vec<D> low, hn::Vec<D> high, hn::Vec<D> value) {
  return hn::Max(hn::Max(hn::Sub(low, value), hn::Sub(value, high)), hn::Zero(d));
}

template <class V>
HWY_INLINE V Norm(V x, V y, V z) {
  return hn::Sqrt(hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z))));
}

struct Posed {
  alignas(64) float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];
};

// Eight centres from the link's frame into the index's.
HWY_INLINE void Pose(const Traversal& t, const float* x, const float* y, const float* z,
                     Posed* posed) {
  const SphereTag d;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto vx = hn::Load(d, x + k), vy = hn::Load(d, y + k), vz = hn::Load(d, z + k);
    float* out[3] = {posed->x, posed->y, posed->z};
    for (int row = 0; row < 3; ++row) {
      const float* r = t.R_OL + 3 * row;
      const auto sum =
          hn::MulAdd(hn::Set(d, r[0]), vx,
                     hn::MulAdd(hn::Set(d, r[1]), vy,
                                hn::MulAdd(hn::Set(d, r[2]), vz, hn::Set(d, t.p_OL[row]))));
      hn::Store(sum, d, out[row] + k);
    }
  }
}

template <bool kExact, bool kBoxes>
class Descent {
 public:
  explicit Descent(Traversal* traversal) : t_(*traversal) {}

  void Run() {
    PushRoot();
    while (top_ > 0) {
      const Pair pair = stack_[--top_];
      if (!(pair.bound < Limit())) {
        Drop(pair.bound);
        continue;
      }
      if (kExact && t_.may_be_inside && t_.threshold <= t_.interior) {
        // What is left is outside and too far, or is the depth query's.
        Drop(t_.interior);
        return;
      }
      if (++t_.node_pairs % kExpiryInterval == 0 && t_.expired != nullptr &&
          t_.expired(t_.context)) {
        t_.stopped = true;
        Drop(pair.bound);
        while (top_ > 0) Drop(stack_[--top_].bound);
        return;
      }
      if (pair.sphere < 0 && pair.box < 0) {
        Leaves(pair);
      } else if (pair.sphere < 0 || (pair.box >= 0 && BoxIsLarger(pair))) {
        ExpandBox(pair);
      } else {
        ExpandSphere(pair);
      }
    }
  }

 private:
  float Limit() const {
    return kExact ? std::max(t_.threshold, t_.interior) : std::min(t_.threshold, t_.inner_distance);
  }

  void Drop(float bound) { t_.dropped = std::min(t_.dropped, bound); }

  static bool BoxIsLarger(const Pair& pair) {
    float size_sq = 0.0F;
    for (int i = 0; i < 3; ++i) {
      size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
    }
    return size_sq > 4.0F * pair.radius * pair.radius;
  }

  // The root pair's volumes are never compared: it is expanded on the sphere's side first.
  void PushRoot() {
    Pair root{};
    root.bound = -std::numeric_limits<float>::infinity();
    root.radius = std::numeric_limits<float>::infinity();
    root.box = t_.box_root;
    for (int i = 0; i < 3; ++i) {
      root.min[i] = -kFarAway;
      root.max[i] = kFarAway;
    }
    stack_[top_++] = root;
  }

  // Keeps the children from `begin` up sorted, the nearest on top.
  HWY_INLINE void Insert(std::size_t begin, const Pair& pair) {
    assert(top_ < kStackSize);
    std::size_t at = top_++;
    for (; at > begin && stack_[at - 1].bound < pair.bound; --at) stack_[at] = stack_[at - 1];
    stack_[at] = pair;
  }

  void ExpandSphere(const Pair& pair) {
    const SphereNode& node = t_.sphere_nodes[pair.sphere];
    const SphereTag d;
    Posed posed;
    Pose(t_, node.x, node.y, node.z, &posed);
    alignas(64) float bound[kSphereWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
      const auto dx =
          Gap(d, hn::Set(d, pair.min[0]), hn::Set(d, pair.max[0]), hn::Load(d, posed.x + k));
      const auto dy =
          Gap(d, hn::Set(d, pair.min[1]), hn::Set(d, pair.max[1]), hn::Load(d, posed.y + k));
      const auto dz =
          Gap(d, hn::Set(d, pair.min[2]), hn::Set(d, pair.max[2]), hn::Load(d, posed.z + k));
      hn::Store(hn::Sub(Norm(dx, dy, dz), hn::Load(d, node.radius + k)), d, bound + k);
    }
    Pair child = pair;
    const std::size_t begin = top_;
    const float limit = Limit();
    for (int k = 0; k < node.count; ++k) {
      if (!(bound[k] < limit)) {
        Drop(bound[k]);
        continue;
      }
      child.bound = bound[k];
      child.sphere = node.child[k];
      child.x = posed.x[k];
      child.y = posed.y[k];
      child.z = posed.z[k];
      child.radius = node.radius[k];
      Insert(begin, child);
    }
  }

  void ExpandBox(const Pair& pair) {
    const BoxNode& node = t_.box_nodes[pair.box];
    const PointTag d;
    alignas(64) float bound[kPointWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto dx =
          Gap(d, hn::Load(d, node.min_x + k), hn::Load(d, node.max_x + k), hn::Set(d, pair.x));
      const auto dy =
          Gap(d, hn::Load(d, node.min_y + k), hn::Load(d, node.max_y + k), hn::Set(d, pair.y));
      const auto dz =
          Gap(d, hn::Load(d, node.min_z + k), hn::Load(d, node.max_z + k), hn::Set(d, pair.z));
      hn::Store(hn::Sub(Norm(dx, dy, dz), hn::Set(d, pair.radius)), d, bound + k);
    }
    Pair child = pair;
    const std::size_t begin = top_;
    const float limit = Limit();
    for (int k = 0; k < node.count; ++k) {
      if (!(bound[k] < limit)) {
        Drop(bound[k]);
        continue;
      }
      child.bound = bound[k];
      child.box = node.child[k];
      child.min[0] = node.min_x[k];
      child.min[1] = node.min_y[k];
      child.min[2] = node.min_z[k];
      child.max[0] = node.max_x[k];
      child.max[1] = node.max_y[k];
      child.max[2] = node.max_z[k];
      Insert(begin, child);
    }
  }

  // From sixteen points, or boxes, to a place.
  HWY_INLINE hn::Vec<PointTag> Distance(const PointTile& tile, std::size_t k, float x, float y,
                                        float z) const {
    const PointTag d;
    return Norm(hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, x)),
                hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, y)),
                hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, z)));
  }
  HWY_INLINE hn::Vec<PointTag> Distance(const BoxTile& tile, std::size_t k, float x, float y,
                                        float z) const {
    const PointTag d;
    return Norm(Gap(d, hn::Load(d, tile.min_x + k), hn::Load(d, tile.max_x + k), hn::Set(d, x)),
                Gap(d, hn::Load(d, tile.min_y + k), hn::Load(d, tile.max_y + k), hn::Set(d, y)),
                Gap(d, hn::Load(d, tile.min_z + k), hn::Load(d, tile.max_z + k), hn::Set(d, z)));
  }

  HWY_INLINE void Leaves(const Pair& pair) {
    if constexpr (kBoxes) {
      Leaves(pair, t_.box_tiles[~pair.box]);
    } else {
      Leaves(pair, t_.tiles[~pair.box]);
    }
  }

  // Up to 8 balls against 16 points or boxes: for each of these the least distance to a ball.
  template <class Tile>
  HWY_INLINE void Leaves(const Pair& pair, const Tile& tile) {
    ++t_.leaf_pairs;
    const SphereLeaf& leaf = t_.sphere_leaves[~pair.sphere];
    const std::int32_t tile_index = ~pair.box;
    Posed posed;
    Pose(t_, leaf.x, leaf.y, leaf.z, &posed);
    const float* radius = kExact ? leaf.outer : leaf.inner;
    const PointTag d;
    alignas(64) float distance[kPointWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      auto nearest = hn::Set(d, kFarAway);
      for (int b = 0; b < leaf.count; ++b) {
        const auto to_center = Distance(tile, k, posed.x[b], posed.y[b], posed.z[b]);
        nearest = hn::Min(nearest, hn::Sub(to_center, hn::Set(d, radius[b])));
      }
      hn::Store(nearest, d, distance + k);
    }
    if (kExact) {
      Candidates(tile_index, tile.count, distance);
    } else {
      for (int k = 0; k < tile.count; ++k) {
        if (!(distance[k] < t_.inner_distance)) continue;
        t_.inner_distance = distance[k];
        t_.inner_tile = tile_index;
        t_.inner_lane = k;
        t_.inner_leaf = ~pair.sphere;
      }
    }
  }

  void Candidates(std::int32_t tile, int count, const float* bound) {
    for (int k = 0; k < count; ++k) {
      if (bound[k] <= t_.interior) {
        t_.may_be_inside = true;
      } else if (bound[k] < t_.threshold) {
        t_.candidate(t_.context, tile, k, bound[k]);
      } else {
        Drop(bound[k]);
      }
    }
  }

  Traversal& t_;
  std::size_t top_ = 0;
  Pair stack_[kStackSize];
};

void DescendInner(Traversal* traversal) { Descent<false, false>(traversal).Run(); }
void DescendExact(Traversal* traversal) { Descent<true, false>(traversal).Run(); }
void DescendInnerBoxes(Traversal* traversal) { Descent<false, true>(traversal).Run(); }
void DescendExactBoxes(Traversal* traversal) { Descent<true, true>(traversal).Run(); }

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(DescendInner);
HWY_EXPORT(DescendExact);
HWY_EXPORT(DescendInnerBoxes);
HWY_EXPORT(DescendExactBoxes);

void descend_inner(Traversal* traversal) {
  if (traversal->box_tiles != nullptr) {
    HWY_DYNAMIC_DISPATCH(DescendInnerBoxes)(traversal);
  } else {
    HWY_DYNAMIC_DISPATCH(DescendInner)(traversal);
  }
}

void descend_exact(Traversal* traversal) {
  if (traversal->box_tiles != nullptr) {
    HWY_DYNAMIC_DISPATCH(DescendExactBoxes)(traversal);
  } else {
    HWY_DYNAMIC_DISPATCH(DescendExact)(traversal);
  }
}

}  // namespace ist
#endif
