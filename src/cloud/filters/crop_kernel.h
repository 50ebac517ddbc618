#pragma once

#include <cstddef>

#include "cloud/filters/crop.h"

namespace ist {

/// CropParameters as plain numbers.
struct CropKernelParameters {
  double R[9];                        ///< rotation of X_OS, row-major
  double t[3];                        ///< [m] its translation
  double min_range_sq, max_range_sq;  ///< [m^2]
  double believed_sq;                 ///< [m^2]
  double region_center[3];            ///< [m] in the sensor frame
  double region_radius_sq;            ///< [m^2] may be inf
};

/// Numbers of points of a batch.
struct CropTally {
  std::size_t kept = 0;
  std::size_t outside_region = 0;   ///< in range, but outside the region of interest
  std::size_t not_a_number = 0;     ///< a coordinate is NaN
  std::size_t infinite_square = 0;  ///< the squared range is infinite
  std::size_t too_near = 0;         ///< nearer than the least range
  std::size_t not_believed = 0;     ///< farther than is believed, `infinite_square` included
};

/// Moves the points that are kept to O; the others get NaN for x. The same bits on every machine:
/// products and sums are rounded one by one.
/// @param x_S,y_S,z_S  [m] in the sensor frame: `count` numbers, and NaN up to a multiple of eight
CropTally crop_floats(const CropKernelParameters& parameters, const float* x_S, const float* y_S,
                      const float* z_S, std::size_t count, CropBatch* batch);
CropTally crop_doubles(const CropKernelParameters& parameters, const double* x_S, const double* y_S,
                       const double* z_S, std::size_t count, CropBatch* batch);

/// Points that crop_xyzw() takes at a time.
constexpr std::size_t kXyzwStep = 16;

/// The same for consecutive points of four floats each (x, y, z and padding).
/// @param points  aligned as floats are
/// @param steps   of kXyzwStep points; at most kCropBatch points in all
CropTally crop_xyzw(const CropKernelParameters& parameters, const float* points, std::size_t steps,
                    CropBatch* batch);

/// The same for a tile of kTileSide x kTileSide such points.
/// @param stride  [floats] from row to row
CropTally crop_xyzw_tile(const CropKernelParameters& parameters, const float* points,
                         std::size_t stride, CropBatch* batch);

/// Moves the points of a tile of kTileSide x kTileSide such points to O, in double: the same bits
/// as crop_xyzw_tile(), which also decides about ranges.
/// @param R       row-major
/// @param t       [m]
/// @param stride  [floats] from row to row
/// @param x,y,z   [m] by slot, aligned to vectors; overwritten
void move_xyzw_tile(const double R[9], const double t[3], const float* points, std::size_t stride,
                    float* x, float* y, float* z);

}  // namespace ist
