// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/thinning/rival_kernel.cpp"
#include "cloud/thinning/rival_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

#include "internal/geometry/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace rival {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kPointWidth>;
using V = hn::Vec<Tag>;

// Bit k: child k meets the box of all spheres.
HWY_INLINE std::uint32_t ChildrenNear(const BoxNode& node, const RivalSpheres& spheres) {
  const Tag d;
  std::uint32_t near = 0;
  const auto off = [d](const float* min, const float* max, float low, float high) {
    return hn::Max(hn::Sub(hn::Load(d, min), hn::Set(d, high)),
                   hn::Sub(hn::Set(d, low), hn::Load(d, max)));
  };
  for (std::size_t k = 0; k < kBoxWidth; k += hn::Lanes(d)) {
    const V off_all =
        hn::Max(hn::Max(off(node.min_x + k, node.max_x + k, spheres.min[0], spheres.max[0]),
                        off(node.min_y + k, node.max_y + k, spheres.min[1], spheres.max[1])),
                off(node.min_z + k, node.max_z + k, spheres.min[2], spheres.max[2]));
    near |= lanes::MaskBits(d, hn::Le(off_all, hn::Zero(d))) << k;
  }
  return near & ((1U << static_cast<std::uint32_t>(node.count)) - 1U);
}

HWY_INLINE V Off(float min, float max, const float* v) {
  const Tag d;
  const V place = hn::Load(d, v);
  return hn::Max(hn::Max(hn::Sub(hn::Set(d, min), place), hn::Sub(place, hn::Set(d, max))),
                 hn::Zero(d));
}

// The squared distances of spheres' centres from the box of a child, less their squared radii.
HWY_INLINE V Gaps(const BoxNode& node, std::size_t child, const RivalSpheres& spheres,
                  std::size_t first) {
  const Tag d;
  const V x = Off(node.min_x[child], node.max_x[child], &spheres.x[first]);
  const V y = Off(node.min_y[child], node.max_y[child], &spheres.y[first]);
  const V z = Off(node.min_z[child], node.max_z[child], &spheres.z[first]);
  // Products and sums are rounded one by one, so that all instruction sets agree.
  const V squared = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
  return hn::Sub(squared, hn::Load(d, &spheres.radius_sq[first]));
}

HWY_INLINE float LeastGap(const BoxNode& node, std::size_t child, const RivalSpheres& spheres) {
  const Tag d;
  V least = hn::Set(d, kFarAway);
  for (std::size_t i = 0; i < spheres.count; i += hn::Lanes(d)) {
    least = hn::Min(least, Gaps(node, child, spheres, i));
  }
  return hn::GetLane(hn::MinOfLanes(d, least));
}

std::size_t FindMeetingSpheres(const BoxNode& node, std::size_t child, const RivalSpheres& spheres,
                               std::uint16_t* numbers) {
  const Tag d;
  std::size_t count = 0;
  for (std::size_t i = 0; i < spheres.count; i += hn::Lanes(d)) {
    std::uint32_t meeting = lanes::MaskBits(d, hn::Le(Gaps(node, child, spheres, i), hn::Zero(d)));
    for (; meeting != 0; meeting &= meeting - 1) {
      const std::size_t number = i + hwy::Num0BitsBelowLS1Bit_Nonzero32(meeting);
      if (number < spheres.count) numbers[count++] = static_cast<std::uint16_t>(number);
    }
  }
  return count;
}

bool IsAnyInSpheres(const PointTile& tile, const RivalSpheres& spheres,
                    const std::uint16_t* numbers, std::size_t count) {
  const Tag d;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
    const V tile_x = hn::Load(d, tile.x + k), tile_y = hn::Load(d, tile.y + k),
            tile_z = hn::Load(d, tile.z + k);
    auto any = hn::Lt(tile_x, tile_x);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t number = numbers[i];
      const V x = hn::Sub(tile_x, hn::Set(d, spheres.x[number])),
              y = hn::Sub(tile_y, hn::Set(d, spheres.y[number])),
              z = hn::Sub(tile_z, hn::Set(d, spheres.z[number]));
      const V squared = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
      any = hn::Or(any, hn::Le(squared, hn::Set(d, spheres.radius_sq[number])));
    }
    if (!hn::AllFalse(d, any)) return true;
  }
  return false;
}

std::uint32_t FindRivalChildren(const BoxNode& node, const RivalSpheres& spheres, float* gaps) {
  std::uint32_t found = 0;
  for (std::uint32_t near = ChildrenNear(node, spheres); near != 0; near &= near - 1) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(near);
    gaps[k] = LeastGap(node, k, spheres);
    if (gaps[k] <= 0.0F) found |= near & (0U - near);
  }
  return found;
}

// Bound of the rounding of a point's place in the grid, of its rivals' places, and of the sphere,
// as a share of the coordinates involved: some ten roundings to float.
constexpr float kRounding = 3e-6F;

// The offset along an axis of the grid from a point to its voxel's centre, in voxels.
HWY_INLINE V ToVoxelCenter(const VoxelGrid& grid, int axis, V x, V y, V z, V number) {
  const Tag d;
  const float* r = grid.R + 3 * axis;
  const V place =
      hn::Add(hn::Add(hn::Add(hn::Mul(x, hn::Set(d, r[0])), hn::Mul(y, hn::Set(d, r[1]))),
                      hn::Mul(z, hn::Set(d, r[2]))),
              hn::Set(d, grid.offset[axis]));
  return hn::Sub(hn::Set(d, 0.5F), hn::Sub(place, number));
}

// Finds the spheres of candidates first, first + 1, ...
// @param min, max  extended by the spheres, by axis
HWY_INLINE void FindSpheres(const VoxelGrid& grid, const VoxelCandidates& c, std::size_t first,
                            RivalSpheres* spheres, V* min, V* max) {
  const Tag d;
  const V x = hn::Load(d, &c.x[first]), y = hn::Load(d, &c.y[first]), z = hn::Load(d, &c.z[first]);
  const V to_center[3] = {ToVoxelCenter(grid, 0, x, y, z, hn::Load(d, &c.voxel_x[first])),
                          ToVoxelCenter(grid, 1, x, y, z, hn::Load(d, &c.voxel_y[first])),
                          ToVoxelCenter(grid, 2, x, y, z, hn::Load(d, &c.voxel_z[first]))};
  const auto edge = static_cast<float>(grid.edge);
  // Rivals are near, so their coordinates are as large.
  const V size =
      hn::Add(hn::Add(hn::Abs(x), hn::Abs(y)), hn::Add(hn::Abs(z), hn::Set(d, 2.0F * edge)));
  const V radius = hn::Add(hn::Mul(hn::Set(d, edge), hn::Sqrt(hn::Load(d, &c.offset_sq[first]))),
                           hn::Mul(hn::Set(d, kRounding), size));
  hn::Store(hn::Mul(radius, radius), d, &spheres->radius_sq[first]);
  const V p[3] = {x, y, z};
  float* const center[3] = {&spheres->x[first], &spheres->y[first], &spheres->z[first]};
  for (int k = 0; k < 3; ++k) {
    // The transpose of R, which is a rotation over the edge, is its inverse over the edge's square.
    V place = p[k];
    for (int axis = 0; axis < 3; ++axis) {
      const V step = hn::Set(d, edge * (edge * grid.R[3 * axis + k]));
      place = hn::Add(place, hn::Mul(step, to_center[axis]));
    }
    hn::Store(place, d, center[k]);
    min[k] = hn::Min(min[k], hn::Sub(place, radius));
    max[k] = hn::Max(max[k], hn::Add(place, radius));
  }
}

void FindRivalSpheres(const VoxelGrid& grid, const VoxelCandidates& candidates,
                      RivalSpheres* spheres) {
  const Tag d;
  const V high = hn::Set(d, std::numeric_limits<float>::max());
  V min[3] = {high, high, high}, max[3] = {hn::Neg(high), hn::Neg(high), hn::Neg(high)};
  for (std::size_t i = 0; i < candidates.count; i += hn::Lanes(d)) {
    FindSpheres(grid, candidates, i, spheres, min, max);
  }
  for (int k = 0; k < 3; ++k) {
    spheres->min[k] = hn::GetLane(hn::MinOfLanes(d, min[k]));
    spheres->max[k] = hn::GetLane(hn::MaxOfLanes(d, max[k]));
  }
}

}  // namespace rival

using rival::FindMeetingSpheres;
using rival::FindRivalChildren;
using rival::FindRivalSpheres;
using rival::IsAnyInSpheres;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindMeetingSpheres);
HWY_EXPORT(FindRivalChildren);
HWY_EXPORT(FindRivalSpheres);
HWY_EXPORT(IsAnyInSpheres);

void find_rival_spheres(const VoxelGrid& grid, VoxelCandidates* candidates, RivalSpheres* spheres) {
  VoxelCandidates& c = *candidates;
  const std::size_t count = c.count;
  const std::size_t padded = (count + kPointWidth - 1) / kPointWidth * kPointWidth;
  for (std::size_t i = count; i < padded; ++i) {
    for (auto* numbers : {&c.voxel_x, &c.voxel_y, &c.voxel_z, &c.offset_sq, &c.x, &c.y, &c.z}) {
      (*numbers)[i] = (*numbers)[0];
    }
  }
  HWY_DYNAMIC_DISPATCH(FindRivalSpheres)(grid, c, spheres);
  spheres->count = count;
  for (std::size_t i = count; i < padded; ++i) {
    spheres->x[i] = spheres->y[i] = spheres->z[i] = kFarAway;
    spheres->radius_sq[i] = 0.0F;
  }
}

std::uint32_t find_rival_children(const BoxNode& node, const RivalSpheres& spheres, float* gaps) {
  return HWY_DYNAMIC_DISPATCH(FindRivalChildren)(node, spheres, gaps);
}

std::size_t find_meeting_spheres(const BoxNode& node, std::size_t child,
                                 const RivalSpheres& spheres, std::uint16_t* numbers) {
  return HWY_DYNAMIC_DISPATCH(FindMeetingSpheres)(node, child, spheres, numbers);
}

bool is_any_in_spheres(const PointTile& tile, const RivalSpheres& spheres,
                       const std::uint16_t* numbers, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(IsAnyInSpheres)(tile, spheres, numbers, count);
}

}  // namespace ist
#endif
