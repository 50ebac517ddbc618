#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "cloud/format/depth_reader.h"
#include "ist_proximity/cloud/ingest.h"

/// Reads points from a message's bytes, whose layout check_layout has passed.
namespace ist {

template <typename Bits>
Bits swapped(Bits bits) {
  Bits result = 0;
  for (std::size_t byte = 0; byte < sizeof(Bits); ++byte) {
    result = static_cast<Bits>(result << 8 | (bits & 0xFFU));
    bits >>= 8;
  }
  return result;
}

/// Reads a number, which need not be aligned.
template <typename Scalar, bool kSwap>
Scalar read(const std::uint8_t* bytes) {
  std::conditional_t<sizeof(Scalar) == 4, std::uint32_t, std::uint64_t> bits;
  static_assert(sizeof bits == sizeof(Scalar), "float or double");
  std::memcpy(&bits, bytes, sizeof bits);
  if (kSwap) bits = swapped(bits);
  Scalar value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

inline const std::uint8_t* bytes_of(const RawCloud& cloud, std::size_t row, std::size_t column) {
  return cloud.data + row * cloud.row_step + column * cloud.point_step;
}

template <typename Scalar, bool kSwap>
Eigen::Vector3d read_point(const RawCloud& cloud, const std::uint8_t* bytes) {
  return {static_cast<double>(read<Scalar, kSwap>(bytes + cloud.x)),
          static_cast<double>(read<Scalar, kSwap>(bytes + cloud.y)),
          static_cast<double>(read<Scalar, kSwap>(bytes + cloud.z))};
}

/// A point as it is in the message, in the sensor frame [m]; not finite where nothing was measured.
inline Eigen::Vector3d point_at(const RawCloud& cloud, std::size_t row, std::size_t column) {
  if (cloud.depth != DepthType::kNone) {
    Eigen::Vector3d p;
    read_depth_pixels(cloud, row, column, 1, &p.x(), &p.y(), &p.z());
    return p;
  }
  const std::uint8_t* bytes = bytes_of(cloud, row, column);
  if (cloud.is_double) {
    return cloud.swap_bytes ? read_point<double, true>(cloud, bytes)
                            : read_point<double, false>(cloud, bytes);
  }
  return cloud.swap_bytes ? read_point<float, true>(cloud, bytes)
                          : read_point<float, false>(cloud, bytes);
}

}  // namespace ist
