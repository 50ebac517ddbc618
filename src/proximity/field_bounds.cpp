// Bounds by a link's field of distances. Compiled once per instruction set; the best one that the
// machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/field_bounds.cpp"
#include "proximity/field_bounds.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "internal/geometry/field_lookup-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace field_bounds {
namespace hn = hwy::HWY_NAMESPACE;
using field_lookup::FieldLookup;
using field_lookup::kPlaceError;
using field_lookup::LessVariance;
using field_lookup::Variance;
using BoxTag = hn::CappedTag<float, static_cast<std::size_t>(kBoxWidth)>;
using CornerTag = hn::CappedTag<float, 8>;
using Entry = SearchQueue::Entry;

class FieldBounds {
 public:
  explicit FieldBounds(const PlacedLink& link)
      : in_(link),
        field_(*link.field),
        is_closed_(link.field->is_closed()),
        has_depths_(link.field->has_depths()) {}

  // @param parent   the box about the node
  // @param corners  of `parent`; null: not known
  // @returns [m] in some box every point is no farther
  HWY_INLINE float BoundBoxes(const BoxRows& boxes, const Entry& parent, const Corners* corners,
                              Bounds* bounds) const {
    const BoxTag d;
    const DistanceField::Level& level = field_.LevelAt(parent.center, parent.radius);
    const auto half = hn::Set(d, 0.5F);
    auto farthest = hn::Set(d, kFarAway);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      const auto min_x = hn::Load(d, boxes.min[0] + k), max_x = hn::Load(d, boxes.max[0] + k),
                 min_y = hn::Load(d, boxes.min[1] + k), max_y = hn::Load(d, boxes.max[1] + k),
                 min_z = hn::Load(d, boxes.min[2] + k), max_z = hn::Load(d, boxes.max[2] + k);
      const auto half_x = hn::Mul(half, hn::Sub(max_x, min_x)),
                 half_y = hn::Mul(half, hn::Sub(max_y, min_y)),
                 half_z = hn::Mul(half, hn::Sub(max_z, min_z));
      const auto radius = lanes::Norm(half_x, half_y, half_z);
      ToLink(hn::Mul(half, hn::Add(min_x, max_x)), hn::Mul(half, hn::Add(min_y, max_y)),
             hn::Mul(half, hn::Add(min_z, max_z)), k, bounds);
      hn::Store(radius, d, bounds->radius + k);
      auto upper = radius;
      const auto x = hn::Load(d, bounds->x + k), y = hn::Load(d, bounds->y + k),
                 z = hn::Load(d, bounds->z + k);
      const auto from_bounds = field_.FromBounds(d, x, y, z);
      const auto distance = field_.Distance(d, level, x, y, z, from_bounds, &upper);
      farthest = hn::Min(farthest, hn::Add(upper, radius));
      const auto by_corners =
          corners != nullptr ? Interpolate(parent, corners->bound, boxes, k) : hn::Zero(d);
      Combine(
          from_bounds, distance, radius, by_corners,
          Height((in_.normal[0] > 0.0F ? boxes.min : boxes.max)[0] + k,
                 (in_.normal[1] > 0.0F ? boxes.min : boxes.max)[1] + k,
                 (in_.normal[2] > 0.0F ? boxes.min : boxes.max)[2] + k),
          [&] { return LookInside(*bounds, k, half_x, half_y, half_z); }, k, bounds);
    }
    return hn::GetLane(hn::MinOfLanes(d, farthest));
  }

  // @param box  about the tile
  // @returns [m] some point is no farther
  HWY_INLINE float BoundPoints(const PointTile& tile, const Entry& box, Bounds* bounds) const {
    const BoxTag d;
    const DistanceField::Level& level = field_.LevelAt(box.center, box.radius);
    auto farthest = hn::Set(d, kFarAway);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      ToLink(hn::Load(d, tile.x + k), hn::Load(d, tile.y + k), hn::Load(d, tile.z + k), k, bounds);
      auto upper = farthest;
      const auto x = hn::Load(d, bounds->x + k), y = hn::Load(d, bounds->y + k),
                 z = hn::Load(d, bounds->z + k);
      const auto from_bounds = field_.FromBounds(d, x, y, z);
      const auto distance = field_.Distance(d, level, x, y, z, from_bounds, &upper);
      farthest = hn::Min(farthest, upper);
      hn::Store(upper, d, bounds->radius + k);
      const auto look_inside = [&] {
        Inside inside;
        const auto least = field_.ByEightNodes(d, x, y, z, &inside.ball);
        inside.depth = hn::Add(least, hn::Set(d, field_.surface_error()));
        hn::Store(hn::Min(upper, inside.depth), d, bounds->radius + k);
        return inside;
      };
      Combine(from_bounds, distance, hn::Zero(d), hn::Zero(d),
              Height(tile.x + k, tile.y + k, tile.z + k), look_inside, k, bounds);
    }
    return hn::GetLane(hn::MinOfLanes(d, farthest));
  }

  void BoundCorners(const Entry& entry, Corners* corners) const {
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
      hn::Store(bound, d, corners->bound + k);
    }
    const float nearest = hn::GetLane(hn::MinOfLanes(d, least));
    const float squared =
        nearest * nearest - entry.radius * entry.radius * (1.0F + field_lookup::kSquareError);
    corners->box_bound = squared > 0.0F ? std::sqrt(squared) - kPlaceError : 0.0F;
  }

 private:
  // The heights of places above the supporting plane.
  HWY_INLINE hn::Vec<BoxTag> Height(const float* x, const float* y, const float* z) const {
    const BoxTag d;
    const auto n = [&](int axis) { return hn::Set(d, in_.normal[axis]); };
    return hn::MulAdd(n(0), hn::Load(d, x),
                      hn::MulAdd(n(1), hn::Load(d, y),
                                 hn::MulAdd(n(2), hn::Load(d, z), hn::Set(d, -in_.height))));
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
    const auto farthest = lanes::Norm(along(0, half_x), along(1, half_y), along(2, half_z));
    return {hn::Add(farthest, hn::Set(d, field_.surface_error())), v.ball};
  }

  // Lower bounds of the distances in boxes within a box, by the distances at its corners: their
  // squares are interpolated to the corners of each box, where the interpolation is least.
  HWY_INLINE hn::Vec<BoxTag> Interpolate(const Entry& box, const float* corner,
                                         const BoxRows& boxes, std::size_t k) const {
    const BoxTag d;
    using V = hn::Vec<BoxTag>;
    V t[3][2];
    auto variance = hn::Zero(d);
    for (int i = 0; i < 3; ++i) {
      const float size = box.max[i] - box.min[i];
      const auto min = hn::Set(d, box.min[i]), zero = hn::Zero(d), one = hn::Set(d, 1.0F);
      const auto per_size = hn::Set(d, size > 0.0F ? 1.0F / size : 0.0F);
      const auto share = [&](const float* at) {
        return hn::Min(hn::Max(hn::Mul(hn::Sub(hn::Load(d, at), min), per_size), zero), one);
      };
      t[i][0] = share(boxes.min[i] + k);
      t[i][1] = share(boxes.max[i] + k);
      // The largest variance in the child's range.
      const auto half = hn::Set(d, 0.5F);
      const auto nearest_half = hn::Min(hn::Max(half, t[i][0]), t[i][1]);
      variance = hn::MulAdd(Variance(nearest_half), hn::Set(d, size * size), variance);
    }
    float square[8];
    for (int c = 0; c < 8; ++c) square[c] = std::max(corner[c], 0.0F) * corner[c];
    auto least = hn::Set(d, kFarAway);
    for (int i = 0; i < 2; ++i) {
      const auto edge = [&](int c) {
        return hn::MulAdd(t[0][i], hn::Set(d, square[c + 1] - square[c]), hn::Set(d, square[c]));
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
    return hn::Sub(LessVariance(d, least, variance), hn::Set(d, kPlaceError));
  }

  const PlacedLink& in_;
  const FieldLookup field_;
  const bool is_closed_, has_depths_;
};

}  // namespace field_bounds

using field_bounds::FieldBounds;

float BoundBoxes(const PlacedLink& link, const BoxRows& boxes, const SearchQueue::Entry& parent,
                 const Corners* corners, Bounds* bounds) {
  return FieldBounds(link).BoundBoxes(boxes, parent, corners, bounds);
}

float BoundPoints(const PlacedLink& link, const PointTile& tile, const SearchQueue::Entry& box,
                  Bounds* bounds) {
  return FieldBounds(link).BoundPoints(tile, box, bounds);
}

void BoundCorners(const PlacedLink& link, const SearchQueue::Entry& box, Corners* corners) {
  FieldBounds(link).BoundCorners(box, corners);
}

SplitSlots Split(std::uint32_t slots, float limit_bound, Bounds* bounds) {
  const field_bounds::BoxTag d;
  constexpr std::uint32_t kAllSlots = (1U << static_cast<unsigned>(kBoxWidth)) - 1U;
  for (std::uint32_t bits = ~slots & kAllSlots; bits != 0; bits &= bits - 1) {
    const auto k = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
    bounds->distance[k] = bounds->outside[k] = kFarAway;
  }
  namespace hn = hwy::HWY_NAMESPACE;
  const auto limit = hn::Set(d, limit_bound);
  auto pruned = hn::Set(d, kFarAway), outside = pruned;
  std::uint32_t below = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
    const auto bound = hn::Load(d, bounds->distance + k);
    const auto is_below = hn::Lt(bound, limit);
    pruned = hn::Min(pruned, hn::IfThenElse(is_below, pruned, bound));
    outside = hn::Min(outside, hn::IfThenElse(is_below, outside, hn::Load(d, bounds->outside + k)));
    below |= lanes::MaskBits(d, is_below) << k;
  }
  return {below & slots, hn::GetLane(hn::MinOfLanes(d, pruned)),
          hn::GetLane(hn::MinOfLanes(d, outside))};
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(BoundBoxes);
HWY_EXPORT(BoundPoints);
HWY_EXPORT(BoundCorners);
HWY_EXPORT(Split);

float bound_boxes_by_field(const PlacedLink& link, const BoxRows& boxes,
                           const SearchQueue::Entry& parent, const Corners* corners,
                           Bounds* bounds) {
  return HWY_DYNAMIC_DISPATCH(BoundBoxes)(link, boxes, parent, corners, bounds);
}

float bound_points_by_field(const PlacedLink& link, const PointTile& tile,
                            const SearchQueue::Entry& box, Bounds* bounds) {
  return HWY_DYNAMIC_DISPATCH(BoundPoints)(link, tile, box, bounds);
}

void bound_corners_by_field(const PlacedLink& link, const SearchQueue::Entry& box,
                            Corners* corners) {
  HWY_DYNAMIC_DISPATCH(BoundCorners)(link, box, corners);
}

SplitSlots split_slots(std::uint32_t slots, float limit, Bounds* bounds) {
  return HWY_DYNAMIC_DISPATCH(Split)(slots, limit, bounds);
}

FieldPlace look_up_field(const DistanceField& field, const Eigen::Vector3d& p_L, float rounding) {
  PlacedLink link;
  link.field = &field;
  link.is_closed = field.is_closed();
  link.rounding = rounding;
  for (int axis = 0; axis < 3; ++axis) link.R_LO[4 * axis] = 1.0F;
  PointTile tile{};
  SearchQueue::Entry place{};
  float* const rows[3] = {tile.x, tile.y, tile.z};
  for (int axis = 0; axis < 3; ++axis) {
    place.center[axis] = static_cast<float>(p_L[axis]);
    std::fill_n(rows[axis], kBoxWidth, place.center[axis]);
  }
  Bounds bounds;
  bound_points_by_field(link, tile, place, &bounds);
  return {bounds.outside[0], bounds.surface[0] - rounding, bounds.radius[0] + rounding};
}

}  // namespace ist
#endif
