#pragma once

#include <cstddef>

#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Computes the points of some neighbouring pixels in a row of a depth image, in the camera's
/// optical frame [m]: all NaN where nothing is known, all infinite where nothing is in range.
/// @param image        checked by check_depth_image
/// @param row, column  of the first pixel
/// @param count        pixels; all in the row
void read_depth_pixels(const RawCloud& image, std::size_t row, std::size_t column,
                       std::size_t count, double* x, double* y, double* z);

}  // namespace ist
