// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/index/slice_kernel.cpp"
#include "cloud/index/slice_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "cloud/index/split_rule.h"
#include "internal/bvh/traversal_stack.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace slice {
namespace hn = hwy::HWY_NAMESPACE;

using PointTag = hn::CappedTag<float, 16>;
using IdTag = hn::RebindToUnsigned<PointTag>;
using SliceTag = hn::RebindToSigned<PointTag>;
constexpr auto kTilePoints = static_cast<std::size_t>(kPointWidth);

struct PointBox {
  float min[3], max[3];

  int Longest() const { return longest_axis(Size(0), Size(1), Size(2)); }
  float Size(int axis) const { return max[axis] - min[axis]; }
};

HWY_INLINE PaddedBox Padded(const PointBox& box) {
  return {{box.min[0], box.min[1], box.min[2], 0.0F}, {box.max[0], box.max[1], box.max[2], 0.0F}};
}

struct PointVectors {
  hn::Vec<PointTag> p[3], id;
};

HWY_INLINE PointVectors LoadPoints(const CloudPoint* points) {
  PointVectors v;
  hn::LoadInterleaved4(PointTag(), &points->x, v.p[0], v.p[1], v.p[2], v.id);
  return v;
}

HWY_INLINE PointBox BoxOf(const CloudPoint* points, std::size_t n) {
  const PointTag d;
  const hn::Vec<PointTag> first[3] = {hn::Set(d, points->x), hn::Set(d, points->y),
                                      hn::Set(d, points->z)};
  hn::Vec<PointTag> min[3] = {first[0], first[1], first[2]},
                    max[3] = {first[0], first[1], first[2]};
  std::size_t k = 0;
  for (; k + hn::Lanes(d) <= n; k += hn::Lanes(d)) {
    const PointVectors v = LoadPoints(points + k);
    for (int i = 0; i < 3; ++i) {
      min[i] = hn::Min(min[i], v.p[i]);
      max[i] = hn::Max(max[i], v.p[i]);
    }
  }
  if (k < n) {
    const auto used = hn::FirstN(d, n - k);
    const PointVectors v = LoadPoints(points + k);
    for (int i = 0; i < 3; ++i) {
      const auto p = hn::IfThenElse(used, v.p[i], first[i]);
      min[i] = hn::Min(min[i], p);
      max[i] = hn::Max(max[i], p);
    }
  }
  PointBox box;
  for (int i = 0; i < 3; ++i) {
    box.min[i] = hn::GetLane(hn::MinOfLanes(d, min[i]));
    box.max[i] = hn::GetLane(hn::MaxOfLanes(d, max[i]));
  }
  return box;
}

bool FindSlices(const CloudPoint* points, std::size_t n, std::int32_t count, std::int32_t* slices,
                BoxShape* shape) {
  const PointTag d;
  const SliceTag di;
  const PointBox box = BoxOf(points, n);
  const int axis = box.Longest();
  *shape = {box.Size(axis), std::max(box.Size((axis + 1) % 3), box.Size((axis + 2) % 3))};
  const float per_metre = static_cast<float>(count) / box.Size(axis);
  if (!std::isfinite(per_metre) || !(per_metre > 0.0F)) return false;
  const auto min = hn::Set(d, box.min[axis]), scale = hn::Set(d, per_metre);
  const auto last = hn::Set(d, static_cast<float>(count - 1)), zero = hn::Zero(d);
  for (std::size_t k = 0; k < n; k += hn::Lanes(d)) {
    const PointVectors v = LoadPoints(points + k);
    const auto along = axis == 0 ? v.p[0] : axis == 1 ? v.p[1] : v.p[2];
    const auto slice = hn::Mul(hn::Sub(along, min), scale);
    // Numbers after the last point may be anything.
    hn::StoreU(hn::ConvertTo(di, hn::Min(hn::Max(slice, zero), last)), di, slices + k);
  }
  return true;
}

PaddedBox BoxOfPoints(const CloudPoint* points, std::size_t n) { return Padded(BoxOf(points, n)); }

HWY_INLINE void FillTile(const CloudPoint* points, std::size_t n, PointTile* to) {
  const PointTag d;
  const IdTag du;
  const auto far = hn::Set(d, kFarAway);
  PointTile& tile = *to;
  for (std::size_t k = 0; k < kTilePoints; k += hn::Lanes(d)) {
    const auto used = hn::FirstN(d, n > k ? n - k : 0);
    const PointVectors v = LoadPoints(points + k);
    hn::Store(hn::IfThenElse(used, v.p[0], far), d, tile.x + k);
    hn::Store(hn::IfThenElse(used, v.p[1], far), d, tile.y + k);
    hn::Store(hn::IfThenElse(used, v.p[2], far), d, tile.z + k);
    hn::Store(hn::BitCast(du, hn::IfThenElseZero(used, v.id)), du, tile.id + k);
  }
  tile.count = static_cast<std::int32_t>(n);
}

std::size_t FillTiles(const CloudPoint* points, std::size_t n, PointTile* tiles) {
  std::size_t count = 0;
  for (std::size_t begin = 0; begin < n; begin += kTilePoints, ++count) {
    FillTile(points + begin, std::min(kTilePoints, n - begin), &tiles[count]);
  }
  return count;
}

HWY_INLINE void WriteTile(const CloudPoint* points, std::size_t n, const PointBox& box,
                          TileBatch* batch) {
  FillTile(points, n, &batch->tiles[batch->count]);
  BoxNode& to = batch->boxes[batch->count / kTilePoints];
  const std::size_t slot = batch->count % kTilePoints;
  to.min_x[slot] = box.min[0];
  to.min_y[slot] = box.min[1];
  to.min_z[slot] = box.min[2];
  to.max_x[slot] = box.max[0];
  to.max_y[slot] = box.max[1];
  to.max_z[slot] = box.max[2];
  ++batch->count;
}

// Whether no point lies in the middle of the longest side: rare, and cheap to find out.
HWY_INLINE bool MaySplit(const CloudPoint* points, std::size_t n, const PointBox& box) {
  const PointTag d;
  const int axis = box.Longest();
  const float size = box.Size(axis), min = box.min[axis];
  const auto low = hn::Set(d, min + kMiddleBegin * size),
             high = hn::Set(d, min + kMiddleEnd * size);
  for (std::size_t k = 0; k < n; k += hn::Lanes(d)) {
    const PointVectors v = LoadPoints(points + k);
    const auto along = axis == 0 ? v.p[0] : axis == 1 ? v.p[1] : v.p[2];
    const auto between = hn::AndNot(hn::Lt(along, low), hn::Lt(along, high));
    if (!hn::AllFalse(d, hn::And(between, hn::FirstN(d, n - k)))) return false;
  }
  return size > 0.0F;
}

float Along(const CloudPoint& point, int axis) {
  return axis == 0 ? point.x : axis == 1 ? point.y : point.z;
}

// Splits points in the middle of their box's longest side, if that is worthwhile: those of the
// lower half come to the front.
// @returns how many they are; 0: no split
std::size_t Split(CloudPoint* points, std::size_t n, const PointBox& box) {
  const int axis = box.Longest();
  const float middle = box.min[axis] + 0.5F * box.Size(axis);
  const auto low = static_cast<std::size_t>(
      std::partition(points, points + n,
                     [axis, middle](const CloudPoint& p) { return Along(p, axis) < middle; }) -
      points);
  if (low == 0 || low == n) return 0;
  const PointBox front = BoxOf(points, low), back = BoxOf(points + low, n - low);
  return is_split_worthwhile(Padded(front), Padded(back), Padded(box)) ? low : 0;
}

void MakeTiles(CloudPoint* points, std::size_t n, TileBatch* batch) {
  struct Part {
    std::size_t first, n;
  };
  for (std::size_t begin = 0; begin < n; begin += kTilePoints) {
    // Each split takes one point at least: fifteen levels.
    TraversalStack<Part, stack_capacity(kTilePoints - 1, 2)> stack;
    stack.push({begin, std::min(kTilePoints, n - begin)});
    while (!stack.empty()) {
      const Part part = stack.pop();
      CloudPoint* const p = points + part.first;
      const PointBox box = BoxOf(p, part.n);
      const std::size_t low = MaySplit(p, part.n, box) ? Split(p, part.n, box) : 0;
      if (low == 0) {
        WriteTile(p, part.n, box, batch);
      } else {
        stack.push({part.first, low});
        stack.push({part.first + low, part.n - low});
      }
    }
  }
}

}  // namespace slice

using slice::BoxOfPoints;
using slice::FillTiles;
using slice::FindSlices;
using slice::MakeTiles;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(BoxOfPoints);
HWY_EXPORT(FillTiles);
HWY_EXPORT(FindSlices);
HWY_EXPORT(MakeTiles);

bool find_slices(const CloudPoint* points, std::size_t n, std::int32_t count, std::int32_t* slices,
                 BoxShape* shape) {
  return HWY_DYNAMIC_DISPATCH(FindSlices)(points, n, count, slices, shape);
}

PaddedBox box_of(const CloudPoint* points, std::size_t n) {
  return HWY_DYNAMIC_DISPATCH(BoxOfPoints)(points, n);
}

std::size_t fill_tiles(const CloudPoint* points, std::size_t n, PointTile* tiles) {
  return HWY_DYNAMIC_DISPATCH(FillTiles)(points, n, tiles);
}

void make_tiles(CloudPoint* points, std::size_t n, TileBatch* batch) {
  HWY_DYNAMIC_DISPATCH(MakeTiles)(points, n, batch);
}

}  // namespace ist
#endif
