// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/thinning/voxel_kernel.cpp"
#include "cloud/thinning/voxel_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

#include "internal/geometry/lanes-inl.h"

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

using Bits = hn::RebindToUnsigned<VoxelTag>;

// The whole numbers of voxels k, k + 1, ... as integers. Equal numbers have equal ones.
HWY_INLINE hn::Vec<Bits> Whole(const float* number) {
  const auto whole = hn::ConvertTo(hn::RebindToSigned<VoxelTag>(), hn::Load(VoxelTag(), number));
  return hn::BitCast(Bits(), whole);
}

// Finds the entries of voxels in a table.
HWY_INLINE void HashVoxels(TileVoxels* voxels, std::size_t first) {
  const Bits d;
  // Odd numbers near 2^32 over the golden ratio, the plastic number and its square.
  const auto x = hn::Mul(Whole(voxels->x + first), hn::Set(d, 0x9E3779B1U));
  const auto y = hn::Mul(Whole(voxels->y + first), hn::Set(d, 0xC13FA9A9U));
  const auto z = hn::Mul(Whole(voxels->z + first), hn::Set(d, 0x91E10DA5U));
  const auto h = hn::Xor(hn::Xor(x, y), z);
  const auto entry = hn::And(hn::Xor(h, hn::ShiftRight<15>(h)), hn::Set(d, kVoxelTableSize - 1));
  hn::Store(entry, d, voxels->entry + first);
}

// Bit k: no other point of the same voxel is nearer to its centre than that in slot k. Neighbours
// lie in few voxels, which are looked at one by one.
// @param used  bits of the slots that have points
HWY_INLINE std::uint32_t Nearest(const TileVoxels& voxels, std::uint32_t used) {
  const VoxelTag d;
  const auto infinity = hn::Set(d, std::numeric_limits<float>::infinity());
  alignas(64) float offset_sq[kSlots];  // infinite in other voxels
  std::uint32_t all = 0;
  for (std::uint32_t left = used; left != 0;) {
    const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(left);
    const auto x = hn::Set(d, voxels.x[k]), y = hn::Set(d, voxels.y[k]),
               z = hn::Set(d, voxels.z[k]);
    std::uint32_t here = 0, nearest = 0;
    auto least = infinity;
    for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
      const auto same = hn::And(
          hn::And(hn::Eq(hn::Load(d, voxels.x + i), x), hn::Eq(hn::Load(d, voxels.y + i), y)),
          hn::Eq(hn::Load(d, voxels.z + i), z));
      const auto own = hn::IfThenElse(same, hn::Load(d, voxels.offset_sq + i), infinity);
      hn::Store(own, d, offset_sq + i);
      least = hn::Min(least, own);
      here |= lanes::MaskBits(d, same) << i;
    }
    least = hn::MinOfLanes(d, least);
    for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
      nearest |= lanes::MaskBits(d, hn::Eq(hn::Load(d, offset_sq + i), least)) << i;
    }
    all |= nearest;
    left &= ~here & (left - 1);  // ends also where a number is none
  }
  return all;
}

std::size_t FindVoxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* voxels) {
  const VoxelTag d;
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    const auto x = VoxelsAlong(grid, 0, tile, i, voxels->x + i);
    const auto y = VoxelsAlong(grid, 1, tile, i, voxels->y + i);
    const auto z = VoxelsAlong(grid, 2, tile, i, voxels->z + i);
    hn::Store(hn::Add(hn::Add(x, y), z), d, voxels->offset_sq + i);
    HashVoxels(voxels, i);
  }
  const std::uint32_t used = (1U << static_cast<std::uint32_t>(tile.count)) - 1U;
  std::size_t count = 0;
  for (std::uint32_t best = Nearest(*voxels, used); best != 0; best &= best - 1) {
    voxels->nearest[count++] = static_cast<std::uint8_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(best));
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
