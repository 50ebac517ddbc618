// Lower bounds of the distance between what planes leave of spheres, and boxes or points. Compiled
// once per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_CUT_BALLS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_CUT_BALLS_INL_H
#undef IST_PROXIMITY_CUT_BALLS_INL_H
#else
#define IST_PROXIMITY_CUT_BALLS_INL_H
#endif

#include <hwy/highway.h>

#include "proximity/traversal.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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

// The circle in which a plane `height` above a sphere's centre cuts it: its radius, at least.
template <class D>
HWY_INLINE hn::Vec<D> RimRadius(D d, hn::Vec<D> radius, hn::Vec<D> height, float rounding) {
  const auto slack = hn::Set(d, rounding);
  const auto least = hn::Max(hn::Sub(hn::Abs(height), slack), hn::Zero(d));
  const auto squared = hn::NegMulAdd(least, least, hn::Mul(radius, radius));
  return hn::Add(hn::Sqrt(hn::Max(squared, hn::Zero(d))), slack);
}

// How far what is `ahead` of the plane, and `aside` of the sphere's axis across it, is from what
// the plane leaves of the sphere: from the rim, where the sphere's nearest point is cut off.
// Otherwise only the plane tells.
template <class D>
HWY_INLINE hn::Vec<D> CutDistance(D d, hn::Vec<D> ahead, hn::Vec<D> aside, hn::Vec<D> radius,
                                  hn::Vec<D> height, hn::Vec<D> rim) {
  const auto zero = hn::Zero(d);
  const auto over_center = hn::Add(ahead, height);
  const auto over_sq = hn::Mul(over_center, over_center);
  const auto lowest = hn::Min(ahead, over_center);
  const auto is_cut =
      hn::And(hn::Gt(lowest, zero),
              hn::Gt(hn::Mul(hn::Mul(radius, radius), over_sq),
                     hn::Mul(hn::Mul(height, hn::Abs(height)), hn::MulAdd(aside, aside, over_sq))));
  const auto beyond = hn::Max(hn::Sub(aside, rim), zero);
  const auto to_rim = hn::Sqrt(hn::MulAdd(ahead, ahead, hn::Mul(beyond, beyond)));
  return hn::IfThenElse(is_cut, to_rim, ahead);
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

// The planes of a traversal: where boxes and points are to them.
class Planes {
 public:
  explicit Planes(const Traversal& traversal) : t_(traversal) {}

  // Of a box before the plane through the link's origin.
  HWY_INLINE float Ahead(const float* min, const float* max) const {
    float ahead = -t_.offset;
    for (int i = 0; i < 3; ++i) {
      ahead += t_.normal[i] * (t_.normal[i] > 0.0F ? min[i] : max[i]);
    }
    return ahead;
  }
  // Of sixteen points, or boxes, before the plane at `offset`.
  HWY_INLINE hn::Vec<PointTag> Ahead(const float* x, const float* y, const float* z,
                                     float offset) const {
    const PointTag d;
    return hn::MulAdd(
        hn::Set(d, t_.normal[0]), hn::Load(d, x),
        hn::MulAdd(hn::Set(d, t_.normal[1]), hn::Load(d, y),
                   hn::MulAdd(hn::Set(d, t_.normal[2]), hn::Load(d, z), hn::Set(d, -offset))));
  }
  HWY_INLINE hn::Vec<PointTag> Ahead(const PointTile& tile, std::size_t k, float offset) const {
    return Ahead(tile.x + k, tile.y + k, tile.z + k, offset);
  }
  template <class Boxes>
  HWY_INLINE hn::Vec<PointTag> Ahead(const Boxes& boxes, std::size_t k, float offset) const {
    return Ahead((t_.normal[0] > 0.0F ? boxes.min_x : boxes.max_x) + k,
                 (t_.normal[1] > 0.0F ? boxes.min_y : boxes.max_y) + k,
                 (t_.normal[2] > 0.0F ? boxes.min_z : boxes.max_z) + k, offset);
  }

  template <class D>
  HWY_INLINE hn::Vec<D> Along(D d, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) const {
    return hn::MulAdd(
        hn::Set(d, t_.normal[0]), x,
        hn::MulAdd(hn::Set(d, t_.normal[1]), y, hn::Mul(hn::Set(d, t_.normal[2]), z)));
  }

  // Length of what is left of vectors across the normal.
  template <class D>
  HWY_INLINE hn::Vec<D> Aside(D d, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) const {
    const auto along = Along(d, x, y, z);
    return Norm(hn::NegMulAdd(hn::Set(d, t_.normal[0]), along, x),
                hn::NegMulAdd(hn::Set(d, t_.normal[1]), along, y),
                hn::NegMulAdd(hn::Set(d, t_.normal[2]), along, z));
  }
  // How far sixteen boxes, or points, are aside of the pair's sphere, at least.
  HWY_INLINE hn::Vec<PointTag> Aside(const PointTile& tile, std::size_t k,
                                     const float* center) const {
    const PointTag d;
    return Aside(d, hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, center[0])),
                 hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, center[1])),
                 hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, center[2])));
  }
  template <class Boxes>
  HWY_INLINE hn::Vec<PointTag> Aside(const Boxes& boxes, std::size_t k, const float* center) const {
    const PointTag d;
    const auto half = hn::Set(d, 0.5F);
    const auto middle = [&](const float* min, const float* max, float c) {
      return hn::Sub(hn::Mul(half, hn::Add(hn::Load(d, min + k), hn::Load(d, max + k))),
                     hn::Set(d, c));
    };
    const auto extent = [&](const float* min, const float* max) {
      return hn::Mul(half, hn::Sub(hn::Load(d, max + k), hn::Load(d, min + k)));
    };
    const auto aside = Aside(d, middle(boxes.min_x, boxes.max_x, center[0]),
                             middle(boxes.min_y, boxes.max_y, center[1]),
                             middle(boxes.min_z, boxes.max_z, center[2]));
    const auto around = Norm(extent(boxes.min_x, boxes.max_x), extent(boxes.min_y, boxes.max_y),
                             extent(boxes.min_z, boxes.max_z));
    return hn::Max(hn::Sub(aside, around), hn::Zero(d));
  }

 private:
  const Traversal& t_;
};

// From sixteen points, or boxes, to a place.
HWY_INLINE hn::Vec<PointTag> Distance(const PointTile& tile, std::size_t k, float x, float y,
                                      float z) {
  const PointTag d;
  return Norm(hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, x)),
              hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, y)),
              hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, z)));
}
HWY_INLINE hn::Vec<PointTag> Distance(const BoxTile& tile, std::size_t k, float x, float y,
                                      float z) {
  const PointTag d;
  return Norm(Gap(d, hn::Load(d, tile.min_x + k), hn::Load(d, tile.max_x + k), hn::Set(d, x)),
              Gap(d, hn::Load(d, tile.min_y + k), hn::Load(d, tile.max_y + k), hn::Set(d, y)),
              Gap(d, hn::Load(d, tile.min_z + k), hn::Load(d, tile.max_z + k), hn::Set(d, z)));
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_CUT_BALLS_INL_H
