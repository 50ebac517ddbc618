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
namespace crop {
namespace hn = hwy::HWY_NAMESPACE;

using DoubleTag = hn::CappedTag<double, 8>;
using FloatTag = hn::Rebind<float, DoubleTag>;

HWY_INLINE hn::Vec<DoubleTag> LoadAsDouble(DoubleTag d, const double* from) {
  return hn::Load(d, from);
}
HWY_INLINE hn::Vec<DoubleTag> LoadAsDouble(DoubleTag d, const float* from) {
  return hn::PromoteTo(d, hn::Load(FloatTag(), from));
}

// A coordinate in O: a row of the rotation times the point, plus the translation.
template <class V>
HWY_INLINE V Moved(const double* r, double t, V x, V y, V z) {
  const DoubleTag d;
  const auto sum = hn::Add(hn::Add(hn::Mul(hn::Set(d, r[0]), x), hn::Mul(hn::Set(d, r[1]), y)),
                           hn::Mul(hn::Set(d, r[2]), z));
  return hn::Add(sum, hn::Set(d, t));
}

// Crops vector by vector; the parameters stay in registers.
template <bool kHasRegion>
class Cropper {
 public:
  Cropper(const CropKernelParameters& parameters, CropBatch* batch)
      : parameters_(parameters), batch_(*batch) {}

  // Crops the points of a vector into slots from k on.
  template <class V>
  HWY_INLINE void Take(V x, V y, V z, std::size_t k) {
    const DoubleTag d;
    const FloatTag f;
    const auto sq = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
    // False for NaN and for squares that overflow.
    auto keep = hn::And(hn::Ge(sq, hn::Set(d, parameters_.min_range_sq)),
                        hn::Le(sq, hn::Set(d, parameters_.max_range_sq)));
    if constexpr (kHasRegion) {
      const std::size_t in_range = hn::CountTrue(d, keep);
      keep = hn::And(keep, IsNear(x, y, z));
      tally.outside_region += in_range - hn::CountTrue(d, keep);
    }
    const auto nan = hn::Set(d, std::numeric_limits<double>::quiet_NaN());
    const auto infinity = hn::Set(d, std::numeric_limits<double>::infinity());
    // There are no branches: in a cloud whose points are in no order, none could be foretold.
    hn::Store(hn::DemoteTo(f, hn::IfThenElse(keep, MovedAlong(0, x, y, z), nan)), f, batch_.x + k);
    hn::Store(hn::DemoteTo(f, MovedAlong(1, x, y, z)), f, batch_.y + k);
    hn::Store(hn::DemoteTo(f, MovedAlong(2, x, y, z)), f, batch_.z + k);
    tally.kept += hn::CountTrue(d, keep);
    tally.not_a_number += hn::CountTrue(d, hn::Not(hn::Eq(sq, sq)));
    tally.infinite_square += hn::CountTrue(d, hn::Eq(sq, infinity));
    tally.too_near += hn::CountTrue(d, hn::Lt(sq, hn::Set(d, parameters_.min_range_sq)));
    tally.not_believed += hn::CountTrue(d, hn::Gt(sq, hn::Set(d, parameters_.believed_sq)));
  }

  CropTally tally;

 private:
  template <class V>
  HWY_INLINE auto IsNear(V x, V y, V z) const {
    const DoubleTag d;
    const auto dx = hn::Sub(x, hn::Set(d, parameters_.region_center[0])),
               dy = hn::Sub(y, hn::Set(d, parameters_.region_center[1])),
               dz = hn::Sub(z, hn::Set(d, parameters_.region_center[2]));
    const auto sq = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
    return hn::Le(sq, hn::Set(d, parameters_.region_radius_sq));
  }

  template <class V>
  HWY_INLINE V MovedAlong(int row, V x, V y, V z) const {
    return Moved(parameters_.R + 3 * row, parameters_.t[row], x, y, z);
  }

  const CropKernelParameters parameters_;
  CropBatch& batch_;
};

bool HasRegion(const CropKernelParameters& parameters) {
  return parameters.region_radius_sq < std::numeric_limits<double>::infinity();
}

template <bool kHasRegion, typename Scalar>
HWY_INLINE CropTally Crop(const CropKernelParameters& parameters, const Scalar* x_S,
                          const Scalar* y_S, const Scalar* z_S, std::size_t count,
                          CropBatch* batch) {
  const DoubleTag d;
  Cropper<kHasRegion> cropper(parameters, batch);
  for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
    cropper.Take(LoadAsDouble(d, x_S + k), LoadAsDouble(d, y_S + k), LoadAsDouble(d, z_S + k), k);
  }
  // The NaN that fill up the last vector were never received.
  cropper.tally.not_a_number -= (hn::Lanes(d) - count % hn::Lanes(d)) % hn::Lanes(d);
  return cropper.tally;
}

CropTally CropFloats(const CropKernelParameters& parameters, const float* x_S, const float* y_S,
                     const float* z_S, std::size_t count, CropBatch* batch) {
  return HasRegion(parameters) ? Crop<true>(parameters, x_S, y_S, z_S, count, batch)
                               : Crop<false>(parameters, x_S, y_S, z_S, count, batch);
}

CropTally CropDoubles(const CropKernelParameters& parameters, const double* x_S, const double* y_S,
                      const double* z_S, std::size_t count, CropBatch* batch) {
  return HasRegion(parameters) ? Crop<true>(parameters, x_S, y_S, z_S, count, batch)
                               : Crop<false>(parameters, x_S, y_S, z_S, count, batch);
}

template <bool kHasRegion>
HWY_INLINE CropTally CropXyzwAs(const CropKernelParameters& parameters, const float* points,
                                std::size_t count, CropBatch* batch) {
  const DoubleTag d;
  const FloatTag f;
  Cropper<kHasRegion> cropper(parameters, batch);
  for (std::size_t k = 0; k < count; k += hn::Lanes(f)) {
    hn::Vec<FloatTag> x, y, z, unused;
    hn::LoadInterleaved4(f, points + 4 * k, x, y, z, unused);
    cropper.Take(hn::PromoteTo(d, x), hn::PromoteTo(d, y), hn::PromoteTo(d, z), k);
  }
  return cropper.tally;
}

CropTally CropXyzw(const CropKernelParameters& parameters, const float* points, std::size_t steps,
                   CropBatch* batch) {
  const std::size_t count = steps * kXyzwStep;
  return HasRegion(parameters) ? CropXyzwAs<true>(parameters, points, count, batch)
                               : CropXyzwAs<false>(parameters, points, count, batch);
}

HWY_INLINE void LoadXyzwTile(const float* points, std::size_t stride, float* x, float* y,
                             float* z) {
  const hn::CappedTag<float, kTileSide> d;
  for (std::size_t row = 0; row < kTileSide; ++row, points += stride) {
    for (std::size_t k = 0; k < kTileSide; k += hn::Lanes(d)) {
      hn::Vec<decltype(d)> vx, vy, vz, unused;
      hn::LoadInterleaved4(d, points + 4 * k, vx, vy, vz, unused);
      hn::Store(vx, d, x + kTileSide * row + k);
      hn::Store(vy, d, y + kTileSide * row + k);
      hn::Store(vz, d, z + kTileSide * row + k);
    }
  }
}

CropTally CropXyzwTile(const CropKernelParameters& parameters, const float* points,
                       std::size_t stride, CropBatch* batch) {
  alignas(64) float x[kTileSide * kTileSide], y[kTileSide * kTileSide], z[kTileSide * kTileSide];
  LoadXyzwTile(points, stride, x, y, z);
  return CropFloats(parameters, x, y, z, kTileSide * kTileSide, batch);
}

void MoveXyzwTile(const double* R, const double* t, const float* points, std::size_t stride,
                  float* x, float* y, float* z) {
  const DoubleTag d;
  const FloatTag f;
  LoadXyzwTile(points, stride, x, y, z);
  for (std::size_t k = 0; k < kTileSide * kTileSide; k += hn::Lanes(d)) {
    const auto from_x = LoadAsDouble(d, x + k), from_y = LoadAsDouble(d, y + k),
               from_z = LoadAsDouble(d, z + k);
    hn::Store(hn::DemoteTo(f, Moved(R, t[0], from_x, from_y, from_z)), f, x + k);
    hn::Store(hn::DemoteTo(f, Moved(R + 3, t[1], from_x, from_y, from_z)), f, y + k);
    hn::Store(hn::DemoteTo(f, Moved(R + 6, t[2], from_x, from_y, from_z)), f, z + k);
  }
}

}  // namespace crop

using crop::CropDoubles;
using crop::CropFloats;
using crop::CropXyzw;
using crop::CropXyzwTile;
using crop::MoveXyzwTile;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(CropFloats);
HWY_EXPORT(CropDoubles);
HWY_EXPORT(CropXyzw);
HWY_EXPORT(CropXyzwTile);
HWY_EXPORT(MoveXyzwTile);

CropTally crop_floats(const CropKernelParameters& parameters, const float* x_S, const float* y_S,
                      const float* z_S, std::size_t count, CropBatch* batch) {
  return HWY_DYNAMIC_DISPATCH(CropFloats)(parameters, x_S, y_S, z_S, count, batch);
}

CropTally crop_doubles(const CropKernelParameters& parameters, const double* x_S, const double* y_S,
                       const double* z_S, std::size_t count, CropBatch* batch) {
  return HWY_DYNAMIC_DISPATCH(CropDoubles)(parameters, x_S, y_S, z_S, count, batch);
}

CropTally crop_xyzw(const CropKernelParameters& parameters, const float* points, std::size_t steps,
                    CropBatch* batch) {
  return HWY_DYNAMIC_DISPATCH(CropXyzw)(parameters, points, steps, batch);
}

CropTally crop_xyzw_tile(const CropKernelParameters& parameters, const float* points,
                         std::size_t stride, CropBatch* batch) {
  return HWY_DYNAMIC_DISPATCH(CropXyzwTile)(parameters, points, stride, batch);
}

void move_xyzw_tile(const double R[9], const double t[3], const float* points, std::size_t stride,
                    float* x, float* y, float* z) {
  HWY_DYNAMIC_DISPATCH(MoveXyzwTile)(R, t, points, stride, x, y, z);
}

}  // namespace ist
#endif
