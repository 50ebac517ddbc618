// Dual-tree traversal: branch and bound over pairs of a sphere node and a box node. Compiled once
// per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_DUAL_TREE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_DUAL_TREE_INL_H
#undef IST_PROXIMITY_DUAL_TREE_INL_H
#else
#define IST_PROXIMITY_DUAL_TREE_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "internal/bvh/prefetch.h"
#include "internal/bvh/traversal_stack.h"
#include "proximity/dual_tree.h"
#include "proximity/pair_bounds-inl.h"
#include "proximity/supporting_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace dual_tree {
namespace hn = hwy::HWY_NAMESPACE;

// Parents that are no pair of the front: none is kept, or the pair itself is in the front (from
// kReopened down) and is expanded again.
constexpr std::int32_t kNoParent = -1, kReopened = -2;

constexpr std::uint64_t kDeadlineInterval = 8;  // node pairs between two looks at the clock

// A sphere leaf and a tile, for the visitor.
template <class Tile>
struct LeafPair {
  const SphereLeaf& leaf;
  const Tile& tile;
  std::int32_t leaf_index, tile_index;
  const PosedCenters& centers;
  float plane_offset;  // [m] of the leaf's supporting plane
  float radius;        // [m] largest of the tile's points; 0 without extents
  const PlaneFrame& planes;
};

// Lower bounds of a tile's points.
struct TileBound {
  float least;  // [m]
  float cover;  // [m] of cover distances, where `least` may be more and the link has holes
};

// A visitor has
//   float Limit() const;                      pairs whose bound is not below it are pruned
//   bool IsSettled() const;                   nothing that is left can matter
//   bool Stops(node_pairs, PlaneFrame*);      called before each expansion: the search ends
//   float BoundOfBox(const Pair&, radius);    a bound that prunes the pair, or -inf
//   kHasExtent, float LargestRadius(const Pair&)   where obstacles have a radius, see Radius()
//   TileBound Visit(const LeafPair<Tile>&);   returns the least lower bound of the tile's points
//   float pruned_bound                        [m] least bound of what it pruned itself
template <class Visitor, class Bvh>
class DualTree {
 public:
  DualTree(const DualTreeInput<Bvh>& input, Visitor* visitor)
      : in_(input),
        visitor_(*visitor),
        nodes_(input.tree->nodes().data()),
        leaves_(input.tree->leaves().data()),
        box_nodes_(input.bvh->nodes().data()),
        front_(input.front) {
    planes_.Set(input.planes);
  }

  void Run() {
    if (front_ == nullptr || front_->empty()) {
      stack_.push(Root());
      Traverse();
    } else {
      ResumeFront();
    }
    if (front_ != nullptr) front_->end(!is_cut_short_ && !front_is_full_);
  }

  float pruned_bound() const { return pruned_bound_; }
  float cover_bound() const { return cover_bound_; }
  bool stopped() const { return stopped_; }
  std::uint64_t node_pairs() const { return node_pairs_; }
  std::uint64_t leaf_pairs() const { return leaf_pairs_; }

 private:
  // Expands pairs until the stack is empty.
  void Traverse() {
    while (!stack_.empty()) {
      const Pair pair = stack_.pop();
      const float radius = Radius(pair);
      if (!(pair.bound < Limit(radius))) {
        PrunePair(pair, radius);
        continue;
      }
      if (visitor_.IsSettled()) {
        // The rest is outside and too far, or it is the depth search's.
        Prune(in_.inside_bound);
        is_cut_short_ = true;
        stack_.clear();
        return;
      }
      if (visitor_.Stops(++node_pairs_, &planes_)) {
        stopped_ = is_cut_short_ = true;
        Prune(Less(pair.bound, radius));
        while (!stack_.empty()) {
          const Pair left = stack_.pop();
          Prune(Less(left.bound, Radius(left)));
        }
        return;
      }
      const float bound_of_box = visitor_.BoundOfBox(pair, radius);
      if (bound_of_box > pair.bound) {
        const float bound = Less(bound_of_box, radius);
        Prune(bound);
        if (pair.parent >= 0) front_->prune(pair.parent / kBoxWidth, bound);
        continue;
      }
      Expand(pair, radius);
    }
  }

  // Where obstacles have extents, whatever is pruned or kept in the front is the bound of their
  // spheres: the bound of a pair less the largest radius in its box. Pairs on the stack carry the
  // bounds of the obstacles themselves. Without extents, the three do nothing.
  HWY_INLINE float Radius(const Pair& pair) const {
    if constexpr (Visitor::kHasExtent) return visitor_.LargestRadius(pair);
    return 0.0F;
  }
  HWY_INLINE float Limit(float radius) const {
    if constexpr (Visitor::kHasExtent) return visitor_.Limit() + radius;
    return visitor_.Limit();
  }
  HWY_INLINE static float Less(float bound, float radius) {
    if constexpr (Visitor::kHasExtent) return bound - radius;
    return bound;
  }

  void Expand(const Pair& pair, float radius) {
    if (pair.sphere < 0 && pair.box < 0) {
      VisitLeaves(pair, radius);
    } else if (pair.sphere < 0 || (pair.box >= 0 && BoxIsLarger(pair))) {
      ExpandBox(pair, radius);
    } else {
      ExpandSphere(pair, radius);
    }
  }

  // Expands the pairs of the last traversal's front of which what was pruned may matter now, the
  // most promising first.
  void ResumeFront() {
    std::array<std::int32_t, BvttFront::kMaxPairs> pairs;
    const std::size_t count = FindOpenPairs(pairs.data());
    const float* stored = front_->stored_bounds();
    std::sort(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(count),
              [stored](std::int32_t a, std::int32_t b) { return stored[a] < stored[b]; });
    for (std::size_t i = 0; i < count; ++i) {
      const float bound = stored[pairs[i]] - front_->offset();
      const float cover = front_->stored_cover_bounds()[pairs[i]] - front_->offset();
      const bool is_outside = cover > in_.inside_bound;
      if (stopped_ || (is_outside && !(bound < visitor_.Limit()))) {
        Prune(is_outside ? bound : std::min(bound, cover));
        cover_bound_ = std::min(cover_bound_, cover);
        continue;
      }
      Reopen(pairs[i], std::min(bound, cover));
      Traverse();
      if (is_cut_short_ && !stopped_) return;
    }
  }

  // The pairs whose stored bound is below the limit, and those whose points may have come inside
  // through a hole; the least bound of the others is pruned.
  std::size_t FindOpenPairs(std::int32_t* pairs) {
    const BoxTag d;
    const float offset = front_->offset();
    const auto limit = hn::Set(d, std::min(visitor_.Limit() + offset, kFarAway));
    const auto inside_limit = hn::Set(d, in_.inside_bound + offset);
    auto pruned = hn::Set(d, kFarAway), covers = pruned;
    std::size_t count = 0;
    for (std::size_t i = 0; i < front_->size(); i += hn::Lanes(d)) {
      const auto stored = hn::LoadU(d, front_->stored_bounds() + i);
      const auto cover = hn::LoadU(d, front_->stored_cover_bounds() + i);
      const auto is_open = hn::Or(hn::Lt(stored, limit), hn::Le(cover, inside_limit));
      pruned = hn::Min(pruned, hn::IfThenElse(is_open, pruned, stored));
      covers = hn::Min(covers, hn::IfThenElse(is_open, covers, cover));
      for (std::uint32_t bits = MaskBits(d, is_open); bits != 0; bits &= bits - 1) {
        pairs[count++] = static_cast<std::int32_t>(i + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      }
    }
    Prune(hn::GetLane(hn::MinOfLanes(d, pruned)) - offset);
    cover_bound_ = hn::GetLane(hn::MinOfLanes(d, covers)) - offset;
    return count;
  }

  // The bound of a reopened pair is only that of what was pruned below it; it is expanded in any
  // case.
  void Reopen(std::int32_t index, float bound) {
    const BvttFront::Pair& kept = front_->pair(index);
    Pair pair = Root();
    pair.parent = kReopened - index;
    pair.bound = bound;
    if (kept.sphere != BvttFront::kRoot) {
      const SphereNode& node = nodes_[kept.sphere / kSphereWidth];
      const int k = kept.sphere % kSphereWidth;
      const float* r = in_.R_OL;
      pair.sphere_slot = kept.sphere;
      pair.sphere = node.child[k];
      pair.x = r[0] * node.x[k] + r[1] * node.y[k] + r[2] * node.z[k] + in_.p_OL[0];
      pair.y = r[3] * node.x[k] + r[4] * node.y[k] + r[5] * node.z[k] + in_.p_OL[1];
      pair.z = r[6] * node.x[k] + r[7] * node.y[k] + r[8] * node.z[k] + in_.p_OL[2];
      pair.radius = node.radius[k];
    }
    if (kept.box != BvttFront::kRoot) SetBox(kept.box, &pair);
    stack_.push(pair);
  }

  HWY_INLINE void SetBox(std::int32_t slot, Pair* pair) const {
    const BoxNode& node = box_nodes_[slot / kBoxWidth];
    const int k = slot % kBoxWidth;
    pair->box_slot = slot;
    pair->box = node.child[k];
    pair->min[0] = node.min_x[k];
    pair->min[1] = node.min_y[k];
    pair->min[2] = node.min_z[k];
    pair->max[0] = node.max_x[k];
    pair->max[1] = node.max_y[k];
    pair->max[2] = node.max_z[k];
  }

  // The volumes of the root pair are never compared: it is expanded on the sphere's side first.
  Pair Root() const {
    Pair root{};
    root.bound = -std::numeric_limits<float>::infinity();
    root.sphere_slot = root.box_slot = BvttFront::kRoot;
    root.parent = kNoParent;
    root.radius = std::numeric_limits<float>::infinity();
    root.box = in_.bvh->root();
    for (int i = 0; i < 3; ++i) {
      root.min[i] = -kFarAway;
      root.max[i] = kFarAway;
    }
    return root;
  }

  void Prune(float bound) { pruned_bound_ = std::min(pruned_bound_, bound); }

  // Prunes a pair that was pushed before the limit fell.
  void PrunePair(const Pair& pair, float radius) {
    const float bound = Less(pair.bound, radius);
    Prune(bound);
    if (pair.parent >= 0) front_->prune(pair.parent / kBoxWidth, bound);
  }

  // Prunes some children of a pair.
  void PruneChildren(std::int32_t front_index, float bound) {
    Prune(bound);
    if (front_index >= 0) front_->prune(front_index, bound);
  }

  // Gives a pair that is expanded now its place in the front.
  std::int32_t EnterFront(const Pair& pair) {
    if (front_ == nullptr) return BvttFront::kFull;
    if (pair.parent <= kReopened) {
      front_->reopen(kReopened - pair.parent);
      return kReopened - pair.parent;
    }
    const std::int32_t index = front_->add(pair.sphere_slot, pair.box_slot);
    front_is_full_ = front_is_full_ || index == BvttFront::kFull;
    if (index >= 0 && pair.parent >= 0) {
      front_->mark_expanded(pair.parent / kBoxWidth, pair.parent % kBoxWidth);
    }
    return index;
  }

  // Children that are pairs of the front themselves: they have a place, and a bound, of their own.
  std::uint32_t ExpandedChildren(std::int32_t front_index) const {
    return front_index < 0 ? 0U : front_->pair(front_index).expanded;
  }

  // Pushes the children whose bits are set, the nearest on top. `set_child` fills in the volume and
  // the slot of the side that is expanded.
  template <class SetChild>
  HWY_INLINE void PushChildren(const Pair& pair, std::int32_t front_index, std::uint32_t near,
                               const float* bound, const SetChild& set_child) {
    std::array<int, kBoxWidth> order;  // farthest first
    int count = 0;
    for (; near != 0; near &= near - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
      int at = count++;
      for (; at > 0 && bound[order[static_cast<std::size_t>(at - 1)]] < bound[k]; --at) {
        order[static_cast<std::size_t>(at)] = order[static_cast<std::size_t>(at - 1)];
      }
      order[static_cast<std::size_t>(at)] = k;
    }
    for (int i = 0; i < count; ++i) {
      const int k = order[static_cast<std::size_t>(i)];
      Pair& child = stack_.push();
      child = pair;
      child.bound = bound[k];
      child.parent = front_index < 0 ? kNoParent : kBoxWidth * front_index + k;
      set_child(k, &child);
    }
  }

  HWY_INLINE const float* ChildSupports(std::int32_t node) const {
    return SupportsOf(node, nodes_, leaves_, in_.supports);
  }
  HWY_INLINE float SupportOfSlot(std::int32_t slot) const {
    return ChildSupports(slot / kSphereWidth)[slot % kSphereWidth];
  }

  void ExpandSphere(const Pair& pair, float radius) {
    const std::int32_t front_index = EnterFront(pair);
    const std::uint32_t expanded = ExpandedChildren(front_index);
    const SphereNode& node = nodes_[pair.sphere];
    const float* support = ChildSupports(pair.sphere);
    if (pair.sphere_slot >= 0) {
      TightenSupport(support, &in_.supports->support[static_cast<std::size_t>(pair.sphere_slot)]);
    }
    PosedCenters centers;
    PoseCenters(in_, node.x, node.y, node.z, &centers);
    alignas(64) float bound[kSphereWidth];
    const ChildrenBelow children = BoundSphereChildren(
        pair, node, centers, support, planes_, in_.rounding, Limit(radius), expanded, bound);
    PruneChildren(front_index, Less(children.pruned_bound, radius));
    PushChildren(pair, front_index, children.bits, bound, [&](int k, Pair* child) {
      child->sphere_slot = pair.sphere * kSphereWidth + k;
      child->sphere = node.child[k];
      child->x = centers.x[k];
      child->y = centers.y[k];
      child->z = centers.z[k];
      child->radius = node.radius[k];
    });
  }

  void ExpandBox(const Pair& pair, float radius) {
    const std::int32_t front_index = EnterFront(pair);
    const std::uint32_t expanded = ExpandedChildren(front_index);
    alignas(64) float bound[kBoxWidth];
    const ChildrenBelow children =
        BoundBoxChildren(pair, box_nodes_[pair.box], SupportOfSlot(pair.sphere_slot), planes_,
                         in_.rounding, Limit(radius), expanded, bound);
    PruneChildren(front_index, Less(children.pruned_bound, radius));
    PushChildren(pair, front_index, children.bits, bound, [&](int k, Pair* child) {
      SetBox(pair.box * kBoxWidth + k, child);
      prefetch_child(*in_.bvh, child->box);
    });
  }

  HWY_INLINE void VisitLeaves(const Pair& pair, float radius) {
    ++leaf_pairs_;
    const std::int32_t front_index = EnterFront(pair);
    const SphereLeaf& leaf = leaves_[~pair.sphere];
    PosedCenters centers;
    PoseCenters(in_, leaf.x, leaf.y, leaf.z, &centers);
    typename Bvh::Tile scratch;
    const typename Bvh::Tile& tile = in_.bvh->tile(static_cast<std::size_t>(~pair.box), &scratch);
    const float plane_offset = planes_.offset() + SupportOfSlot(pair.sphere_slot);
    const TileBound bound = visitor_.Visit(LeafPair<typename Bvh::Tile>{
        leaf, tile, ~pair.sphere, ~pair.box, centers, plane_offset, radius, planes_});
    if (front_index < 0) return;
    front_->prune(front_index, Less(bound.least, radius));
    if (bound.cover < kFarAway) front_->keep_cover_bound(front_index, bound.cover);
  }

  const DualTreeInput<Bvh>& in_;
  Visitor& visitor_;
  const SphereNode* nodes_;
  const SphereLeaf* leaves_;
  const BoxNode* box_nodes_;
  BvttFront* front_;
  PlaneFrame planes_;
  float pruned_bound_ = std::numeric_limits<float>::infinity();
  float cover_bound_ = std::numeric_limits<float>::infinity();  // see DualTreeResult
  std::uint64_t node_pairs_ = 0, leaf_pairs_ = 0;
  bool front_is_full_ = false;
  bool is_cut_short_ = false;  // the stack was not emptied
  bool stopped_ = false;       // by the visitor
  TraversalStack<Pair, stack_capacity(kMaxTreeLevels + kMaxBoxLevels, kBoxWidth)> stack_;
};

}  // namespace dual_tree
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_DUAL_TREE_INL_H
