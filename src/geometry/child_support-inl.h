// Bounds of the support of a TriangleBvh node's children. Compiled once per instruction set: to be
// included again for each.
#if defined(IST_PROXIMITY_CHILD_SUPPORT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_CHILD_SUPPORT_INL_H
#undef IST_PROXIMITY_CHILD_SUPPORT_INL_H
#else
#define IST_PROXIMITY_CHILD_SUPPORT_INL_H
#endif

#include <hwy/highway.h>

#include "internal/geometry/triangle_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace triangle_bvh {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, TriangleBvh::kWidth>;

// Upper bounds of the support n.x [m] of the children in lanes k and following, x from the centre
// of the mesh's bounding box. n is split into a part along the slab's direction, which the slab
// bounds, and a rest, which the box bounds. Any split gives a bound; this one has the shortest
// rest, so that the box adds little where a patch of surface is about perpendicular to n.
HWY_INLINE hn::Vec<FloatTag> ChildSupport(const TriangleBvh::Boxes& boxes,
                                          const TriangleBvh::Slabs& slabs, const float* n,
                                          std::size_t k) {
  const FloatTag d;
  constexpr float kPerLengthSq = 1.0F / (127.0F * 127.0F);
  hn::Vec<FloatTag> direction[3];
  auto along = hn::Zero(d);
  for (int axis = 0; axis < 3; ++axis) {
    const hn::Rebind<std::int8_t, FloatTag> narrow;
    const hn::Rebind<std::int32_t, FloatTag> wide;
    direction[axis] =
        hn::ConvertTo(d, hn::PromoteTo(wide, hn::LoadU(narrow, slabs.direction[axis] + k)));
    along = hn::MulAdd(hn::Set(d, n[axis]), direction[axis], along);
  }
  const auto share = hn::Mul(along, hn::Set(d, kPerLengthSq));
  auto support = hn::Max(hn::Mul(share, hn::Load(d, slabs.low + k)),
                         hn::Mul(share, hn::Load(d, slabs.high + k)));
  for (int axis = 0; axis < 3; ++axis) {
    const auto rest = hn::NegMulAdd(share, direction[axis], hn::Set(d, n[axis]));
    support = hn::Add(support, hn::Max(hn::Mul(rest, hn::Load(d, boxes.min[axis] + k)),
                                       hn::Mul(rest, hn::Load(d, boxes.max[axis] + k))));
  }
  return support;
}

}  // namespace triangle_bvh
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_CHILD_SUPPORT_INL_H
