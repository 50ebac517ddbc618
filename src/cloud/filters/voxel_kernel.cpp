// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/filters/voxel_kernel.cpp"
#include "cloud/filters/voxel_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using VoxelTag = hn::CappedTag<float, kPointWidth>;
constexpr auto kSlots = static_cast<std::size_t>(kPointWidth);
constexpr float kUnusedCell = 1.5e9F;  // of unused slots: fits an integer, beyond all others

template <class M>
HWY_INLINE std::uint32_t MaskBits(const M& mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(VoxelTag(), mask, bits);
  return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8;
}

HWY_INLINE hn::Vec<VoxelTag> Divide(const VoxelGrid& grid, int axis, const PointTile& tile,
                                   std::size_t first, float* cell) {
  const VoxelTag d;
  const float* turn = grid.turn + 3 * axis;
  const auto x = hn::Load(d, tile.x + first), y = hn::Load(d, tile.y + first),
             z = hn::Load(d, tile.z + first);
  const auto turned =
      hn::Add(hn::Add(hn::Mul(x, hn::Set(d, turn[0])), hn::Mul(y, hn::Set(d, turn[1]))),
              hn::Mul(z, hn::Set(d, turn[2])));
  const auto cells = hn::Add(turned, hn::Set(d, grid.offset[axis]));
  const auto unused = hn::Eq(x, hn::Set(d, kFarAway));
  const auto bounded = hn::IfThenElse(unused, hn::Set(d, kUnusedCell), cells);
  const auto floor = hn::Floor(bounded);
  hn::Store(floor, d, cell);
  const auto off = hn::Sub(hn::Sub(bounded, floor), hn::Set(d, 0.5F));
  return hn::Mul(off, off);
}

// The slots of those in the same cell as slot k, and among them the nearest to its centre.
struct Voxel {
  std::uint32_t slots, nearest;
};

HWY_INLINE Voxel VoxelOf(const TileVoxels& cells, std::size_t k) {
  const VoxelTag d;
  const auto x = hn::Set(d, cells.x[k]), y = hn::Set(d, cells.y[k]), z = hn::Set(d, cells.z[k]);
  const auto far = hn::Set(d, std::numeric_limits<float>::infinity());
  auto least = far;
  Voxel cell = {0, 0};
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    const auto same = hn::And(hn::And(hn::Eq(hn::Load(d, cells.x + i), x),  //
                                      hn::Eq(hn::Load(d, cells.y + i), y)),
                              hn::Eq(hn::Load(d, cells.z + i), z));
    cell.slots |= MaskBits(same) << i;
    least = hn::Min(least, hn::IfThenElse(same, hn::Load(d, cells.offset_sq + i), far));
  }
  least = hn::MinOfLanes(d, least);
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    cell.nearest |= MaskBits(hn::Eq(hn::Load(d, cells.offset_sq + i), least)) << i;
  }
  cell.nearest &= cell.slots;
  return cell;
}

std::size_t FindVoxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* cells) {
  const VoxelTag d;
  for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
    const auto x = Divide(grid, 0, tile, i, cells->x + i);
    const auto y = Divide(grid, 1, tile, i, cells->y + i);
    const auto z = Divide(grid, 2, tile, i, cells->z + i);
    hn::Store(hn::Add(hn::Add(x, y), z), d, cells->offset_sq + i);
  }
  std::size_t count = 0;
  for (std::uint32_t left = (1U << static_cast<std::uint32_t>(tile.count)) - 1U; left != 0;) {
    const Voxel cell = VoxelOf(*cells, hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
    for (std::uint32_t best = cell.nearest; best != 0; best &= best - 1) {
      const std::size_t k = hwy::Num0BitsBelowLS1Bit_Nonzero32(best);
      cells->nearest[count++] = static_cast<std::uint8_t>(k);
    }
    left &= ~cell.slots;
  }
  return count;
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindVoxels);

std::size_t find_voxels(const VoxelGrid& grid, const PointTile& tile, TileVoxels* cells) {
  return HWY_DYNAMIC_DISPATCH(FindVoxels)(grid, tile, cells);
}

}  // namespace ist
#endif
