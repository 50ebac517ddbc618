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
    Entry entry{};
    entry.child = in_.bvh->root();
    entry.lane = FieldQueue::kNoPoint;
    entry.radius = kFarAway;
    ExpandNode(entry, kMayBeInside);
    while (!queue_.empty() && queue_.least() < limit_ && !result_.gave_up && result_.has_time) {
      result_.has_time = !policy_.deadline_passed();
      if (!result_.has_time) break;
      const float bound = queue_.pop(&entry);
      if (has_new_planes_ && entry.lane == FieldQueue::kNoPoint) {
        const float height = bounds_.Height(entry);
        // Near holes no plane tells inside from outside.
        if (height >= limit_ && (bounds_.is_closed() || entry.outside > 0.0F)) {
          Prune(height, bounds_.is_closed() ? height : entry.outside);
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
    if (!queue_.empty()) Prune(queue_.least(), queue_.least_outside());
    return result_;
  }

 private:
  void Prune(float bound, float outside) {
    result_.pruned_bound = std::min(result_.pruned_bound, bound);
    result_.outside_bound = std::min(result_.outside_bound, outside);
  }

  void ExpandNode(const Entry& entry, float entry_bound) {
    Corners corners;
    // The corners say little where the link is nearer than the box is large.
    const bool has_corners = entry_bound > 0.5F * entry.radius;
    if (has_corners) {
      const float least = bounds_.BoundCorners(entry, &corners);
      const float squared = least * least - entry.radius * entry.radius * (1.0F + kSquareError);
      const float bound = squared > 0.0F ? std::sqrt(squared) - kPlaceError : 0.0F;
      if (bound >= limit_) return Prune(bound, entry.outside);
    }
    ++result_.nodes;
    const BoxNode& node = in_.bvh->nodes()[static_cast<std::size_t>(entry.child)];
    Bounds bounds;
    LowerLimit(bounds_.BoundBoxes(node, entry, has_corners ? &corners : nullptr, &bounds));
    const std::uint32_t below = Below(bounds, node.count);
    PrefetchLeast(bounds, below, node);
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      Entry* child = Push(bounds, k);
      if (child == nullptr) continue;
      child->child = node.child[k];
      child->lane = FieldQueue::kNoPoint;
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
    if (result_.tiles >= kTilesBeforePlanes && measured_ == 0)
      MeasureLeast(entry, tile.count, &bounds);
    for (std::uint32_t bits = Below(bounds, tile.count); bits != 0; bits &= bits - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      Entry* point = Push(bounds, k);
      if (point == nullptr) continue;
      point->child = entry.child;
      point->lane = k;
    }
  }

  // Measures the point of a tile that has the least bound, if it is known to be outside, and looks
  // for planes across its direction.
  void MeasureLeast(const Entry& tile, int count, Bounds* bounds) {
    const float* least = std::min_element(bounds->distance, bounds->distance + count);
    const auto k = static_cast<int>(least - bounds->distance);
    if (!(bounds->outside[k] > 0.0F) || !(*least < limit_)) return;
    Entry point{};
    point.child = tile.child;
    point.lane = k;
    point.outside = bounds->outside[k];
    point.radius = bounds->radius[k];
    Measure(point, *least);
    bounds->distance[k] = kFarAway;
    SupportingPlanes updated;
    if (!policy_.update_planes(&updated)) return;
    bounds_.SetPlanes(updated, policy_.link_support());
    has_new_planes_ = true;
  }

  // Some point is no farther than this. It will be measured: its lower bound is less.
  void LowerLimit(float distance) { limit_ = std::min(limit_, distance + in_.rounding); }

  // The first `count` that are below the limit. The others are pruned.
  HWY_INLINE std::uint32_t Below(const Bounds& bounds, int count) {
    const BoxTag d;
    const auto limit = hn::Set(d, limit_);
    auto pruned = hn::Set(d, kFarAway), outside = pruned;
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      const auto bound = hn::Load(d, bounds.distance + k);
      const auto below = hn::Lt(bound, limit);
      pruned = hn::Min(pruned, hn::IfThenElse(below, pruned, bound));
      outside = hn::Min(outside, hn::IfThenElse(below, outside, hn::Load(d, bounds.outside + k)));
      bits |= dual_tree::MaskBits(d, below) << k;
    }
    Prune(hn::GetLane(hn::MinOfLanes(d, pruned)), hn::GetLane(hn::MinOfLanes(d, outside)));
    return bits & ((1U << static_cast<unsigned>(count)) - 1U);
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
        return Prune(limit_, 0.0F);
      }
      result_.gave_up = ++asked_ > kMaxAsked;
      if (result_.gave_up) return;
      found = policy_.ask_side(~point.child, point.lane, point.distance - in_.rounding);
      margin = round_down(found.margin) - in_.rounding;
    }
    if (found.side == Side::kUnknown) {
      result_.has_time = false;
      return Prune(bound, 0.0F);
    }
    if (found.side == Side::kInside) return MeasureInside(point);
    // A margin that is not known is taken for the least one.
    point.outside = std::max(margin, std::numeric_limits<float>::min());
    if (point.distance >= limit_) return Prune(point.distance, point.outside);
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
  FieldSearchResult result_;
};

}  // namespace field_search

FieldSearchResult SearchField(const FieldSearchInput& input, PointRefinement* policy) {
  return field_search::Search(input, policy).Run();
}

FieldPlace LookUpField(const DistanceField& field, const Eigen::Vector3d& p_L, float rounding) {
  using namespace field_search;
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
