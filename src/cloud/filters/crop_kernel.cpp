// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/filters/crop_kernel.cpp"
#include "cloud/filters/crop_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using DoubleTag = hn::CappedTag<double, 8>;
using FloatTag = hn::Rebind<float, DoubleTag>;

HWY_INLINE hn::Vec<DoubleTag> LoadAsDouble(DoubleTag d, const double* from) {
  return hn::Load(d, from);
}
HWY_INLINE hn::Vec<DoubleTag> LoadAsDouble(DoubleTag d, const float* from) {
  return hn::PromoteTo(d, hn::Load(FloatTag(), from));
}

// What is asked of every point, and where it goes, in registers.
template <bool kHasRegion>
class Cropper {
 public:
  Cropper(const CropKernelParameters& range, CropBatch* block) : range_(range), block_(*block) {}

  // Takes as many points as a vector holds, to slots from k on.
  template <class V>
  HWY_INLINE void Take(V x, V y, V z, std::size_t k) {
    const DoubleTag d;
    const FloatTag f;
    const auto sq = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
    // False for NaN, and for what overflows.
    auto keep = hn::And(hn::Ge(sq, hn::Set(d, range_.min_range_sq)),
                        hn::Le(sq, hn::Set(d, range_.max_range_sq)));
    if constexpr (kHasRegion) {
      const std::size_t in_range = hn::CountTrue(d, keep);
      keep = hn::And(keep, IsNear(x, y, z));
      tally.beyond += in_range - hn::CountTrue(d, keep);
    }
    const auto nan = hn::Set(d, std::numeric_limits<double>::quiet_NaN());
    const std::size_t kept = hn::CountTrue(d, keep);
    auto to_x = nan;
    if (kept > 0) {
      to_x = hn::IfThenElse(keep, Moved(0, x, y, z), nan);
      hn::Store(hn::DemoteTo(f, Moved(1, x, y, z)), f, block_.y + k);
      hn::Store(hn::DemoteTo(f, Moved(2, x, y, z)), f, block_.z + k);
      tally.kept += kept;
    }
    hn::Store(hn::DemoteTo(f, to_x), f, block_.x + k);
    if (kept == hn::Lanes(d)) return;
    const auto endless = hn::Set(d, std::numeric_limits<double>::infinity());
    tally.not_a_number += hn::CountTrue(d, hn::Not(hn::Eq(sq, sq)));
    tally.endless += hn::CountTrue(d, hn::Eq(sq, endless));
  }

  CropTally tally;

 private:
  template <class V>
  HWY_INLINE auto IsNear(V x, V y, V z) const {
    const DoubleTag d;
    const auto dx = hn::Sub(x, hn::Set(d, range_.center[0])),
               dy = hn::Sub(y, hn::Set(d, range_.center[1])),
               dz = hn::Sub(z, hn::Set(d, range_.center[2]));
    const auto sq = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
    return hn::Le(sq, hn::Set(d, range_.region_radius_sq));
  }

  template <class V>
  HWY_INLINE V Moved(int row, V x, V y, V z) const {
    const DoubleTag d;
    const double* r = range_.R + 3 * row;
    const auto sum = hn::Add(hn::Add(hn::Mul(hn::Set(d, r[0]), x), hn::Mul(hn::Set(d, r[1]), y)),
                             hn::Mul(hn::Set(d, r[2]), z));
    return hn::Add(sum, hn::Set(d, range_.t[row]));
  }

  const CropKernelParameters range_;
  CropBatch& block_;
};

bool HasRegion(const CropKernelParameters& range) {
  return range.region_radius_sq < std::numeric_limits<double>::infinity();
}

template <bool kHasRegion, typename Scalar>
HWY_INLINE CropTally Crop(const CropKernelParameters& range, const Scalar* x_S, const Scalar* y_S,
                          const Scalar* z_S, std::size_t count, CropBatch* block) {
  const DoubleTag d;
  Cropper<kHasRegion> cropper(range, block);
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    cropper.Take(LoadAsDouble(d, x_S + k), LoadAsDouble(d, y_S + k), LoadAsDouble(d, z_S + k), k);
  }
  // What fills up the last vector was never received.
  cropper.tally.not_a_number -= (hn::Lanes(d) - count % hn::Lanes(d)) % hn::Lanes(d);
  return cropper.tally;
}

CropTally CropFloats(const CropKernelParameters& range, const float* x_S, const float* y_S, const float* z_S,
                     std::size_t count, CropBatch* block) {
  return HasRegion(range) ? Crop<true>(range, x_S, y_S, z_S, count, block)
                          : Crop<false>(range, x_S, y_S, z_S, count, block);
}

CropTally CropDoubles(const CropKernelParameters& range, const double* x_S, const double* y_S,
                      const double* z_S, std::size_t count, CropBatch* block) {
  return HasRegion(range) ? Crop<true>(range, x_S, y_S, z_S, count, block)
                          : Crop<false>(range, x_S, y_S, z_S, count, block);
}

template <bool kHasRegion>
HWY_INLINE CropTally CropXyzwAs(const CropKernelParameters& range, const float* points, std::size_t count,
                               CropBatch* block) {
  const DoubleTag d;
  const FloatTag f;
  Cropper<kHasRegion> cropper(range, block);
  for (std::size_t k = 0; k < count; k += hn::Lanes(f)) {
    hn::Vec<FloatTag> x, y, z, unused;
    hn::LoadInterleaved4(f, points + 4 * k, x, y, z, unused);
    cropper.Take(hn::PromoteTo(d, x), hn::PromoteTo(d, y), hn::PromoteTo(d, z), k);
  }
  return cropper.tally;
}

CropTally CropXyzw(const CropKernelParameters& range, const float* points, std::size_t rows,
                   CropBatch* block) {
  const std::size_t count = rows * kXyzwStep;
  return HasRegion(range) ? CropXyzwAs<true>(range, points, count, block)
                          : CropXyzwAs<false>(range, points, count, block);
}

CropTally CropXyzwTile(const CropKernelParameters& range, const float* points, std::size_t stride,
                     CropBatch* block) {
  const hn::CappedTag<float, kTileSide> d;
  alignas(64) float x[kTileSide * kTileSide], y[kTileSide * kTileSide], z[kTileSide * kTileSide];
  for (std::size_t row = 0; row < kTileSide; ++row, points += stride) {
    for (std::size_t k = 0; k < kTileSide; k += hn::Lanes(d)) {
      hn::Vec<decltype(d)> vx, vy, vz, unused;
      hn::LoadInterleaved4(d, points + 4 * k, vx, vy, vz, unused);
      hn::Store(vx, d, x + kTileSide * row + k);
      hn::Store(vy, d, y + kTileSide * row + k);
      hn::Store(vz, d, z + kTileSide * row + k);
    }
  }
  return CropFloats(range, x, y, z, kTileSide * kTileSide, block);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(CropFloats);
HWY_EXPORT(CropDoubles);
HWY_EXPORT(CropXyzw);
HWY_EXPORT(CropXyzwTile);

CropTally crop_floats(const CropKernelParameters& range, const float* x_S, const float* y_S, const float* z_S,
                      std::size_t count, CropBatch* block) {
  return HWY_DYNAMIC_DISPATCH(CropFloats)(range, x_S, y_S, z_S, count, block);
}

CropTally crop_doubles(const CropKernelParameters& range, const double* x_S, const double* y_S,
                       const double* z_S, std::size_t count, CropBatch* block) {
  return HWY_DYNAMIC_DISPATCH(CropDoubles)(range, x_S, y_S, z_S, count, block);
}

CropTally crop_xyzw(const CropKernelParameters& range, const float* points, std::size_t rows,
                    CropBatch* block) {
  return HWY_DYNAMIC_DISPATCH(CropXyzw)(range, points, rows, block);
}

CropTally crop_xyzw_tile(const CropKernelParameters& range, const float* points, std::size_t stride,
                      CropBatch* block) {
  return HWY_DYNAMIC_DISPATCH(CropXyzwTile)(range, points, stride, block);
}

}  // namespace ist
#endif
