#pragma once

#include <cstddef>

#include "cloud/filters/crop.h"

namespace ist {

/// What crop_points does to a block that has been read.
struct CropKernelParameters {
  double R[9];                        ///< rotation of X_OS, row-major
  double t[3];                        ///< [m] its translation
  double min_range_sq, max_range_sq;  ///< [m^2]
  double center[3];                   ///< [m] of the region, in the sensor frame
  double region_radius_sq;            ///< [m^2] may be inf
};

/// What became of a block.
struct CropTally {
  std::size_t kept = 0;
  std::size_t beyond = 0;        ///< in range, but beyond the region
  std::size_t not_a_number = 0;  ///< a coordinate is NaN
  std::size_t endless = 0;       ///< the squared range is infinite
};

/// Moves points; those out of range get NaN for x. The same bits on every machine: products and
/// sums are rounded one by one.
/// @param x_S,y_S,z_S  sensor frame [m], `count` of them and then whatever fills up a multiple of
///                     eight, NaN
CropTally crop_floats(const CropKernelParameters& range, const float* x_S, const float* y_S, const float* z_S,
                      std::size_t count, CropBatch* block);
CropTally crop_doubles(const CropKernelParameters& range, const double* x_S, const double* y_S,
                       const double* z_S, std::size_t count, CropBatch* block);

/// Points that crop_xyzw() takes at a time.
constexpr std::size_t kXyzwStep = 16;

/// The same for points of four floats each (x, y, z and padding), one after the other.
/// @param points  aligned as floats are
/// @param rows    of kXyzwStep points; at most kCropBatch in all
CropTally crop_xyzw(const CropKernelParameters& range, const float* points, std::size_t rows,
                    CropBatch* block);

/// The same for a square of kTileSide x kTileSide points.
/// @param stride  [floats] from row to row
CropTally crop_xyzw_tile(const CropKernelParameters& range, const float* points, std::size_t stride,
                      CropBatch* block);

}  // namespace ist
