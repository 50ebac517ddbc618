// Lower bounds of the distance of oriented boxes. Compiled once per instruction set; the best one
// available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/oriented_box_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "internal/geometry/surface_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace oriented_box {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, SurfaceBvh::kWidth>;
using V = hn::Vec<FloatTag>;

struct Separation {
  V largest;  // [m] of all axes, negative where they overlap
  V outside_sq;
};

HWY_INLINE void AddAxis(FloatTag d, V gap, Separation* s) {
  s->largest = hn::Max(s->largest, gap);
  const V outside = hn::Max(gap, hn::Zero(d));
  s->outside_sq = hn::MulAdd(outside, outside, s->outside_sq);
}

void Bounds(const SurfaceBvh::Node& node, const OrientedBox& box, float* bounds) {
  const FloatTag d;
  for (std::size_t k = 0; k < SurfaceBvh::kWidth; k += hn::Lanes(d)) {
    V to[3], axis[3][3], half[3];
    for (int i = 0; i < 3; ++i) {
      to[i] = hn::Sub(hn::Load(d, node.center[i] + k), hn::Set(d, box.center[i]));
      half[i] = hn::Load(d, node.half[i] + k);
      for (int j = 0; j < 3; ++j) axis[i][j] = hn::Load(d, node.axis[i][j] + k);
    }
    const auto dot = [&](const V* u, const float* v) {
      return hn::MulAdd(u[0], hn::Set(d, v[0]),
                        hn::MulAdd(u[1], hn::Set(d, v[1]), hn::Mul(u[2], hn::Set(d, v[2]))));
    };
    V cosine[3][3];  // of axis i of the child and axis j of the box, without sign
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) cosine[i][j] = hn::Abs(dot(axis[i], box.axis[j]));
    }
    const V lowest = hn::Set(d, -1e30F);
    Separation of_child{lowest, hn::Zero(d)}, of_box{lowest, hn::Zero(d)};
    for (int i = 0; i < 3; ++i) {
      const V at = hn::Abs(
          hn::MulAdd(axis[i][0], to[0], hn::MulAdd(axis[i][1], to[1], hn::Mul(axis[i][2], to[2]))));
      V size = half[i];
      for (int j = 0; j < 3; ++j) size = hn::MulAdd(cosine[i][j], hn::Set(d, box.half[j]), size);
      AddAxis(d, hn::Sub(at, size), &of_child);
      V other_size = hn::Set(d, box.half[i]);
      for (int j = 0; j < 3; ++j) other_size = hn::MulAdd(cosine[j][i], half[j], other_size);
      AddAxis(d, hn::Sub(hn::Abs(dot(to, box.axis[i])), other_size), &of_box);
    }
    V along = dot(to, box.direction);
    for (int i = 0; i < 3; ++i) {
      along = hn::NegMulAdd(hn::Abs(dot(axis[i], box.direction)), half[i], along);
      const float share = box.axis[i][0] * box.direction[0] + box.axis[i][1] * box.direction[1] +
                          box.axis[i][2] * box.direction[2];
      along = hn::NegMulAdd(hn::Abs(hn::Set(d, share)), hn::Set(d, box.half[i]), along);
    }
    const V apart = hn::Sqrt(hn::Max(of_child.outside_sq, of_box.outside_sq));
    const V overlap = hn::Max(of_child.largest, of_box.largest);
    const V by_boxes = hn::IfThenElse(hn::Gt(apart, hn::Zero(d)), apart, overlap);
    hn::Store(hn::Max(by_boxes, along), d, bounds + k);
  }
}

void Supports(const SurfaceBvh::Node& node, const float* n, float* supports) {
  const FloatTag d;
  const V n_lanes[3] = {hn::Set(d, n[0]), hn::Set(d, n[1]), hn::Set(d, n[2])};
  for (std::size_t k = 0; k < SurfaceBvh::kWidth; k += hn::Lanes(d)) {
    const auto along = [&](const float(*rows)[SurfaceBvh::kWidth]) {
      return hn::MulAdd(hn::Load(d, rows[0] + k), n_lanes[0],
                        hn::MulAdd(hn::Load(d, rows[1] + k), n_lanes[1],
                                   hn::Mul(hn::Load(d, rows[2] + k), n_lanes[2])));
    };
    V sum = along(node.center);
    for (int i = 0; i < 3; ++i) {
      sum = hn::MulAdd(hn::Abs(along(node.axis[i])), hn::Load(d, node.half[i] + k), sum);
    }
    hn::Store(sum, d, supports + k);
  }
}

}  // namespace oriented_box

void OrientedBoxSupports(const SurfaceBvh::Node& node, const float* n, float* supports) {
  oriented_box::Supports(node, n, supports);
}

void OrientedBoxBounds(const SurfaceBvh::Node& node, const OrientedBox& box, float* bounds) {
  oriented_box::Bounds(node, box, bounds);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(OrientedBoxBounds);
HWY_EXPORT(OrientedBoxSupports);

void oriented_box_bounds(const SurfaceBvh::Node& node, const OrientedBox& box,
                         float bounds[SurfaceBvh::kWidth]) {
  HWY_DYNAMIC_DISPATCH(OrientedBoxBounds)(node, box, bounds);
}

void oriented_box_supports(const SurfaceBvh::Node& node, const float n[3],
                           float supports[SurfaceBvh::kWidth]) {
  HWY_DYNAMIC_DISPATCH(OrientedBoxSupports)(node, n, supports);
}

}  // namespace ist
#endif
