#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>

namespace ist {

/// Where x, y and z lie in a cloud's bytes, checked once so that reading needs no checks.
struct RawCloud {
  const std::uint8_t* data = nullptr;
  std::size_t width = 0, height = 0;         ///< points in a row, rows
  std::size_t point_step = 0, row_step = 0;  ///< [bytes]
  std::size_t x = 0, y = 0, z = 0;           ///< [bytes] offsets within a point
  bool is_double = false;                    ///< float64 coordinates, else float32
  bool swap_bytes = false;                   ///< the data's byte order is not the machine's
  /// As long as it lives, `data` stays as it is, so that it need not be read at once (where no
  /// thinned cloud is made). Null: there may be other data there, or none, when a call has
  /// returned.
  std::shared_ptr<const void> owner;

  std::size_t size() const { return width * height; }
};

/// One field of a point, as sensor_msgs/PointField describes it.
struct RawField {
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t datatype = 0;  ///< 7: float32, 8: float64
  std::uint32_t count = 1;
};

}  // namespace ist
