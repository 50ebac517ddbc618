#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ist_proximity/cloud/raw_cloud.h"

namespace ist {

/// What a message says about its own bytes (the members of sensor_msgs/PointCloud2).
struct CloudLayout {
  std::vector<RawField> fields;
  std::uint32_t width = 0, height = 0, point_step = 0, row_step = 0;
  bool is_bigendian = false;
  const std::uint8_t* data = nullptr;
  std::size_t data_size = 0;  ///< [bytes]
};

/// Checks a layout: x, y, z there once, all float32 or all float64, one value each, inside the
/// point and not on top of each other; sizes that agree with each other and with the data. Other
/// fields are not looked at. Nothing overflows, whatever the sizes.
///
/// Tolerated: an empty cloud (width or height 0), whatever the rest says; a row_step of 0 in a
/// cloud of one row, where it cannot mean anything but width * point_step; bytes beyond the last
/// row.
/// @param cloud  filled when the layout is valid; an empty cloud has width and height 0
/// @returns an empty string, or one sentence with the faulty field and its values. Thread safe.
std::string check_layout(const CloudLayout& layout, RawCloud* cloud);

}  // namespace ist
