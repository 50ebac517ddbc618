// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/dual_tree.cpp"
#include "proximity/dual_tree.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#include "proximity/dual_tree-inl.h"
#include "proximity/extent_refinement.h"
#include "proximity/refinement.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace dual_tree {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::uint64_t kNever = std::numeric_limits<std::uint64_t>::max();
// New supporting planes cost as much as some dozens of pairs. They are worth it where the traversal
// goes on for so many node pairs after the upper bound has fallen.
constexpr std::uint64_t kPairsBeforePlanes = 8;

// Distances of a tile's points from the spheres of a leaf, with one radius of each.
template <class Tile>
HWY_INLINE hn::Vec<BoxTag> LeastDistance(const LeafPair<Tile>& pair, const float* radius,
                                         std::size_t k) {
  const BoxTag d;
  auto least = hn::Set(d, kFarAway);
  for (int b = 0; b < pair.leaf.count; ++b) {
    const auto to_center =
        Distance(pair.tile, k, pair.centers.x[b], pair.centers.y[b], pair.centers.z[b]);
    least = hn::Min(least, hn::Sub(to_center, hn::Set(d, radius[b])));
  }
  return hn::Max(least, pair.planes.Height(pair.tile, k, pair.plane_offset));
}

// Refines every point whose lower bound, by the clipped cover spheres, is below the prune bound.
template <class Policy, class Bvh>
class RefiningVisitor {
 public:
  static constexpr bool kHasExtent = Policy::kHasExtent;

  RefiningVisitor(const DualTreeInput<Bvh>& input, Policy* policy)
      : in_(input), policy_(*policy), prune_bound_(input.prune_bound) {}

  float Limit() const { return std::max(prune_bound_, in_.inside_bound); }
  bool IsSettled() const {
    return may_be_inside_ && prune_bound_ <= in_.inside_bound && policy_.leaves_inside();
  }

  bool Stops(std::uint64_t node_pairs, PlaneFrame* planes) {
    node_pairs_ = node_pairs;
    if (node_pairs > next_planes_) {
      next_planes_ = kNever;
      SupportingPlanes updated;
      if (policy_.update_planes(&updated)) planes->Set(updated);
    }
    return policy_.is_crowded(node_pairs) ||
           (node_pairs % kDeadlineInterval == 0 && policy_.deadline_passed());
  }

  // A bound of the pair's box for the whole link, if it makes the pair prunable; else -inf.
  HWY_INLINE float BoundOfBox(const Pair& pair, float radius) {
    if (pair.box_slot < 0) return -std::numeric_limits<float>::infinity();
    const float bound = policy_.bound_box(pair.box_slot, pair.box, pair.min, pair.max);
    return bound >= PruneBound(radius) ? bound : -std::numeric_limits<float>::infinity();
  }

  // [m] No obstacle in a pair's box has a larger radius.
  HWY_INLINE float LargestRadius(const Pair& pair) const {
    return policy_.largest_radius(pair.box_slot, pair.min, pair.max);
  }

  template <class Tile>
  HWY_INLINE TileBound Visit(const LeafPair<Tile>& pair) {
    const BoxTag d;
    alignas(64) float bound[kBoxWidth];
    float visit_limit = Limit();
    if constexpr (kHasExtent) visit_limit += pair.radius;
    const auto limit = hn::Set(d, visit_limit);
    bool is_near = false;
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      const auto least = LeastDistance(pair, pair.leaf.cover_radius, k);
      is_near = is_near || !hn::AllFalse(d, hn::Lt(least, limit));
      hn::Store(least, d, bound + k);
    }
    if (is_near) ClipSpheres(pair, bound);
    const float least = Least(bound);
    if (!is_near) {
      Prune(least, pair.radius);
      return {least, kFarAway};
    }
    RefineTile(pair.tile_index, pair.tile.count, bound, pair.radius);
    if constexpr (Policy::kBoundsPoints) {
      const float refined = Least(bound);
      if (!policy_.has_holes()) return {refined, kFarAway};
      if (least > in_.inside_bound && refined > least) return {refined, least};
    }
    return {least, kFarAway};
  }

  float pruned_bound() const { return pruned_bound_; }
  bool may_be_inside() const { return may_be_inside_; }

 private:
  HWY_INLINE float PruneBound(float radius) const {
    if constexpr (kHasExtent) return prune_bound_ + radius;
    return prune_bound_;
  }
  HWY_INLINE void Prune(float bound, float radius) {
    if constexpr (kHasExtent) bound -= radius;
    pruned_bound_ = std::min(pruned_bound_, bound);
  }

  static HWY_INLINE float Least(const float* bound) {
    const BoxTag d;
    auto least = hn::Load(d, bound);
    for (std::size_t k = hn::Lanes(d); k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      least = hn::Min(least, hn::Load(d, bound + k));
    }
    return hn::GetLane(hn::MinOfLanes(d, least));
  }

  // Raises the bounds to those of the clipped spheres.
  template <class Tile>
  HWY_INLINE void ClipSpheres(const LeafPair<Tile>& pair, float* bound) const {
    const BoxTag d;
    const SphereTag spheres;
    alignas(64) float plane_height[kSphereWidth], rim_radius[kSphereWidth];
    for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(spheres)) {
      const auto height =
          hn::Sub(hn::Set(spheres, pair.plane_offset),
                  pair.planes.AlongNormal(spheres, hn::Load(spheres, pair.centers.x + b),
                                          hn::Load(spheres, pair.centers.y + b),
                                          hn::Load(spheres, pair.centers.z + b)));
      hn::Store(height, spheres, plane_height + b);
      hn::Store(
          RimRadius(spheres, hn::Load(spheres, pair.leaf.cover_radius + b), height, in_.rounding),
          spheres, rim_radius + b);
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      const auto height = pair.planes.Height(pair.tile, k, pair.plane_offset);
      auto least = hn::Set(d, kFarAway);
      for (int b = 0; b < pair.leaf.count; ++b) {
        const float center[3] = {pair.centers.x[b], pair.centers.y[b], pair.centers.z[b]};
        const auto radius = hn::Set(d, pair.leaf.cover_radius[b]);
        const auto to_center = Distance(pair.tile, k, center[0], center[1], center[2]);
        const auto clipped =
            ClippedDistance(d, height, pair.planes.Lateral(pair.tile, k, center), radius,
                            hn::Set(d, plane_height[b]), hn::Set(d, rim_radius[b]));
        least = hn::Min(least, hn::Max(hn::Sub(to_center, radius), clipped));
      }
      hn::Store(hn::Max(least, hn::Load(d, bound + k)), d, bound + k);
    }
  }

  // The most promising point first: it may spare the others. Bounds are raised to what is known of
  // the points then.
  void RefineTile(std::int32_t tile, int count, float* bound, float radius) {
    int first = 0;
    for (int k = 1; k < count; ++k) first = bound[k] < bound[first] ? k : first;
    RefinePoint(tile, first, &bound[first], radius);
    for (int k = 0; k < count; ++k) {
      if (k != first) RefinePoint(tile, k, &bound[k], radius);
    }
  }

  HWY_INLINE void RefinePoint(std::int32_t tile, int k, float* known, float radius) {
    const float bound = *known;
    if (IsSettled()) return Prune(std::max(bound, in_.inside_bound), radius);
    const bool is_near = bound <= in_.inside_bound;
    if (is_near && !policy_.is_outside(tile, k)) {
      may_be_inside_ = true;
      prune_bound_ = std::min(prune_bound_, policy_.traversal_prune_bound());
    } else if (is_near || bound < PruneBound(radius)) {
      const float prune_bound = policy_.refine(tile, k, bound);
      if constexpr (Policy::kBoundsPoints) *known = std::max(bound, policy_.refined_bound());
      if (prune_bound < prune_bound_) {
        prune_bound_ = prune_bound;
        next_planes_ = node_pairs_ + kPairsBeforePlanes;
      }
    } else {
      Prune(bound, radius);
    }
  }

  const DualTreeInput<Bvh>& in_;
  Policy& policy_;
  float prune_bound_;
  float pruned_bound_ = std::numeric_limits<float>::infinity();
  bool may_be_inside_ = false;
  std::uint64_t node_pairs_ = 0, next_planes_ = kPairsBeforePlanes;
};

// Finds the box that is nearest to the inner spheres.
class InnerVisitor {
 public:
  static constexpr bool kHasExtent = false;

  explicit InnerVisitor(float prune_bound) : prune_bound_(prune_bound) {}

  float Limit() const { return std::min(prune_bound_, nearest_.distance); }
  bool IsSettled() const { return false; }
  bool Stops(std::uint64_t /*node_pairs*/, PlaneFrame* /*planes*/) const { return false; }
  static float BoundOfBox(const Pair& /*pair*/, float /*radius*/) {
    return -std::numeric_limits<float>::infinity();
  }

  template <class Tile>
  HWY_INLINE TileBound Visit(const LeafPair<Tile>& pair) {
    const BoxTag d;
    alignas(64) float distance[kBoxWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      hn::Store(LeastDistance(pair, pair.leaf.inner_radius, k), d, distance + k);
    }
    for (int k = 0; k < kBoxWidth; ++k) {  // unused slots are far away
      if (!(distance[k] < nearest_.distance)) continue;
      nearest_.distance = distance[k];
      nearest_.tile = pair.tile_index;
      nearest_.lane = k;
      nearest_.leaf = pair.leaf_index;
    }
    return {nearest_.distance, kFarAway};
  }

  const NearestToInnerSpheres& nearest() const { return nearest_; }

 private:
  float prune_bound_;
  NearestToInnerSpheres nearest_;
};

template <class Policy, class Bvh>
DualTreeResult Search(const DualTreeInput<Bvh>& input, Policy* policy) {
  using Visitor = RefiningVisitor<Policy, Bvh>;
  Visitor visitor(input, policy);
  DualTree<Visitor, Bvh> traversal(input, &visitor);
  traversal.Run();
  return {std::min(traversal.pruned_bound(), visitor.pruned_bound()),
          traversal.cover_bound(),
          visitor.may_be_inside(),
          traversal.stopped(),
          traversal.node_pairs(),
          traversal.leaf_pairs()};
}

}  // namespace dual_tree

DualTreeResult DualTreeSearchPoints(const DualTreeInput<PointBvh>& input, PointRefinement* policy) {
  return dual_tree::Search(input, policy);
}

DualTreeResult DualTreeSearchBoxes(const DualTreeInput<BoxBvh>& input, BoxRefinement* policy) {
  return dual_tree::Search(input, policy);
}

DualTreeResult DualTreeSearchPointExtents(const DualTreeInput<PointBvh>& input,
                                          PointExtentRefinement* policy) {
  return dual_tree::Search(input, policy);
}

DualTreeResult DualTreeSearchBoxExtents(const DualTreeInput<BoxBvh>& input,
                                        BoxExtentRefinement* policy) {
  return dual_tree::Search(input, policy);
}

NearestToInnerSpheres DualTreeNearestToInnerSpheres(const DualTreeInput<BoxBvh>& input) {
  dual_tree::InnerVisitor visitor(input.prune_bound);
  dual_tree::DualTree<dual_tree::InnerVisitor, BoxBvh> traversal(input, &visitor);
  traversal.Run();
  NearestToInnerSpheres nearest = visitor.nearest();
  nearest.node_pairs = traversal.node_pairs();
  nearest.leaf_pairs = traversal.leaf_pairs();
  return nearest;
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(DualTreeSearchPoints);
HWY_EXPORT(DualTreeSearchBoxes);
HWY_EXPORT(DualTreeSearchPointExtents);
HWY_EXPORT(DualTreeSearchBoxExtents);
HWY_EXPORT(DualTreeNearestToInnerSpheres);

DualTreeResult search_dual_tree(const DualTreeInput<PointBvh>& input, PointRefinement* policy) {
  return HWY_DYNAMIC_DISPATCH(DualTreeSearchPoints)(input, policy);
}

DualTreeResult search_dual_tree(const DualTreeInput<BoxBvh>& input, BoxRefinement* policy) {
  return HWY_DYNAMIC_DISPATCH(DualTreeSearchBoxes)(input, policy);
}

DualTreeResult search_dual_tree(const DualTreeInput<PointBvh>& input,
                                PointExtentRefinement* policy) {
  return HWY_DYNAMIC_DISPATCH(DualTreeSearchPointExtents)(input, policy);
}

DualTreeResult search_dual_tree(const DualTreeInput<BoxBvh>& input, BoxExtentRefinement* policy) {
  return HWY_DYNAMIC_DISPATCH(DualTreeSearchBoxExtents)(input, policy);
}

NearestToInnerSpheres find_nearest_to_inner_spheres(const DualTreeInput<BoxBvh>& input) {
  return HWY_DYNAMIC_DISPATCH(DualTreeNearestToInnerSpheres)(input);
}

}  // namespace ist
#endif
