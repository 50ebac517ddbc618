// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/thinning/voxel_kernel.cpp"
#include "cloud/thinning/voxel_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace voxel {
namespace hn = hwy::HWY_NAMESPACE;

using VoxelTag = hn::CappedTag<float, kPointWidth>;
constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
// The number of unused slots is larger than that of any point: those are kLargestRange and more
// away, in voxels of kSmallestVoxel, at most.
constexpr float kUnusedVoxel = 1e30F;

template <class M>
HWY_INLINE std::uint32_t MaskBits(const M& mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(VoxelTag(), mask, bits);
  return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8;
}

// Finds the voxels' numbers along an axis.
// @returns squared distances to the voxels' centres along that axis, in voxels
HWY_INLINE hn::Vec<VoxelTag> VoxelsAlong(const VoxelGrid& grid, int axis, const PointTile& tile,
                                         std::size_t first, float* number) {
  const VoxelTag d;
  const float* r = grid.R + 3 * axis;
  const auto x = hn::Load(d, tile.x + first), y = hn::Load(d, tile.y + first),
             z = hn::Load(d, tile.z + first);
  const auto rotated = hn::Add(hn::Add(hn::Mul(x, hn::Set(d, r[0])), hn::Mul(y, hn::Set(d, r[1]))),
                               hn::Mul(z, hn::Set(d, r[2])));
  const auto voxels = hn::Add(rotated, hn::Set(d, grid.offset[axis]));
  const auto unused = hn::Eq(x, hn::Set(d, kFarAway));
  const auto bounded = hn::IfThenElse(unused, hn::Set(d, kUnusedVoxel), voxels);
  const auto floor = hn::Floor(bounded);
  hn::Store(floor, d, number);
  const auto off = hn::Sub(hn::Sub(bounded, floor), hn::Set(d, 0.5F));
  return hn::Mul(off, off);
}

// The points of one voxel.
struct VoxelSlots {
  std::uint32_t all, nearest;  // bit k: slot k; the nearest to the centre
};

HWY_INLINE VoxelSlots VoxelOf(const TileVoxels& voxels, std::size_t k) {
  const VoxelTag d;
  const auto x = hn::Set(d, voxels.x[k]), y = hn::Set(d, voxels.y[k]), z = hn::Set(d, voxels.z[k]);
  const auto far = hn::Set(d, std::numeric_limits<float>::infinity());
  auto least = far;
  VoxelSlots voxel = {0, 0};
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    const auto same = hn::And(hn::And(hn::Eq(hn::Load(d, voxels.x + i), x),  //
                                      hn::Eq(hn::Load(d, voxels.y + i), y)),
                              hn::Eq(hn::Load(d, voxels.z + i), z));
    voxel.all |= MaskBits(same) << i;
    least = hn::Min(least, hn::IfThenElse(same, hn::Load(d, voxels.offset_sq + i), far));
  }
  least = hn::MinOfLanes(d, least);
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    voxel.nearest |= MaskBits(hn::Eq(hn::Load(d, voxels.offset_sq + i), least)) << i;
  }
  voxel.nearest &= voxel.all;
  return voxel;
}

std::size_t FindVoxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* voxels) {
  const VoxelTag d;
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    const auto x = VoxelsAlong(grid, 0, tile, i, voxels->x + i);
    const auto y = VoxelsAlong(grid, 1, tile, i, voxels->y + i);
    const auto z = VoxelsAlong(grid, 2, tile, i, voxels->z + i);
    hn::Store(hn::Add(hn::Add(x, y), z), d, voxels->offset_sq + i);
  }
  std::size_t count = 0;
  for (std::uint32_t remaining = (1U << static_cast<std::uint32_t>(tile.count)) - 1U;
       remaining != 0;) {
    const VoxelSlots voxel = VoxelOf(*voxels, hwy::Num0BitsBelowLS1Bit_Nonzero32(remaining));
    for (std::uint32_t best = voxel.nearest; best != 0; best &= best - 1) {
      const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(best);
      voxels->nearest[count++] = static_cast<std::uint8_t>(k);
    }
    remaining &= ~voxel.all;
  }
  return count;
}

}  // namespace voxel

using voxel::FindVoxels;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindVoxels);

std::size_t find_voxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* voxels) {
  return HWY_DYNAMIC_DISPATCH(FindVoxels)(grid, tile, voxels);
}

}  // namespace ist
#endif
