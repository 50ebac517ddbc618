// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/field_search.cpp"
#include "proximity/field_search.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "internal/bvh/padded_box.h"
#include "internal/bvh/prefetch.h"
#include "internal/geometry/float_rounding.h"
#include "proximity/field_bounds-inl.h"
#include "proximity/refinement.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace field_search {
namespace hn = hwy::HWY_NAMESPACE;
using Side = NearSurface::Side;

// So many points are measured before another search is better: where very many are about equally
// near, and where the field's cells are too large. Tolerance 0 needs more of them.
constexpr int kMaxMeasured = 100, kMaxMeasuredExact = 256;
// A search that has visited so many tiles and measured nothing measures a point: the link's
// supporting plane across its direction may separate the link from all others, as from a table.
constexpr std::uint64_t kTilesBeforePlanes = 4;
// So many points whose sides neither the field nor an earlier one tells are asked about one by one.
constexpr int kMaxAsked = 256;

class Search {
 public:
  Search(const FieldSearchInput& input, PointRefinement* policy)
      : in_(input),
        policy_(*policy),
        queue_(*input.queue),
        bounds_(input),
        limit_(input.prune_bound + input.ahead) {}

  FieldSearchResult Run() {
    Begin();
    Entry entry{};
    while (!queue_.empty() && queue_.least() < limit_ && !result_.gave_up && result_.has_time) {
      result_.has_time = !policy_.deadline_passed();
      if (!result_.has_time) break;
      const float bound = queue_.pop(&entry);
      if (has_new_planes_ && entry.lane == FieldQueue::kNoPoint) {
        const float height = bounds_.Height(entry);
        // Near holes no plane tells inside from outside.
        if (height >= limit_ && (bounds_.is_closed() || entry.outside > 0.0F)) {
          Prune(entry, height, bounds_.is_closed() ? height : entry.outside);
          continue;
        }
      }
      if (entry.lane != FieldQueue::kNoPoint) {
        Measure(entry, bound);
      } else if (entry.child < 0) {
        VisitTile(entry);
      } else {
        ExpandNode(entry, bound);
      }
    }
    queue_.for_each([this](float bound, const Entry& left) { Prune(left, bound, left.outside); });
    if (in_.front != nullptr) {
      in_.front->end(is_front_whole_ && !result_.has_inside && !result_.gave_up);
    }
    return result_;
  }

 private:
  // Begins with what the front does not prune, or with the root.
  void Begin() {
    if (in_.front == nullptr || in_.front->empty()) {
      Entry root{};
      root.child = in_.bvh->root();
      root.lane = FieldQueue::kNoPoint;
      root.slots = FieldFront::kAllSlots;
      const PaddedBox box = bounds_of(in_.bvh->nodes()[static_cast<std::size_t>(root.child)]);
      bounds_.PlaceBox(box.min.data(), box.max.data(), &root);
      ExpandNode(root, kMayBeInside);
      return;
    }
    in_.front->remove_if([this](const FieldFront::Part& part) {
      // Near holes a point may come to be inside though no surface has come nearer.
      const bool is_outside = bounds_.is_closed() || part.outside > 0.0F;
      const bool is_pruned = part.bound >= limit_ && is_outside;
      if (is_pruned) {
        Lower(part.bound, part.outside);
      } else {
        PushPart(part);
      }
      return !is_pruned;
    });
  }

  void PushPart(const FieldFront::Part& part) {
    Entry* entry = queue_.push(part.outside > 0.0F ? part.bound : kMayBeInside);
    result_.gave_up = result_.gave_up || entry == nullptr;
    if (entry == nullptr) return;
    entry->outside = part.outside;
    entry->child = part.child;
    entry->lane = FieldQueue::kNoPoint;
    entry->slots = part.slots;
    bounds_.PlaceBox(part.min, part.max, entry);
  }

  void Lower(float bound, float outside) {
    result_.pruned_bound = std::min(result_.pruned_bound, bound);
    result_.outside_bound = std::min(result_.outside_bound, outside);
  }

  void Prune(const Entry& entry, float bound, float outside) {
    Lower(bound, outside);
    if (entry.lane != FieldQueue::kNoPoint) {
      KeepPoint(entry, bound, outside);
    } else {
      Keep(entry, entry.slots, bound, outside);
    }
  }

  // Keeps the bounds of some children of a node, or of a tile, for the poses to come.
  // @returns the number of the part
  std::uint32_t Keep(const Entry& entry, std::uint32_t slots, float bound, float outside) {
    if (in_.front == nullptr) return 0;
    FieldFront::Part part{bound, outside, entry.child, slots, {}, {}};
    std::copy_n(entry.min, 3, part.min);
    std::copy_n(entry.max, 3, part.max);
    return in_.front->add(part);
  }
  void KeepPoint(const Entry& point, float bound, float outside) {
    if (in_.front != nullptr) in_.front->lower(point.slots, bound, outside);
  }

  // Leaves something without a bound that another pose could use.
  void Leave(float bound) {
    is_front_whole_ = false;
    Lower(bound, 0.0F);
  }

  void ExpandNode(const Entry& entry, float entry_bound) {
    Corners corners;
    // The corners say little where the link is nearer than the box is large.
    const bool has_corners = entry_bound > 0.5F * entry.radius;
    if (has_corners) {
      const float least = bounds_.BoundCorners(entry, &corners);
      const float squared = least * least - entry.radius * entry.radius * (1.0F + kSquareError);
      const float bound = squared > 0.0F ? std::sqrt(squared) - kPlaceError : 0.0F;
      if (bound >= limit_) return Prune(entry, bound, entry.outside);
    }
    ++result_.nodes;
    const BoxNode& node = in_.bvh->nodes()[static_cast<std::size_t>(entry.child)];
    Bounds bounds;
    LowerLimit(bounds_.BoundBoxes(node, entry, has_corners ? &corners : nullptr, &bounds));
    const std::uint32_t slots = entry.slots & FirstSlots(node.count);
    const auto [below, bound, outside] = Below(slots, &bounds);
    Lower(bound, outside);
    if (slots != below) Keep(entry, slots & ~below, bound, outside);
    PrefetchLeast(bounds, below, node);
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      Entry* child = Push(bounds, k);
      if (child == nullptr) continue;
      child->child = node.child[k];
      child->lane = FieldQueue::kNoPoint;
      child->slots = FieldFront::kAllSlots;
      child->min[0] = node.min_x[k];
      child->min[1] = node.min_y[k];
      child->min[2] = node.min_z[k];
      child->max[0] = node.max_x[k];
      child->max[1] = node.max_y[k];
      child->max[2] = node.max_z[k];
    }
  }

  // The child that has the least bound is most often the next one to be expanded.
  void PrefetchLeast(const Bounds& bounds, std::uint32_t below, const BoxNode& node) const {
    float least = kFarAway;
    std::int32_t next = 0;
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      next = bounds.distance[k] < least ? node.child[k] : next;
      least = std::min(least, bounds.distance[k]);
    }
    if (below != 0) prefetch_child(*in_.bvh, next);
  }

  void VisitTile(const Entry& entry) {
    ++result_.tiles;
    PointTile scratch;
    const PointTile& tile = in_.bvh->tile(static_cast<std::size_t>(~entry.child), &scratch);
    Bounds bounds;
    LowerLimit(bounds_.BoundPoints(tile, entry, &bounds));
    assert(tile.count > 0);  // LowerLimit() relies on it for every box
    const std::uint32_t part = Keep(entry, FieldFront::kAllSlots, kFarAway, kFarAway);
    std::uint32_t points = FirstSlots(tile.count);
    if (result_.tiles >= kTilesBeforePlanes && measured_ == 0) {
      points &= ~MeasureLeast(entry, part, tile.count, bounds);
    }
    const auto [below, bound, outside] = Below(points, &bounds);
    Lower(bound, outside);
    if (in_.front != nullptr) in_.front->lower(part, bound, outside);
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      Entry* point = Push(bounds, k);
      if (point == nullptr) continue;
      point->child = entry.child;
      point->lane = k;
      point->slots = part;
    }
  }

  static std::uint32_t FirstSlots(int count) { return (1U << static_cast<unsigned>(count)) - 1U; }

  // Measures the point of a tile that has the least bound, if it is known to be outside, and looks
  // for planes across its direction.
  // @param part   of the tile
  // @param count  of its points
  // @returns the slot of the point as a bit; 0: none was measured
  std::uint32_t MeasureLeast(const Entry& tile, std::uint32_t part, int count,
                             const Bounds& bounds) {
    const float* least = std::min_element(bounds.distance, bounds.distance + count);
    const auto k = static_cast<int>(least - bounds.distance);
    if (!(bounds.outside[k] > 0.0F) || !(*least < limit_)) return 0;
    Entry point{};
    point.child = tile.child;
    point.lane = k;
    point.slots = part;
    point.outside = bounds.outside[k];
    point.radius = bounds.radius[k];
    Measure(point, *least);
    SupportingPlanes updated;
    if (policy_.update_planes(&updated)) {
      bounds_.SetPlanes(updated, policy_.link_support());
      has_new_planes_ = true;
    }
    return 1U << static_cast<unsigned>(k);
  }

  // Some point is no farther than this. It will be measured: its lower bound is less.
  void LowerLimit(float distance) { limit_ = std::min(limit_, distance + in_.rounding); }

  // Some slots, by whether they are below the limit.
  struct Split {
    std::uint32_t below;   // bit k: slot k is
    float bound, outside;  // [m] the least of the slots that are not; kFarAway: there are none
  };
  // @param slots   bit k: slot k is asked about
  // @param bounds  those of other slots are overwritten
  HWY_INLINE Split Below(std::uint32_t slots, Bounds* bounds) const {
    const BoxTag d;
    for (std::uint32_t bits = ~slots & FieldFront::kAllSlots; bits != 0; bits &= bits - 1) {
      const auto k = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
      bounds->distance[k] = bounds->outside[k] = kFarAway;
    }
    const auto limit = hn::Set(d, limit_);
    auto pruned = hn::Set(d, kFarAway), outside = pruned;
    std::uint32_t below = 0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      const auto bound = hn::Load(d, bounds->distance + k);
      const auto is_below = hn::Lt(bound, limit);
      pruned = hn::Min(pruned, hn::IfThenElse(is_below, pruned, bound));
      outside =
          hn::Min(outside, hn::IfThenElse(is_below, outside, hn::Load(d, bounds->outside + k)));
      below |= dual_tree::MaskBits(d, is_below) << k;
    }
    return {below & slots, hn::GetLane(hn::MinOfLanes(d, pruned)),
            hn::GetLane(hn::MinOfLanes(d, outside))};
  }

  Entry* Push(const Bounds& bounds, int k) {
    Entry* entry = queue_.push(bounds.distance[k]);
    if (entry == nullptr) {
      result_.gave_up = true;
      return nullptr;
    }
    entry->outside = bounds.outside[k];
    entry->distance = bounds.surface[k];
    entry->radius = bounds.radius[k];
    entry->center[0] = bounds.x[k];
    entry->center[1] = bounds.y[k];
    entry->center[2] = bounds.z[k];
    return entry;
  }

  void Measure(const Entry& point, float bound) {
    if (!(point.outside > 0.0F)) return Ask(point, bound);
    result_.outside_bound = std::min(result_.outside_bound, point.outside);
    KeepPoint(point, bound, point.outside);
    result_.gave_up = ++measured_ > (in_.is_exact ? kMaxMeasuredExact : kMaxMeasured);
    if (result_.gave_up) return;
    const float prune_bound =
        policy_.measure_near(~point.child, point.lane, point.radius + in_.rounding);
    limit_ = std::min(limit_, prune_bound + in_.ahead);
  }

  // Decides on which side a point is. If it is outside, its distance may still not matter.
  void Ask(Entry point, float bound) {
    SideBalls::Found found = policy_.known_side(point.center);
    float margin = round_down(found.margin) - in_.rounding;
    if (!(margin > 0.0F)) {
      // While another point is inside, one that is near the surface is not deeper, whatever its
      // side: a distance costs less than a winding number.
      if (limit_ < 0.0F &&
          policy_.is_surface_within(~point.child, point.lane, -limit_ - in_.rounding)) {
        return Leave(limit_);
      }
      result_.gave_up = ++asked_ > kMaxAsked;
      if (result_.gave_up) return;
      found = policy_.ask_side(~point.child, point.lane, point.distance - in_.rounding);
      margin = round_down(found.margin) - in_.rounding;
    }
    if (found.side == Side::kUnknown) {
      result_.has_time = false;
      return Leave(bound);
    }
    if (found.side == Side::kInside) return MeasureInside(point);
    // A margin that is not known is taken for the least one.
    point.outside = std::max(margin, std::numeric_limits<float>::min());
    if (point.distance >= limit_) {
      return Prune(point, point.distance, point.outside);
    }
    Entry* again = queue_.push(std::max(point.distance, 0.0F));
    result_.gave_up = again == nullptr;
    if (!result_.gave_up) *again = point;
  }

  void MeasureInside(const Entry& point) {
    policy_.measure_inside(~point.child, point.lane, point.radius + in_.rounding);
    result_.has_inside = true;
    result_.gave_up =
        !bounds_.has_depths() || ++measured_ > (in_.is_exact ? kMaxMeasuredExact : kMaxMeasured);
    limit_ = std::min(limit_, policy_.traversal_prune_bound() + in_.ahead);
  }

  const FieldSearchInput& in_;
  PointRefinement& policy_;
  FieldQueue& queue_;
  FieldBounds bounds_;
  float limit_;                   // [m]
  bool has_new_planes_ = false;   // which entries of the queue do not know
  int asked_ = 0, measured_ = 0;  // points
  bool is_front_whole_ = true;    // whether each point is pruned or in the queue
  FieldSearchResult result_;
};

}  // namespace field_search

FieldSearchResult SearchField(const FieldSearchInput& input, PointRefinement* policy) {
  return field_search::Search(input, policy).Run();
}

FieldPlace LookUpField(const DistanceField& field, const Eigen::Vector3d& p_L, float rounding) {
  using field_search::Bounds;
  using field_search::Entry;
  using field_search::FieldBounds;
  FieldSearchInput input;
  input.field = &field;
  input.rounding = rounding;
  for (int axis = 0; axis < 3; ++axis) input.R_LO[4 * axis] = 1.0F;
  PointTile tile{};
  Entry place{};
  float* const rows[3] = {tile.x, tile.y, tile.z};
  for (int axis = 0; axis < 3; ++axis) {
    place.center[axis] = static_cast<float>(p_L[axis]);
    std::fill_n(rows[axis], kBoxWidth, place.center[axis]);
  }
  Bounds bounds;
  FieldBounds(input).BoundPoints(tile, place, &bounds);
  return {bounds.outside[0], bounds.surface[0] - rounding, bounds.radius[0] + rounding};
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(LookUpField);
HWY_EXPORT(SearchField);

FieldPlace look_up_field(const DistanceField& field, const Eigen::Vector3d& p_L, float rounding) {
  return HWY_DYNAMIC_DISPATCH(LookUpField)(field, p_L, rounding);
}

FieldSearchResult search_field(const FieldSearchInput& input, PointRefinement* policy) {
  return HWY_DYNAMIC_DISPATCH(SearchField)(input, policy);
}

}  // namespace ist
#endif
