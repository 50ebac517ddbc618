// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/crop_kernel.cpp"
#include "cloud/crop_kernel.h"

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

template <typename Scalar>
HWY_INLINE CropTally Crop(const CropRange& range, const Scalar* x_S, const Scalar* y_S,
                          const Scalar* z_S, std::size_t count, CropBlock* block) {
  const DoubleTag d;
  const FloatTag f;
  const auto least = hn::Set(d, range.min_range_sq), most = hn::Set(d, range.max_range_sq);
  const auto nan = hn::Set(d, std::numeric_limits<double>::quiet_NaN());
  const auto endless = hn::Set(d, std::numeric_limits<double>::infinity());
  CropTally tally;
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    const auto x = LoadAsDouble(d, x_S + k), y = LoadAsDouble(d, y_S + k),
               z = LoadAsDouble(d, z_S + k);
    const auto sq = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
    const auto moved = [&](int row) {
      const double* r = range.R + 3 * row;
      const auto sum = hn::Add(hn::Add(hn::Mul(hn::Set(d, r[0]), x), hn::Mul(hn::Set(d, r[1]), y)),
                               hn::Mul(hn::Set(d, r[2]), z));
      return hn::Add(sum, hn::Set(d, range.t[row]));
    };
    // False for NaN, and for what overflows.
    const auto keep = hn::And(hn::Ge(sq, least), hn::Le(sq, most));
    hn::Store(hn::DemoteTo(f, hn::IfThenElse(keep, moved(0), nan)), f, block->x + k);
    hn::Store(hn::DemoteTo(f, moved(1)), f, block->y + k);
    hn::Store(hn::DemoteTo(f, moved(2)), f, block->z + k);
    tally.kept += hn::CountTrue(d, keep);
    tally.not_a_number += hn::CountTrue(d, hn::Not(hn::Eq(sq, sq)));
    tally.endless += hn::CountTrue(d, hn::Eq(sq, endless));
  }
  // What fills up the last vector was never received.
  tally.not_a_number -= (hn::Lanes(d) - count % hn::Lanes(d)) % hn::Lanes(d);
  return tally;
}

CropTally CropFloats(const CropRange& range, const float* x_S, const float* y_S, const float* z_S,
                     std::size_t count, CropBlock* block) {
  return Crop(range, x_S, y_S, z_S, count, block);
}

CropTally CropDoubles(const CropRange& range, const double* x_S, const double* y_S,
                      const double* z_S, std::size_t count, CropBlock* block) {
  return Crop(range, x_S, y_S, z_S, count, block);
}

void SplitFloats(const float* points, std::size_t count, float* x, float* y, float* z) {
  const hn::CappedTag<float, 16> d;
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    hn::Vec<decltype(d)> vx, vy, vz, unused;
    hn::LoadInterleaved4(d, points + 4 * k, vx, vy, vz, unused);
    hn::Store(vx, d, x + k);
    hn::Store(vy, d, y + k);
    hn::Store(vz, d, z + k);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(CropFloats);
HWY_EXPORT(CropDoubles);
HWY_EXPORT(SplitFloats);

CropTally crop_floats(const CropRange& range, const float* x_S, const float* y_S, const float* z_S,
                      std::size_t count, CropBlock* block) {
  return HWY_DYNAMIC_DISPATCH(CropFloats)(range, x_S, y_S, z_S, count, block);
}

CropTally crop_doubles(const CropRange& range, const double* x_S, const double* y_S,
                       const double* z_S, std::size_t count, CropBlock* block) {
  return HWY_DYNAMIC_DISPATCH(CropDoubles)(range, x_S, y_S, z_S, count, block);
}

void split_floats(const float* points, std::size_t count, float* x, float* y, float* z) {
  HWY_DYNAMIC_DISPATCH(SplitFloats)(points, count, x, y, z);
}

}  // namespace ist
#endif
