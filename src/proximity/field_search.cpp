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
#include "proximity/field_lookup-inl.h"
#include "proximity/refinement.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace field_search {
namespace hn = hwy::HWY_NAMESPACE;
using dual_tree::BoxTag;
using CornerTag = hn::CappedTag<float, 8>;
using Entry = FieldQueue::Entry;
using Side = NearSurface::Side;

// The bound [m] of what may be inside, at any depth: it is looked at before all others.
constexpr float kMayBeInside = -kFarAway;
// So many points are measured before another search is better: where very many are about equally
// near, and where the field's cells are too large. Tolerance 0 needs more of them.
constexpr int kMaxMeasured = 100, kMaxMeasuredExact = 256;
// A search that has visited so many tiles and measured nothing measures a point: the link's
// supporting plane across its direction may separate the link from all others, as from a table.
constexpr std::uint64_t kTilesBeforePlanes = 4;
// So many points whose sides neither the field nor an earlier one tells are asked about one by one.
constexpr int kMaxAsked = 256;

// Bounds of a node's children or of a tile's points.
struct alignas(64) Bounds {
  float distance[kBoxWidth];                       // [m] lower bounds; negative: of the depth
  float outside[kBoxWidth];                        // [m] every place that is nearer is outside
  float surface[kBoxWidth];                        // [m] no surface is nearer
  float x[kBoxWidth], y[kBoxWidth], z[kBoxWidth];  // [m] in the link's frame
  float radius[kBoxWidth];                         // [m] as FieldQueue::Entry
};

class Search {
 public:
  Search(const FieldSearchInput& input, PointRefinement* policy)
      : in_(input),
        policy_(*policy),
        queue_(*input.queue),
        field_(*input.field),
        is_closed_(input.field->is_closed()),
        has_depths_(input.field->has_depths()),
        limit_(input.prune_bound + input.ahead) {
    planes_.Set(input.planes);
  }

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
        const float height = planes_.Height(entry.min, entry.max) - in_.support;
        // Near holes no plane tells inside from outside.
        if (height >= limit_ && (is_closed_ || entry.outside > 0.0F)) {
          Prune(height, is_closed_ ? height : entry.outside);
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

  HWY_INLINE void ToLink(hn::Vec<BoxTag> x, hn::Vec<BoxTag> y, hn::Vec<BoxTag> z, std::size_t k,
                         Bounds* out) const {
    const BoxTag d;
    float* rows[3] = {out->x, out->y, out->z};
    for (int row = 0; row < 3; ++row) {
      const float* r = in_.R_LO + 3 * row;
      hn::Store(hn::MulAdd(hn::Set(d, r[0]), x,
                           hn::MulAdd(hn::Set(d, r[1]), y,
                                      hn::MulAdd(hn::Set(d, r[2]), z, hn::Set(d, in_.p_LO[row])))),
                d, rows[row] + k);
    }
  }

  // The grid of depths tells this of spheres about places.
  struct Inside {
    hn::Vec<BoxTag> depth;  // [m] no place is deeper inside
    hn::Vec<BoxTag> ball;   // [m] as FieldLookup::ByNode, about the centre
  };

  // Combines the bounds of spheres about places.
  // @param from_bounds  [m] of the places, by FieldLookup::FromBounds()
  // @param distance     [m] of the places
  // @param least        [m] another bound of their distances
  // @param inside       returns an Inside; it is called where the field has depths
  template <class LookInside>
  HWY_INLINE void Combine(hn::Vec<BoxTag> from_bounds, hn::Vec<BoxTag> distance,
                          hn::Vec<BoxTag> radius, hn::Vec<BoxTag> least, hn::Vec<BoxTag> height,
                          const LookInside& inside, std::size_t k, Bounds* bounds) const {
    const BoxTag d;
    const auto unknown = hn::Set(d, kMayBeInside), rounding = hn::Set(d, in_.rounding);
    const auto by_center = hn::Sub(distance, radius);
    const auto by_plane = hn::IfThenElse(hn::Gt(height, unknown), height, unknown);
    auto at_center =
        hn::Sub(field_.OutsideRadius(d, hn::Load(d, bounds->x + k), hn::Load(d, bounds->y + k),
                                     hn::Load(d, bounds->z + k), from_bounds),
                rounding);
    auto outside = Outside(at_center, by_center, radius, by_plane);
    auto lowest = unknown;
    if (has_depths_ && !hn::AllTrue(d, hn::Gt(outside, hn::Zero(d)))) {
      const Inside found = inside();
      at_center = hn::Max(at_center, hn::Sub(found.ball, rounding));
      outside = Outside(at_center, by_center, radius, by_plane);
      lowest = hn::Neg(found.depth);
      lowest = hn::IfThenElse(hn::Gt(lowest, unknown), lowest, unknown);
    }
    // The signed distance of a closed solid falls by no more than the way; and a way up to the
    // supporting plane leads out of it.
    if (is_closed_) {
      const auto is_center_outside = hn::Gt(at_center, hn::Zero(d));
      lowest =
          hn::Max(hn::Max(lowest, by_plane), hn::IfThenElse(is_center_outside, outside, lowest));
    }
    const auto is_outside = hn::Gt(outside, hn::Zero(d));
    const auto bound = hn::Max(hn::Max(outside, by_plane), hn::Max(by_center, least));
    hn::Store(hn::IfThenElse(is_outside, bound, lowest), d, bounds->distance + k);
    hn::Store(outside, d, bounds->outside + k);
    hn::Store(by_center, d, bounds->surface + k);
  }

  // [m] Every place that is nearer to a sphere is outside; not positive: unknown.
  // @param at_center  [m] about the sphere's centre
  // @param by_center  [m] no surface is nearer to the sphere
  // @param by_plane   [m] height of the sphere above the supporting plane
  HWY_INLINE hn::Vec<BoxTag> Outside(hn::Vec<BoxTag> at_center, hn::Vec<BoxTag> by_center,
                                     hn::Vec<BoxTag> radius, hn::Vec<BoxTag> by_plane) const {
    const BoxTag d;
    const auto outside = hn::Sub(at_center, radius);
    if (!is_closed_) return outside;
    // No surface is in the sphere about the centre that reaches as far as the distance: of a closed
    // solid, all of it is where the centre is. What is above its supporting plane is outside, too.
    const auto is_center_outside = hn::Gt(at_center, hn::Zero(d));
    const auto by_side = hn::IfThenElse(is_center_outside, by_center, outside);
    return hn::Max(hn::Max(outside, by_side), by_plane);
  }

  // A box is no deeper than its farthest corner is from a surface point.
  HWY_INLINE Inside LookInside(const Bounds& bounds, std::size_t k, hn::Vec<BoxTag> half_x,
                               hn::Vec<BoxTag> half_y, hn::Vec<BoxTag> half_z) const {
    const BoxTag d;
    const auto v = field_.ByNearestNode(d, hn::Load(d, bounds.x + k), hn::Load(d, bounds.y + k),
                                        hn::Load(d, bounds.z + k));
    const auto along = [&](std::size_t axis, hn::Vec<BoxTag> half) {
      const auto r = [&](std::size_t row) { return hn::Set(d, in_.R_LO[3 * row + axis]); };
      const auto in_O = hn::MulAdd(r(0), v.x, hn::MulAdd(r(1), v.y, hn::Mul(r(2), v.z)));
      return hn::Add(hn::Abs(in_O), half);
    };
    const auto farthest = dual_tree::Norm(along(0, half_x), along(1, half_y), along(2, half_z));
    return {hn::Add(farthest, hn::Set(d, field_.surface_error())), v.ball};
  }

  // Lower bounds of the distance at the corners of a box.
  // @returns [m] the least
  float BoundCorners(const Entry& entry, float* corner) const {
    const CornerTag d;
    alignas(64) static constexpr float kSign[3][8] = {
        {-1, 1, -1, 1, -1, 1, -1, 1}, {-1, -1, 1, 1, -1, -1, 1, 1}, {-1, -1, -1, -1, 1, 1, 1, 1}};
    const DistanceField::Level& level = field_.LevelAt(entry.center, entry.radius);
    auto least = hn::Set(d, kFarAway);
    for (std::size_t k = 0; k < 8; k += hn::Lanes(d)) {
      hn::Vec<CornerTag> p[3];
      for (int row = 0; row < 3; ++row) {
        p[row] = hn::Set(d, entry.center[row]);
        for (int i = 0; i < 3; ++i) {
          const float half = 0.5F * (entry.max[i] - entry.min[i]) * in_.R_LO[3 * row + i];
          p[row] = hn::MulAdd(hn::Load(d, kSign[i] + k), hn::Set(d, half), p[row]);
        }
      }
      auto upper = least;
      const auto bound = field_.Distance(d, level, p[0], p[1], p[2],
                                         field_.FromBounds(d, p[0], p[1], p[2]), &upper);
      least = hn::Min(least, bound);
      hn::Store(bound, d, corner + k);
    }
    return hn::GetLane(hn::MinOfLanes(d, least));
  }

  // Lower bounds of the distances in boxes within a box, by the distances at its corners: these are
  // interpolated to the corners of each box, where the interpolation is least.
  HWY_INLINE hn::Vec<BoxTag> Interpolate(const Entry& box, const float* corner, const BoxNode& node,
                                         std::size_t k) const {
    const BoxTag d;
    using V = hn::Vec<BoxTag>;
    const float* low[3] = {node.min_x + k, node.min_y + k, node.min_z + k};
    const float* high[3] = {node.max_x + k, node.max_y + k, node.max_z + k};
    V t[3][2];
    auto variance = hn::Zero(d);
    for (int i = 0; i < 3; ++i) {
      const float size = box.max[i] - box.min[i];
      const auto min = hn::Set(d, box.min[i]), zero = hn::Zero(d), one = hn::Set(d, 1.0F);
      const auto per_size = hn::Set(d, size > 0.0F ? 1.0F / size : 0.0F);
      const auto share = [&](const float* at) {
        return hn::Min(hn::Max(hn::Mul(hn::Sub(hn::Load(d, at), min), per_size), zero), one);
      };
      t[i][0] = share(low[i]);
      t[i][1] = share(high[i]);
      // The largest variance in the child's range.
      const auto half = hn::Set(d, 0.5F);
      const auto nearest_half = hn::Min(hn::Max(half, t[i][0]), t[i][1]);
      variance = hn::MulAdd(Variance(nearest_half), hn::Set(d, size * size), variance);
    }
    auto least = hn::Set(d, kFarAway);
    for (int i = 0; i < 2; ++i) {
      const auto edge = [&](int c) {
        return hn::MulAdd(t[0][i], hn::Set(d, corner[c + 1] - corner[c]), hn::Set(d, corner[c]));
      };
      const V e0 = edge(0), e1 = edge(2), e2 = edge(4), e3 = edge(6);
      for (int j = 0; j < 2; ++j) {
        const V near = hn::MulAdd(t[1][j], hn::Sub(e1, e0), e0);
        const V far = hn::MulAdd(t[1][j], hn::Sub(e3, e2), e2);
        for (int l = 0; l < 2; ++l) {
          least = hn::Min(least, hn::MulAdd(t[2][l], hn::Sub(far, near), near));
        }
      }
    }
    return hn::Sub(LessVariance(d, hn::Max(least, hn::Zero(d)), variance), hn::Set(d, kPlaceError));
  }

  void ExpandNode(const Entry& entry, float entry_bound) {
    alignas(64) float corner[8];
    // The corners say little where the link is nearer than the box is large.
    const bool has_corners = entry_bound > 0.5F * entry.radius;
    if (has_corners) {
      const float least = BoundCorners(entry, corner);
      const float squared = least * least - entry.radius * entry.radius * (1.0F + kSquareError);
      const float bound = squared > 0.0F ? std::sqrt(squared) - kPlaceError : 0.0F;
      if (bound >= limit_) return Prune(bound, entry.outside);
    }
    ++result_.nodes;
    const BoxNode& node = in_.bvh->nodes()[static_cast<std::size_t>(entry.child)];
    const DistanceField::Level& level = field_.LevelAt(entry.center, entry.radius);
    const BoxTag d;
    Bounds bounds;
    const auto half = hn::Set(d, 0.5F);
    auto farthest = hn::Set(d, kFarAway);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      const auto min_x = hn::Load(d, node.min_x + k), max_x = hn::Load(d, node.max_x + k),
                 min_y = hn::Load(d, node.min_y + k), max_y = hn::Load(d, node.max_y + k),
                 min_z = hn::Load(d, node.min_z + k), max_z = hn::Load(d, node.max_z + k);
      const auto half_x = hn::Mul(half, hn::Sub(max_x, min_x)),
                 half_y = hn::Mul(half, hn::Sub(max_y, min_y)),
                 half_z = hn::Mul(half, hn::Sub(max_z, min_z));
      const auto radius = dual_tree::Norm(half_x, half_y, half_z);
      ToLink(hn::Mul(half, hn::Add(min_x, max_x)), hn::Mul(half, hn::Add(min_y, max_y)),
             hn::Mul(half, hn::Add(min_z, max_z)), k, &bounds);
      hn::Store(radius, d, bounds.radius + k);
      auto upper = radius;
      const auto x = hn::Load(d, bounds.x + k), y = hn::Load(d, bounds.y + k),
                 z = hn::Load(d, bounds.z + k);
      const auto from_bounds = field_.FromBounds(d, x, y, z);
      const auto distance = field_.Distance(d, level, x, y, z, from_bounds, &upper);
      farthest = hn::Min(farthest, hn::Add(upper, radius));
      const auto by_corners = has_corners ? Interpolate(entry, corner, node, k) : hn::Zero(d);
      Combine(
          from_bounds, distance, radius, by_corners,
          planes_.Height(node, k, planes_.offset() + in_.support),
          [&] { return LookInside(bounds, k, half_x, half_y, half_z); }, k, &bounds);
    }
    LowerLimit(hn::GetLane(hn::MinOfLanes(d, farthest)));
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
    const DistanceField::Level& level = field_.LevelAt(entry.center, entry.radius);
    const BoxTag d;
    Bounds bounds;
    auto farthest = hn::Set(d, kFarAway);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      ToLink(hn::Load(d, tile.x + k), hn::Load(d, tile.y + k), hn::Load(d, tile.z + k), k, &bounds);
      auto upper = farthest;
      const auto x = hn::Load(d, bounds.x + k), y = hn::Load(d, bounds.y + k),
                 z = hn::Load(d, bounds.z + k);
      const auto from_bounds = field_.FromBounds(d, x, y, z);
      const auto distance = field_.Distance(d, level, x, y, z, from_bounds, &upper);
      farthest = hn::Min(farthest, upper);
      hn::Store(upper, d, bounds.radius + k);
      const auto look_inside = [&] {
        Inside inside;
        const auto least = field_.ByEightNodes(d, x, y, z, &inside.ball);
        inside.depth = hn::Add(least, hn::Set(d, field_.surface_error()));
        hn::Store(hn::Min(upper, inside.depth), d, bounds.radius + k);
        return inside;
      };
      Combine(from_bounds, distance, hn::Zero(d), hn::Zero(d),
              planes_.Height(tile, k, planes_.offset() + in_.support), look_inside, k, &bounds);
    }
    LowerLimit(hn::GetLane(hn::MinOfLanes(d, farthest)));
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
    planes_.Set(updated);
    in_.support = policy_.link_support();
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
        !has_depths_ || ++measured_ > (in_.is_exact ? kMaxMeasuredExact : kMaxMeasured);
    limit_ = std::min(limit_, policy_.traversal_prune_bound() + in_.ahead);
  }

  FieldSearchInput in_;
  PointRefinement& policy_;
  FieldQueue& queue_;
  const FieldLookup field_;
  dual_tree::PlaneFrame planes_;
  const bool is_closed_, has_depths_;
  float limit_;                   // [m]
  bool has_new_planes_ = false;   // which entries of the queue do not know
  int asked_ = 0, measured_ = 0;  // points
  FieldSearchResult result_;
};

}  // namespace field_search

FieldSearchResult SearchField(const FieldSearchInput& input, PointRefinement* policy) {
  return field_search::Search(input, policy).Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(SearchField);

FieldSearchResult search_field(const FieldSearchInput& input, PointRefinement* policy) {
  return HWY_DYNAMIC_DISPATCH(SearchField)(input, policy);
}

}  // namespace ist
#endif
