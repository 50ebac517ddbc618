// How far parts of a mesh reach along a direction, at most. Compiled once per instruction set: to
// be included again for each.
#if defined(IST_PROXIMITY_SLAB_REACH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_SLAB_REACH_INL_H
#undef IST_PROXIMITY_SLAB_REACH_INL_H
#else
#define IST_PROXIMITY_SLAB_REACH_INL_H
#endif

#include <hwy/highway.h>

#include "ist_proximity/geometry/triangle_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using ReachTag = hn::CappedTag<float, TriangleBvh::kWidth>;

// The largest n . x [m] of lanes of children from the k-th on, x from the middle of the mesh's box.
// n is split into a part along the slab's direction, of which the slab tells, and what is left, of
// which the box does: where the two directions are close that is little, and so is what a box
// around a patch aslant adds. Any split is a bound; this one leaves the shortest rest.
HWY_INLINE hn::Vec<ReachTag> Reach(const TriangleBvh::Boxes& boxes, const TriangleBvh::Slabs& slabs,
                                   const float* n, std::size_t k) {
  const ReachTag d;
  constexpr float kPerLengthSq = 1.0F / (127.0F * 127.0F);
  hn::Vec<ReachTag> direction[3];
  auto along = hn::Zero(d);
  for (int axis = 0; axis < 3; ++axis) {
    const hn::Rebind<std::int8_t, ReachTag> narrow;
    const hn::Rebind<std::int32_t, ReachTag> wide;
    direction[axis] =
        hn::ConvertTo(d, hn::PromoteTo(wide, hn::LoadU(narrow, slabs.direction[axis] + k)));
    along = hn::MulAdd(hn::Set(d, n[axis]), direction[axis], along);
  }
  const auto share = hn::Mul(along, hn::Set(d, kPerLengthSq));
  auto reach = hn::Max(hn::Mul(share, hn::Load(d, slabs.low + k)),
                       hn::Mul(share, hn::Load(d, slabs.high + k)));
  for (int axis = 0; axis < 3; ++axis) {
    const auto rest = hn::NegMulAdd(share, direction[axis], hn::Set(d, n[axis]));
    reach = hn::Add(reach, hn::Max(hn::Mul(rest, hn::Load(d, boxes.min[axis] + k)),
                                   hn::Mul(rest, hn::Load(d, boxes.max[axis] + k))));
  }
  return reach;
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_SLAB_REACH_INL_H
