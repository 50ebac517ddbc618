// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/index/point_cells_kernel.cpp"
#include "cloud/index/point_cells_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "cloud/filters/compress-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace point_cells {
namespace hn = hwy::HWY_NAMESPACE;

using PointTag = hn::CappedTag<float, 16>;
using IdTag = hn::RebindToUnsigned<PointTag>;
using CellTag = hn::RebindToSigned<PointTag>;

// The four bits of a cell's number, each followed by two zeros.
static_assert(PointGrid::kBits == 4, "masks");
HWY_INLINE hn::Vec<CellTag> Spread(const PointGrid& grid, int axis, hn::Vec<PointTag> v) {
  const PointTag d;
  const CellTag di;
  const auto cells = hn::Mul(hn::Sub(v, hn::Set(d, grid.min[axis])), hn::Set(d, grid.per_metre));
  const auto bounded = hn::Min(hn::Max(cells, hn::Zero(d)), hn::Set(d, grid.last[axis]));
  auto bits = hn::ConvertTo(di, bounded);
  bits = hn::And(hn::Or(bits, hn::ShiftLeft<4>(bits)), hn::Set(di, 0x0C3));
  return hn::And(hn::Or(bits, hn::ShiftLeft<2>(bits)), hn::Set(di, 0x249));
}

// `first` and the numbers after it. Iota of a variable goes through memory in Highway 1.0.
HWY_INLINE hn::Vec<IdTag> From(std::uint32_t first) {
  const IdTag du;
  return hn::Add(hn::Iota(du, 0U), hn::Set(du, first));
}

// Appends the cells of the points in slots from k on that are to be kept. @returns how many
template <class M>
HWY_INLINE std::size_t Append(const PointGrid& grid, hn::Vec<PointTag> x, hn::Vec<PointTag> y,
                              hn::Vec<PointTag> z, const M& keep, std::size_t k,
                              std::uint32_t* cells) {
  const IdTag du;
  const auto cell = hn::Or(hn::Or(Spread(grid, 0, x), hn::ShiftLeft<1>(Spread(grid, 1, y))),
                           hn::ShiftLeft<2>(Spread(grid, 2, z)));
  const auto entry =
      hn::Or(hn::BitCast(du, hn::ShiftLeft<8>(cell)), From(static_cast<std::uint32_t>(k)));
  hn::StoreU(compress::Compressor<PointTag>(keep)(du, entry), du, cells);
  return hn::CountTrue(PointTag(), keep);
}

std::size_t FindCellsOfCrop(const PointGrid& grid, const CropBatch& crop, std::size_t count,
                            std::uint32_t first_id, CellBatch* batch) {
  const PointTag d;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    const auto x = hn::Load(d, crop.x + k), y = hn::Load(d, crop.y + k),
               z = hn::Load(d, crop.z + k);
    const auto id = From(first_id + static_cast<std::uint32_t>(k));
    hn::StoreInterleaved4(x, y, z, hn::BitCast(d, id), d, &batch->points[k].x);
    const auto keep = hn::And(hn::Eq(x, x), hn::FirstN(d, count - k));
    kept += Append(grid, x, y, z, keep, k, batch->cells + kept);
  }
  return kept;
}

std::size_t FindCellsOfPoints(const PointGrid& grid, std::size_t count, CellBatch* batch) {
  const PointTag d;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    hn::Vec<PointTag> x, y, z, id;
    hn::LoadInterleaved4(d, &batch->points[k].x, x, y, z, id);
    kept += Append(grid, x, y, z, hn::FirstN(d, count - k), k, batch->cells + kept);
  }
  return kept;
}

}  // namespace point_cells

using point_cells::FindCellsOfCrop;
using point_cells::FindCellsOfPoints;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindCellsOfCrop);
HWY_EXPORT(FindCellsOfPoints);

std::size_t find_cells(const PointGrid& grid, const CropBatch& crop, std::size_t count,
                       std::uint32_t first_id, CellBatch* batch) {
  return HWY_DYNAMIC_DISPATCH(FindCellsOfCrop)(grid, crop, count, first_id, batch);
}

std::size_t find_cells(const PointGrid& grid, std::size_t count, CellBatch* batch) {
  return HWY_DYNAMIC_DISPATCH(FindCellsOfPoints)(grid, count, batch);
}

}  // namespace ist
#endif
