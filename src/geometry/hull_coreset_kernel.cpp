// The farthest of many points. Compiled once per instruction set; the best one available is chosen
// at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/hull_coreset_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "internal/geometry/hull_coreset.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hull_coreset {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kWidth = 16;
using FloatTag = hn::CappedTag<float, kWidth>;
using IndexTag = hn::RebindToSigned<FloatTag>;

std::uint32_t Farthest(const float* lanes, std::size_t count, const float* n) {
  const FloatTag d;
  const IndexTag di;
  const float *x = lanes, *y = lanes + count, *z = lanes + 2 * count;
  const auto nx = hn::Set(d, n[0]), ny = hn::Set(d, n[1]), nz = hn::Set(d, n[2]);
  auto largest = hn::Set(d, -3e38F);
  auto found = hn::Zero(di);
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    const auto along =
        hn::MulAdd(nx, hn::LoadU(d, x + k),
                   hn::MulAdd(ny, hn::LoadU(d, y + k), hn::Mul(nz, hn::LoadU(d, z + k))));
    const auto is_larger = hn::Gt(along, largest);
    largest = hn::Max(along, largest);
    found = hn::IfThenElse(hn::RebindMask(di, is_larger), hn::Set(di, static_cast<std::int32_t>(k)),
                           found);
  }
  alignas(64) float values[kWidth];
  alignas(64) std::int32_t blocks[kWidth];
  hn::Store(largest, d, values);
  hn::Store(found, di, blocks);
  std::size_t best = 0;
  for (std::size_t k = 1; k < hn::Lanes(d); ++k) best = values[k] > values[best] ? k : best;
  return static_cast<std::uint32_t>(blocks[best]) + static_cast<std::uint32_t>(best);
}

}  // namespace hull_coreset

std::uint32_t FarthestOfLanes(const float* lanes, std::size_t count, const float* n) {
  return hull_coreset::Farthest(lanes, count, n);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FarthestOfLanes);

std::uint32_t farthest_of_lanes(const float* lanes, std::size_t count, const float n[3]) {
  return HWY_DYNAMIC_DISPATCH(FarthestOfLanes)(lanes, count, n);
}

}  // namespace ist
#endif
