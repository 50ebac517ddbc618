// Bounds of boxes and points by a link's field of distances and its supporting plane. Compiled once
// per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_FIELD_BOUNDS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_FIELD_BOUNDS_INL_H
#undef IST_PROXIMITY_FIELD_BOUNDS_INL_H
#else
#define IST_PROXIMITY_FIELD_BOUNDS_INL_H
#endif

#include <hwy/highway.h>

#include <cmath>

#include "internal/geometry/field_lookup-inl.h"
#include "proximity/clipped_sphere-inl.h"
#include "proximity/field_queue.h"
#include "proximity/field_search.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace field_search {
namespace hn = hwy::HWY_NAMESPACE;
using dual_tree::BoxTag;
using field_lookup::FieldLookup;
using field_lookup::kPlaceError;
using field_lookup::kSquareError;
using field_lookup::LessVariance;
using field_lookup::Variance;
using CornerTag = hn::CappedTag<float, 8>;
using Entry = FieldQueue::Entry;

// The bound [m] of what may be inside, at any depth: it is looked at before all others.
constexpr float kMayBeInside = -kFarAway;

// Bounds of a node's children or of a tile's points.
struct alignas(64) Bounds {
  float distance[kBoxWidth];                       // [m] lower bounds; negative: of the depth
  float outside[kBoxWidth];                        // [m] every place that is nearer is outside
  float surface[kBoxWidth];                        // [m] no surface is nearer
  float x[kBoxWidth], y[kBoxWidth], z[kBoxWidth];  // [m] in the link's frame
  float radius[kBoxWidth];                         // [m] as FieldQueue::Entry
};

// Lower bounds [m] of the distance at the corners of a box.
struct Corners {
  alignas(64) float bound[8];
};

class FieldBounds {
 public:
  explicit FieldBounds(const FieldSearchInput& input)
      : in_(input),
        field_(*input.field),
        is_closed_(input.field->is_closed()),
        has_depths_(input.field->has_depths()),
        support_(input.support) {
    planes_.Set(input.planes);
  }

  bool is_closed() const { return is_closed_; }
  bool has_depths() const { return has_depths_; }
  void SetPlanes(const SupportingPlanes& planes, float support) {
    planes_.Set(planes);
    support_ = support;
  }

  // Places a box, given in the index's frame.
  void PlaceBox(const float* min, const float* max, Entry* box) const {
    float square = 0.0F;
    for (int i = 0; i < 3; ++i) {
      box->min[i] = min[i];
      box->max[i] = max[i];
      const float half = 0.5F * (max[i] - min[i]);
      square += half * half;
    }
    box->radius = std::sqrt(square);
    for (int row = 0; row < 3; ++row) {
      box->center[row] = in_.p_LO[row];
      for (int i = 0; i < 3; ++i) {
        box->center[row] += in_.R_LO[3 * row + i] * (0.5F * (min[i] + max[i]));
      }
    }
  }

  // [m] The height of a box above the supporting plane.
  float Height(const Entry& box) const { return planes_.Height(box.min, box.max) - support_; }

  // @param parent   the box about the node
  // @param corners  of `parent`; null: not known
  // @returns [m] in some box every point is no farther
  HWY_INLINE float BoundBoxes(const BoxNode& node, const Entry& parent, const Corners* corners,
                              Bounds* bounds) const {
    const BoxTag d;
    const DistanceField::Level& level = field_.LevelAt(parent.center, parent.radius);
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
             hn::Mul(half, hn::Add(min_z, max_z)), k, bounds);
      hn::Store(radius, d, bounds->radius + k);
      auto upper = radius;
      const auto x = hn::Load(d, bounds->x + k), y = hn::Load(d, bounds->y + k),
                 z = hn::Load(d, bounds->z + k);
      const auto from_bounds = field_.FromBounds(d, x, y, z);
      const auto distance = field_.Distance(d, level, x, y, z, from_bounds, &upper);
      farthest = hn::Min(farthest, hn::Add(upper, radius));
      const auto by_corners =
          corners != nullptr ? Interpolate(parent, corners->bound, node, k) : hn::Zero(d);
      Combine(
          from_bounds, distance, radius, by_corners,
          planes_.Height(node, k, planes_.offset() + support_),
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
              planes_.Height(tile, k, planes_.offset() + support_), look_inside, k, bounds);
    }
    return hn::GetLane(hn::MinOfLanes(d, farthest));
  }

  // @returns [m] the least of them
  float BoundCorners(const Entry& entry, Corners* corners) const {
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
    return hn::GetLane(hn::MinOfLanes(d, least));
  }

 private:
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

  const FieldSearchInput& in_;
  const FieldLookup field_;
  dual_tree::PlaneFrame planes_;
  const bool is_closed_, has_depths_;
  float support_;  // [m] of the whole link along the planes' normal
};

}  // namespace field_search
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_FIELD_BOUNDS_INL_H
