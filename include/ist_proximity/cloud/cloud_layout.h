#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace ist {

/// One field of a point, as sensor_msgs/PointField describes it.
struct RawField {
  std::string name;           ///< "x", "y" and "z" are read
  std::uint32_t offset = 0;   ///< [bytes] from the start of the point
  std::uint8_t datatype = 0;  ///< 7: float32, 8: float64
  std::uint32_t count = 1;    ///< numbers in the field
};

/// The description that a message gives of its own bytes (the members of sensor_msgs/PointCloud2).
struct CloudLayout {
  std::vector<RawField> fields;        ///< fields of each point
  std::uint32_t width = 0;             ///< points in a row
  std::uint32_t height = 0;            ///< rows
  std::uint32_t point_step = 0;        ///< [bytes] from a point to the next
  std::uint32_t row_step = 0;          ///< [bytes] from a row to the next
  bool is_bigendian = false;           ///< byte order of the numbers
  const std::uint8_t* data = nullptr;  ///< not owned
  std::size_t data_size = 0;           ///< [bytes]
};

/// The points of a message: where x, y and z lie in its bytes. Checked once (check_layout), so that
/// reading needs no checks.
struct RawCloud {
  const std::uint8_t* data = nullptr;  ///< the first point; not owned
  std::size_t width = 0;               ///< points in a row
  std::size_t height = 0;              ///< rows
  std::size_t point_step = 0;          ///< [bytes] from a point to the next
  std::size_t row_step = 0;            ///< [bytes] from a row to the next
  std::size_t x = 0;                   ///< [bytes] offset of x within a point
  std::size_t y = 0;                   ///< [bytes] offset of y within a point
  std::size_t z = 0;                   ///< [bytes] offset of z within a point
  bool is_double = false;              ///< float64 coordinates, else float32
  bool swap_bytes = false;             ///< the data's byte order is not the machine's
  /// `data` stays unchanged as long as this lives, so that points may be read later, when a query
  /// needs them (where no thinned cloud is made). Null: `data` is valid during the call only.
  std::shared_ptr<const void> owner;

  /// Points in the cloud, those that are not finite included.
  std::size_t size() const { return width * height; }
};

/// Checks a layout: x, y and z are there once, all float32 or all float64, with one value each,
/// inside the point and without overlap; the sizes agree with each other and with the data. Other
/// fields are ignored. Nothing overflows, whatever the sizes.
///
/// Tolerated are an empty cloud (width or height 0), whatever the rest says; a row_step of 0 in a
/// cloud of one row, where it can only mean width * point_step; bytes after the last row.
/// @param cloud  filled when the layout is valid; an empty cloud has width and height 0
/// @returns an empty string, or one sentence with the faulty field and its values. Thread safe.
std::string check_layout(const CloudLayout& layout, RawCloud* cloud);

}  // namespace ist
