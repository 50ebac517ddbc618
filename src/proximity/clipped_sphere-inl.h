// Lower bounds of distances from clipped spheres (what a supporting plane leaves of a sphere) to
// boxes and points. Compiled once per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_CLIPPED_SPHERE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_CLIPPED_SPHERE_INL_H
#undef IST_PROXIMITY_CLIPPED_SPHERE_INL_H
#else
#define IST_PROXIMITY_CLIPPED_SPHERE_INL_H
#endif

#include <hwy/highway.h>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_tile.h"
#include "internal/geometry/lanes-inl.h"
#include "proximity/supporting_planes.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace dual_tree {
namespace hn = hwy::HWY_NAMESPACE;

using BoxTag = hn::CappedTag<float, static_cast<std::size_t>(kBoxWidth)>;

using lanes::IntervalDistance;
using lanes::MaskBits;
using lanes::Norm;

// Radius of the circle where a plane at `plane_height` above a sphere's centre cuts the sphere, at
// least.
template <class D>
HWY_INLINE hn::Vec<D> RimRadius(D d, hn::Vec<D> radius, hn::Vec<D> plane_height, float rounding) {
  const auto slack = hn::Set(d, rounding);
  const auto least = hn::Max(hn::Sub(hn::Abs(plane_height), slack), hn::Zero(d));
  const auto squared = hn::NegMulAdd(least, least, hn::Mul(radius, radius));
  return hn::Add(hn::Sqrt(hn::Max(squared, hn::Zero(d))), slack);
}

// Lower bound of the distance from a clipped sphere to something at `height` above the plane and at
// `lateral` distance from the sphere's axis along the normal. Where the sphere's nearest point is
// cut off, that is the distance to the rim; else the plane's.
template <class D>
HWY_INLINE hn::Vec<D> ClippedDistance(D d, hn::Vec<D> height, hn::Vec<D> lateral, hn::Vec<D> radius,
                                      hn::Vec<D> plane_height, hn::Vec<D> rim_radius) {
  const auto zero = hn::Zero(d);
  const auto over_center = hn::Add(height, plane_height);
  const auto over_sq = hn::Mul(over_center, over_center);
  const auto lowest = hn::Min(height, over_center);
  const auto is_cut_off =
      hn::And(hn::Gt(lowest, zero), hn::Gt(hn::Mul(hn::Mul(radius, radius), over_sq),
                                           hn::Mul(hn::Mul(plane_height, hn::Abs(plane_height)),
                                                   hn::MulAdd(lateral, lateral, over_sq))));
  const auto outside_rim = hn::Max(hn::Sub(lateral, rim_radius), zero);
  const auto to_rim = hn::Sqrt(hn::MulAdd(height, height, hn::Mul(outside_rim, outside_rim)));
  return hn::IfThenElse(is_cut_off, to_rim, height);
}

// Heights above parallel supporting planes, and lateral distances, of boxes and points.
class PlaneFrame {
 public:
  void Set(const SupportingPlanes& planes) { planes_ = planes; }
  float offset() const { return planes_.offset; }

  // The least height of a box above the plane of the link's origin (support 0).
  HWY_INLINE float Height(const float* min, const float* max) const {
    float height = -planes_.offset;
    for (int i = 0; i < 3; ++i) {
      height += planes_.normal[i] * (planes_.normal[i] > 0.0F ? min[i] : max[i]);
    }
    return height;
  }
  // The heights of sixteen points, or the least ones of sixteen boxes, above the plane at `offset`.
  HWY_INLINE hn::Vec<BoxTag> Height(const PointTile& tile, std::size_t k, float offset) const {
    return Height(tile.x + k, tile.y + k, tile.z + k, offset);
  }
  template <class Boxes>
  HWY_INLINE hn::Vec<BoxTag> Height(const Boxes& boxes, std::size_t k, float offset) const {
    return Height((planes_.normal[0] > 0.0F ? boxes.min_x : boxes.max_x) + k,
                  (planes_.normal[1] > 0.0F ? boxes.min_y : boxes.max_y) + k,
                  (planes_.normal[2] > 0.0F ? boxes.min_z : boxes.max_z) + k, offset);
  }

  template <class D>
  HWY_INLINE hn::Vec<D> AlongNormal(D d, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) const {
    return hn::MulAdd(
        hn::Set(d, planes_.normal[0]), x,
        hn::MulAdd(hn::Set(d, planes_.normal[1]), y, hn::Mul(hn::Set(d, planes_.normal[2]), z)));
  }

  // Length of the part of vectors that is perpendicular to the normal.
  template <class D>
  HWY_INLINE hn::Vec<D> Lateral(D d, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) const {
    const auto along = AlongNormal(d, x, y, z);
    return Norm(hn::NegMulAdd(hn::Set(d, planes_.normal[0]), along, x),
                hn::NegMulAdd(hn::Set(d, planes_.normal[1]), along, y),
                hn::NegMulAdd(hn::Set(d, planes_.normal[2]), along, z));
  }
  // Lateral distance of sixteen points, or at least of sixteen boxes, from a sphere's axis.
  HWY_INLINE hn::Vec<BoxTag> Lateral(const PointTile& tile, std::size_t k,
                                     const float* center) const {
    const BoxTag d;
    return Lateral(d, hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, center[0])),
                   hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, center[1])),
                   hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, center[2])));
  }
  template <class Boxes>
  HWY_INLINE hn::Vec<BoxTag> Lateral(const Boxes& boxes, std::size_t k, const float* center) const {
    const BoxTag d;
    const auto half = hn::Set(d, 0.5F);
    const auto middle = [&](const float* min, const float* max, float c) {
      return hn::Sub(hn::Mul(half, hn::Add(hn::Load(d, min + k), hn::Load(d, max + k))),
                     hn::Set(d, c));
    };
    const auto half_edge = [&](const float* min, const float* max) {
      return hn::Mul(half, hn::Sub(hn::Load(d, max + k), hn::Load(d, min + k)));
    };
    const auto lateral = Lateral(d, middle(boxes.min_x, boxes.max_x, center[0]),
                                 middle(boxes.min_y, boxes.max_y, center[1]),
                                 middle(boxes.min_z, boxes.max_z, center[2]));
    const auto radius =
        Norm(half_edge(boxes.min_x, boxes.max_x), half_edge(boxes.min_y, boxes.max_y),
             half_edge(boxes.min_z, boxes.max_z));
    return hn::Max(hn::Sub(lateral, radius), hn::Zero(d));
  }

 private:
  HWY_INLINE hn::Vec<BoxTag> Height(const float* x, const float* y, const float* z,
                                    float offset) const {
    const BoxTag d;
    return hn::MulAdd(
        hn::Set(d, planes_.normal[0]), hn::Load(d, x),
        hn::MulAdd(hn::Set(d, planes_.normal[1]), hn::Load(d, y),
                   hn::MulAdd(hn::Set(d, planes_.normal[2]), hn::Load(d, z), hn::Set(d, -offset))));
  }

  SupportingPlanes planes_;
};

// Distances of sixteen points, or boxes, from a place.
HWY_INLINE hn::Vec<BoxTag> Distance(const PointTile& tile, std::size_t k, float x, float y,
                                    float z) {
  const BoxTag d;
  return Norm(hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, x)),
              hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, y)),
              hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, z)));
}
template <class Boxes>
HWY_INLINE hn::Vec<BoxTag> Distance(const Boxes& boxes, std::size_t k, float x, float y, float z) {
  const BoxTag d;
  return Norm(IntervalDistance(d, hn::Load(d, boxes.min_x + k), hn::Load(d, boxes.max_x + k),
                               hn::Set(d, x)),
              IntervalDistance(d, hn::Load(d, boxes.min_y + k), hn::Load(d, boxes.max_y + k),
                               hn::Set(d, y)),
              IntervalDistance(d, hn::Load(d, boxes.min_z + k), hn::Load(d, boxes.max_z + k),
                               hn::Set(d, z)));
}

}  // namespace dual_tree
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_CLIPPED_SPHERE_INL_H
