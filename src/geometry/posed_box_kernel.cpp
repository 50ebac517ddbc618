// Lower bounds of the distances of a node's children from a solid box that is turned against them.
// Compiled once per instruction set; the best one available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/posed_box_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "geometry/posed_box_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace posed_box {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, TriangleBvh::kWidth>;
using V = hn::Vec<FloatTag>;

void Bounds(const TriangleBvh::Boxes& node, const PosedBox& box, float* bounds) {
  const FloatTag d;
  const V none = hn::Zero(d), slack = hn::Set(d, box.slack), middle = hn::Set(d, 0.5F);
  for (std::size_t k = 0; k < TriangleBvh::kWidth; k += hn::Lanes(d)) {
    V to[3], half[3];  // from the box's centre to the child's, in M
    V in_M_sq = none, below = hn::Set(d, box.offset);
    for (int i = 0; i < 3; ++i) {
      const V low = hn::Load(d, node.min[i] + k), high = hn::Load(d, node.max[i] + k);
      half[i] = hn::Mul(middle, hn::Sub(high, low));
      to[i] = hn::Sub(hn::Mul(middle, hn::Add(low, high)), hn::Set(d, box.center_M[i]));
      const V size = hn::Add(half[i], hn::Set(d, box.half_M[i]));
      const V gap = hn::Max(hn::Sub(hn::Sub(hn::Abs(to[i]), size), slack), none);
      in_M_sq = hn::MulAdd(gap, gap, in_M_sq);
      const V n = hn::Set(d, box.normal_M[i]);
      below = hn::Sub(below, hn::MulAdd(n, to[i], hn::Mul(hn::Abs(n), half[i])));
    }
    V in_O_sq = none;
    for (int i = 0; i < 3; ++i) {
      V along = none, size = hn::Set(d, box.half_O[i]);
      for (int j = 0; j < 3; ++j) {
        const V r = hn::Set(d, box.rotation[i][j]);
        along = hn::MulAdd(r, to[j], along);
        size = hn::MulAdd(hn::Abs(r), half[j], size);
      }
      const V gap = hn::Max(hn::Sub(hn::Sub(hn::Abs(along), size), slack), none);
      in_O_sq = hn::MulAdd(gap, gap, in_O_sq);
    }
    const V by_boxes = hn::Sqrt(hn::Max(in_M_sq, in_O_sq));
    // Sums of squares and their root are rounded, too.
    const V rounded = hn::Mul(by_boxes, hn::Set(d, 1.0F - 1e-6F));
    hn::Store(hn::Max(rounded, hn::Sub(below, slack)), d, bounds + k);
  }
}

}  // namespace posed_box

void PosedBoxBounds(const TriangleBvh::Boxes& node, const PosedBox& box, float* bounds) {
  posed_box::Bounds(node, box, bounds);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(PosedBoxBounds);

void posed_box_bounds(const TriangleBvh::Boxes& node, const PosedBox& box,
                      float bounds[TriangleBvh::kWidth]) {
  HWY_DYNAMIC_DISPATCH(PosedBoxBounds)(node, box, bounds);
}

}  // namespace ist
#endif
