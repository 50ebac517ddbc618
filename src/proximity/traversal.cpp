// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/traversal.cpp"
#include "proximity/traversal.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "proximity/clipped_sphere-inl.h"
#include "proximity/supports-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A pair of a tree node's child and a box. It carries both volumes, so expanding one side does not
// touch the other's memory.
struct Pair {
  float bound;
  std::int32_t slot;         // of the sphere in the tree
  std::int32_t box_slot;     // as the front counts them
  std::int32_t parent;       // in the front: kPointWidth * pair + child; or one of those below
  std::int32_t sphere, box;  // child indices: >= 0 node, < 0 leaf or tile
  float x, y, z, radius;     // the sphere, posed
  float min[3], max[3];
};

constexpr std::size_t kStackSize = 1024;  // 7 siblings a level of spheres, 15 of boxes, and room
constexpr std::uint64_t kExpiryInterval = 16;

// A pair's parent, where there is none: the root's, or what no front keeps; the pair itself is in
// the front (from here down) and opened again.
constexpr std::int32_t kNoParent = -1, kReopened = -2;

template <bool kExact, bool kBoxes>
class Descent {
 public:
  explicit Descent(Traversal* traversal)
      : t_(*traversal), planes_(*traversal), front_(kExact ? traversal->front : nullptr) {
    if (front_ != nullptr) gain_ = front_->way() - t_.rounding;
  }

  void Run() {
    if (front_ == nullptr || front_->empty()) {
      PushRoot();
      Empty();
    } else {
      GoOn();
    }
    if (front_ != nullptr) front_->close(!is_cut_short_ && !is_full_);
  }

 private:
  // Until nothing is left that matters.
  void Empty() {
    while (top_ > 0) {
      const Pair pair = stack_[--top_];
      if (!(pair.bound < Limit())) {
        Leave(pair);
        continue;
      }
      if (t_.node_pairs >= t_.aim_after) {
        t_.aim_after = kNever;
        t_.aim(t_.context);
      }
      if (kExact && t_.may_be_inside && t_.threshold <= t_.interior) {
        // What is left is outside and too far, or is the depth query's.
        Drop(t_.interior);
        is_cut_short_ = true;
        return;
      }
      if (++t_.node_pairs % kExpiryInterval == 0 && t_.expired != nullptr &&
          t_.expired(t_.context)) {
        t_.stopped = is_cut_short_ = true;
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

  // From where the last descent ended: the pairs of which the most promising is left first.
  void GoOn() {
    std::array<std::int32_t, Front::kMost> pairs;
    const std::size_t count = FindOpen(pairs.data());
    const float* left = front_->left();
    std::sort(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(count),
              [left](std::int32_t a, std::int32_t b) { return left[a] < left[b]; });
    for (std::size_t i = 0; i < count; ++i) {
      const float bound = left[pairs[i]] - gain_;
      if (t_.stopped || !(bound < Limit())) {
        Drop(bound);
        continue;
      }
      Reopen(pairs[i], bound);
      Empty();
      if (is_cut_short_ && !t_.stopped) return;
    }
  }

  // Of the others the least bound is told.
  std::size_t FindOpen(std::int32_t* pairs) {
    const PointTag d;
    const auto limit = hn::Set(d, std::min(Limit() + gain_, kFarAway));
    auto dropped = hn::Set(d, kFarAway);
    std::size_t count = 0;
    for (std::size_t i = 0; i < front_->size(); i += hn::Lanes(d)) {
      const auto left = hn::LoadU(d, front_->left() + i);
      const auto is_open = hn::Lt(left, limit);
      dropped = hn::Min(dropped, hn::IfThenElse(is_open, dropped, left));
      for (std::uint32_t bits = Bits(d, is_open); bits != 0; bits &= bits - 1) {
        pairs[count++] = static_cast<std::int32_t>(i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      }
    }
    Drop(hn::GetLane(hn::MinOfLanes(d, dropped)) - gain_);
    return count;
  }

  // Its bound is only that of what was left of it; it is expanded in any case.
  void Reopen(std::int32_t index, float bound) {
    const Front::Pair& kept = front_->pair(index);
    Pair pair = Root();
    pair.parent = kReopened - index;
    pair.bound = bound;
    if (kept.sphere != Front::kRoot) {
      const SphereNode& node = t_.sphere_nodes[kept.sphere / kSphereWidth];
      const int k = kept.sphere % kSphereWidth;
      const float* r = t_.R_OL;
      pair.slot = kept.sphere;
      pair.sphere = node.child[k];
      pair.x = r[0] * node.x[k] + r[1] * node.y[k] + r[2] * node.z[k] + t_.p_OL[0];
      pair.y = r[3] * node.x[k] + r[4] * node.y[k] + r[5] * node.z[k] + t_.p_OL[1];
      pair.z = r[6] * node.x[k] + r[7] * node.y[k] + r[8] * node.z[k] + t_.p_OL[2];
      pair.radius = node.radius[k];
    }
    if (kept.box != Front::kRoot) SetBox(kept.box, &pair);
    stack_[top_++] = pair;
  }

  HWY_INLINE void SetBox(std::int32_t slot, Pair* pair) const {
    const BoxNode& node = t_.box_nodes[slot / kPointWidth];
    const int k = slot % kPointWidth;
    pair->box_slot = slot;
    pair->box = node.child[k];
    pair->min[0] = node.min_x[k];
    pair->min[1] = node.min_y[k];
    pair->min[2] = node.min_z[k];
    pair->max[0] = node.max_x[k];
    pair->max[1] = node.max_y[k];
    pair->max[2] = node.max_z[k];
  }

  float Limit() const {
    return kExact ? std::max(t_.threshold, t_.interior) : std::min(t_.threshold, t_.inner_distance);
  }

  void Drop(float bound) { t_.dropped = std::min(t_.dropped, bound); }

  // A pair that was not expanded after all.
  void Leave(const Pair& pair) {
    Drop(pair.bound);
    if (pair.parent >= 0) front_->leave(pair.parent / kPointWidth, pair.bound + gain_);
  }

  // The pair that is expanded now gets its place in the front.
  std::int32_t Enter(const Pair& pair) {
    if (front_ == nullptr) return Front::kFull;
    if (pair.parent <= kReopened) {
      front_->open(kReopened - pair.parent);
      return kReopened - pair.parent;
    }
    const std::int32_t index = front_->add(pair.slot, pair.box_slot);
    is_full_ = is_full_ || index == Front::kFull;
    if (index >= 0 && pair.parent >= 0) {
      front_->mark_expanded(pair.parent / kPointWidth, pair.parent % kPointWidth);
    }
    return index;
  }

  // Children that are in the front have their own place there.
  std::uint32_t Expanded(std::int32_t index) const {
    return index < 0 ? 0U : front_->pair(index).expanded;
  }

  static std::int32_t ParentOf(std::int32_t index, int child) {
    return index < 0 ? kNoParent : kPointWidth * index + child;
  }

  // What was dropped of a pair.
  void Drop(std::int32_t index, float bound) {
    Drop(bound);
    if (index >= 0) front_->leave(index, bound + gain_);
  }

  static bool BoxIsLarger(const Pair& pair) {
    float size_sq = 0.0F;
    for (int i = 0; i < 3; ++i) {
      size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
    }
    return size_sq > 4.0F * pair.radius * pair.radius;
  }

  // The root pair's volumes are never compared: it is expanded on the sphere's side first.
  Pair Root() const {
    Pair root{};
    root.bound = -std::numeric_limits<float>::infinity();
    root.slot = root.box_slot = Front::kRoot;
    root.parent = kNoParent;
    root.radius = std::numeric_limits<float>::infinity();
    root.box = t_.box_root;
    for (int i = 0; i < 3; ++i) {
      root.min[i] = -kFarAway;
      root.max[i] = kFarAway;
    }
    return root;
  }
  void PushRoot() { stack_[top_++] = Root(); }

  // The children in `near`, the farthest first: so the nearest comes to lie on top.
  struct Order {
    int count = 0;
    std::array<int, kPointWidth> child;
  };
  static HWY_INLINE Order Sorted(std::uint32_t near, const float* bound) {
    Order order;
    for (; near != 0; near &= near - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
      int at = order.count++;
      for (; at > 0 && bound[order.child[static_cast<std::size_t>(at - 1)]] < bound[k]; --at) {
        order.child[static_cast<std::size_t>(at)] = order.child[static_cast<std::size_t>(at - 1)];
      }
      order.child[static_cast<std::size_t>(at)] = k;
    }
    return order;
  }

  // The children in `near`, the nearest on top. `divide` fills in what each is a part of.
  template <class Divide>
  HWY_INLINE void PushChildren(const Pair& pair, std::int32_t index, std::uint32_t near,
                               const float* bound, const Divide& divide) {
    const Order order = Sorted(near, bound);
    assert(top_ + static_cast<std::size_t>(order.count) <= kStackSize);
    for (int i = 0; i < order.count; ++i) {
      const int k = order.child[static_cast<std::size_t>(i)];
      Pair& child = stack_[top_++];
      child = pair;
      child.bound = bound[k];
      child.parent = ParentOf(index, k);
      divide(k, &child);
    }
  }

  // Bit k for a bound below the limit; the least of the others is kept, of unused slots too, which
  // are far away.
  template <class D, class V>
  static HWY_INLINE std::uint32_t Below(D d, V bound, float limit, V* dropped) {
    const auto below = hn::Lt(bound, hn::Set(d, limit));
    *dropped = hn::Min(*dropped, hn::IfThenElse(below, *dropped, bound));
    return Bits(d, below);
  }
  template <class D>
  static HWY_INLINE std::uint32_t Bits(D d, hn::Mask<D> mask) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, mask, bits);
    return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U;
  }

  // Far away for the children whose bits are set.
  template <class D>
  static HWY_INLINE hn::Vec<D> Unless(D d, hn::Vec<D> bound, std::uint32_t bits) {
    if (bits == 0) return bound;
    alignas(64) float away[kPointWidth];
    for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
      away[k] = ((bits >> k) & 1U) != 0 ? kFarAway : -kFarAway;
    }
    return hn::Max(bound, hn::Load(d, away));
  }

  HWY_INLINE const float* SupportsOf(std::int32_t node) const {
    return HWY_NAMESPACE::SupportsOf(node, t_.sphere_nodes, t_.sphere_leaves, t_.supports);
  }
  HWY_INLINE float SupportOf(std::int32_t slot) const {
    return SupportsOf(slot / kSphereWidth)[slot % kSphereWidth];
  }

  void ExpandSphere(const Pair& pair) {
    const std::int32_t index = Enter(pair);
    const std::uint32_t expanded = Expanded(index);
    const SphereNode& node = t_.sphere_nodes[pair.sphere];
    const SphereTag d;
    Posed posed;
    Pose(t_, node.x, node.y, node.z, &posed);
    const auto ahead = hn::Set(d, planes_.Ahead(pair.min, pair.max));
    const Middle box = MiddleOf(pair);
    const float* support = SupportsOf(pair.sphere);
    if (pair.slot >= 0) Tighten(support, &t_.supports->reach[static_cast<std::size_t>(pair.slot)]);
    const float limit = Limit();
    std::uint32_t near = 0;
    auto dropped = hn::Set(d, kFarAway);
    alignas(64) float bound[kSphereWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
      const auto dx =
          Gap(d, hn::Set(d, pair.min[0]), hn::Set(d, pair.max[0]), hn::Load(d, posed.x + k));
      const auto dy =
          Gap(d, hn::Set(d, pair.min[1]), hn::Set(d, pair.max[1]), hn::Load(d, posed.y + k));
      const auto dz =
          Gap(d, hn::Set(d, pair.min[2]), hn::Set(d, pair.max[2]), hn::Load(d, posed.z + k));
      const auto x = hn::Load(d, posed.x + k), y = hn::Load(d, posed.y + k),
                 z = hn::Load(d, posed.z + k), radius = hn::Load(d, node.radius + k);
      const auto reach = hn::LoadU(d, support + k);
      const auto apart = hn::Sub(Norm(dx, dy, dz), radius);
      const auto height = hn::Sub(hn::Add(hn::Set(d, t_.offset), reach), planes_.Along(d, x, y, z));
      const auto aside =
          hn::Sub(planes_.Aside(d, hn::Sub(hn::Set(d, box.x), x), hn::Sub(hn::Set(d, box.y), y),
                                hn::Sub(hn::Set(d, box.z), z)),
                  hn::Set(d, box.radius));
      const auto least =
          hn::Max(apart, CutDistance(d, hn::Sub(ahead, reach), hn::Max(aside, hn::Zero(d)), radius,
                                     height, RimRadius(d, radius, height, t_.rounding)));
      near |= Below(d, Unless(d, least, expanded >> k), limit, &dropped) << k;
      hn::Store(least, d, bound + k);
    }
    near &= ((1U << static_cast<std::uint32_t>(node.count)) - 1U) & ~expanded;
    Drop(index, hn::GetLane(hn::MinOfLanes(d, dropped)));
    PushChildren(pair, index, near, bound, [&](int k, Pair* child) {
      child->slot = pair.sphere * kSphereWidth + k;
      child->sphere = node.child[k];
      child->x = posed.x[k];
      child->y = posed.y[k];
      child->z = posed.z[k];
      child->radius = node.radius[k];
    });
  }

  void ExpandBox(const Pair& pair) {
    const std::int32_t index = Enter(pair);
    const std::uint32_t expanded = Expanded(index);
    const BoxNode& node = t_.box_nodes[pair.box];
    const PointTag d;
    const float offset = t_.offset + SupportOf(pair.slot);
    const float center[3] = {pair.x, pair.y, pair.z};
    const auto radius = hn::Set(d, pair.radius);
    const auto height =
        hn::Sub(hn::Set(d, offset),
                planes_.Along(d, hn::Set(d, pair.x), hn::Set(d, pair.y), hn::Set(d, pair.z)));
    const auto rim = RimRadius(d, radius, height, t_.rounding);
    const float limit = Limit();
    std::uint32_t near = 0;
    auto dropped = hn::Set(d, kFarAway);
    alignas(64) float bound[kPointWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto dx =
          Gap(d, hn::Load(d, node.min_x + k), hn::Load(d, node.max_x + k), hn::Set(d, pair.x));
      const auto dy =
          Gap(d, hn::Load(d, node.min_y + k), hn::Load(d, node.max_y + k), hn::Set(d, pair.y));
      const auto dz =
          Gap(d, hn::Load(d, node.min_z + k), hn::Load(d, node.max_z + k), hn::Set(d, pair.z));
      const auto apart = hn::Sub(Norm(dx, dy, dz), radius);
      const auto least =
          hn::Max(apart, CutDistance(d, planes_.Ahead(node, k, offset),
                                     planes_.Aside(node, k, center), radius, height, rim));
      near |= Below(d, Unless(d, least, expanded >> k), limit, &dropped) << k;
      hn::Store(least, d, bound + k);
    }
    near &= ((1U << static_cast<std::uint32_t>(node.count)) - 1U) & ~expanded;
    Drop(index, hn::GetLane(hn::MinOfLanes(d, dropped)));
    PushChildren(pair, index, near, bound,
                 [&](int k, Pair* child) { SetBox(pair.box * kPointWidth + k, child); });
  }

  struct Middle {
    float x, y, z, radius;
  };
  static Middle MiddleOf(const Pair& pair) {
    float size_sq = 0.0F;
    for (int i = 0; i < 3; ++i) {
      size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
    }
    return {0.5F * (pair.min[0] + pair.max[0]), 0.5F * (pair.min[1] + pair.max[1]),
            0.5F * (pair.min[2] + pair.max[2]), 0.5F * std::sqrt(size_sq)};
  }

  HWY_INLINE void Leaves(const Pair& pair) {
    if constexpr (kBoxes) {
      Leaves(pair, t_.box_tiles[~pair.box]);
    } else {
      PointTile room;
      Leaves(pair, t_.points->tile(static_cast<std::size_t>(~pair.box), &room));
    }
  }

  // Up to 8 spheres against 16 points or boxes: for each of these the least distance to a sphere.
  template <class Tile>
  HWY_INLINE void Leaves(const Pair& pair, const Tile& tile) {
    ++t_.leaf_pairs;
    const std::int32_t index = Enter(pair);
    const SphereLeaf& leaf = t_.sphere_leaves[~pair.sphere];
    const std::int32_t tile_index = ~pair.box;
    Posed posed;
    Pose(t_, leaf.x, leaf.y, leaf.z, &posed);
    const float* radius = kExact ? leaf.cover_radius : leaf.inner_radius;
    const float offset = t_.offset + SupportOf(pair.slot);
    const PointTag d;
    alignas(64) float distance[kPointWidth];
    bool is_near = false;
    const auto limit = hn::Set(d, Limit());
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto ahead = planes_.Ahead(tile, k, offset);
      auto nearest = hn::Set(d, kFarAway);
      for (int b = 0; b < leaf.count; ++b) {
        const auto to_center = Distance(tile, k, posed.x[b], posed.y[b], posed.z[b]);
        nearest = hn::Min(nearest, hn::Sub(to_center, hn::Set(d, radius[b])));
      }
      nearest = hn::Max(nearest, ahead);
      is_near = is_near || !hn::AllFalse(d, hn::Lt(nearest, limit));
      hn::Store(nearest, d, distance + k);
    }
    if (!kExact) return Nearest(pair, distance);
    if (is_near) LookCloser(pair, leaf, posed, tile, offset, distance);
    auto least = hn::Load(d, distance);
    for (std::size_t k = hn::Lanes(d); k < static_cast<std::size_t>(kPointWidth);
         k += hn::Lanes(d)) {
      least = hn::Min(least, hn::Load(d, distance + k));
    }
    const float left = hn::GetLane(hn::MinOfLanes(d, least));
    if (index >= 0) front_->leave(index, left + gain_);
    if (is_near) {
      Candidates(tile_index, tile.count, distance);
    } else {
      Drop(left);
    }
  }

  // Unused lanes are far away.
  void Nearest(const Pair& pair, const float* inner) {
    for (int k = 0; k < kPointWidth; ++k) {
      if (!(inner[k] < t_.inner_distance)) continue;
      t_.inner_distance = inner[k];
      t_.inner_tile = ~pair.box;
      t_.inner_lane = k;
      t_.inner_leaf = ~pair.sphere;
    }
  }

  // What the plane leaves of the spheres, and how far the points are at most.
  template <class Tile>
  HWY_INLINE void LookCloser(const Pair& pair, const SphereLeaf& leaf, const Posed& posed,
                             const Tile& tile, float offset, float* distance) {
    const PointTag d;
    const SphereTag spheres;
    alignas(64) float height[kSphereWidth], rim[kSphereWidth], inner[kPointWidth];
    for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(spheres)) {
      const auto over =
          hn::Sub(hn::Set(spheres, offset),
                  planes_.Along(spheres, hn::Load(spheres, posed.x + b),
                                hn::Load(spheres, posed.y + b), hn::Load(spheres, posed.z + b)));
      hn::Store(over, spheres, height + b);
      hn::Store(RimRadius(spheres, hn::Load(spheres, leaf.cover_radius + b), over, t_.rounding),
                spheres, rim + b);
    }
    bool is_nearer = false;
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto ahead = planes_.Ahead(tile, k, offset);
      auto nearest = hn::Set(d, kFarAway), nearest_inner = nearest;
      for (int b = 0; b < leaf.count; ++b) {
        const float center[3] = {posed.x[b], posed.y[b], posed.z[b]};
        const auto radius = hn::Set(d, leaf.cover_radius[b]);
        const auto to_center = Distance(tile, k, center[0], center[1], center[2]);
        const auto cut = CutDistance(d, ahead, planes_.Aside(tile, k, center), radius,
                                     hn::Set(d, height[b]), hn::Set(d, rim[b]));
        nearest = hn::Min(nearest, hn::Max(hn::Sub(to_center, radius), cut));
        nearest_inner =
            hn::Min(nearest_inner, hn::Sub(to_center, hn::Set(d, leaf.inner_radius[b])));
      }
      hn::Store(hn::Max(nearest, hn::Load(d, distance + k)), d, distance + k);
      hn::Store(nearest_inner, d, inner + k);
      is_nearer =
          is_nearer || !hn::AllFalse(d, hn::Lt(nearest_inner, hn::Set(d, t_.inner_distance)));
    }
    if (!is_nearer || t_.nearer == nullptr) return;
    Nearest(pair, inner);
    t_.nearer(t_.context);
  }

  // The most promising first: it may spare the others.
  void Candidates(std::int32_t tile, int count, const float* bound) {
    int first = 0;
    for (int k = 1; k < count; ++k) first = bound[k] < bound[first] ? k : first;
    Candidate(tile, first, bound[first]);
    for (int k = 0; k < count; ++k) {
      if (k != first) Candidate(tile, k, bound[k]);
    }
  }

  HWY_INLINE void Candidate(std::int32_t tile, int k, float bound) {
    if (bound <= t_.interior) {
      t_.may_be_inside = true;
    } else if (bound < t_.threshold) {
      t_.candidate(t_.context, tile, k, bound);
    } else {
      Drop(bound);
    }
  }

  Traversal& t_;
  const Planes planes_;
  Front* front_;
  float gain_ = 0.0F;  // from a bound found now to one that the front keeps
  bool is_full_ = false, is_cut_short_ = false;
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
