#include "ist_proximity/cloud/ingest.h"

#include <algorithm>
#include <limits>

#include "cloud/format/byte_order.h"

namespace ist {
namespace {

constexpr std::uint8_t kFloat32 = 7, kFloat64 = 8;

std::string text(std::uint64_t value) { return std::to_string(value); }

std::string datatype_name(std::uint8_t datatype) {
  static const char* const kNames[] = {"int8",  "uint8",  "int16",   "uint16",
                                       "int32", "uint32", "float32", "float64"};
  const std::string number = text(datatype);
  if (datatype < 1 || datatype > kFloat64) return "unknown (" + number + ")";
  return std::string(kNames[datatype - 1]) + " (" + number + ")";
}

std::uint32_t size_of(const RawField& field) { return field.datatype == kFloat64 ? 8 : 4; }

// Finds the field of one coordinate and checks it by itself.
std::string find_coordinate(const CloudLayout& layout, const char* name, const RawField** found) {
  const auto matches = [name](const RawField& field) { return field.name == name; };
  const std::vector<RawField>& fields = layout.fields;
  const auto times = std::count_if(fields.begin(), fields.end(), matches);
  const std::string field_name = "field '" + std::string(name) + "'";
  if (times == 0) return field_name + " is missing.";
  if (times > 1) {
    return field_name + " is there " + std::to_string(times) + " times, it must be there once.";
  }
  const RawField& field = *std::find_if(fields.begin(), fields.end(), matches);
  if (field.datatype != kFloat32 && field.datatype != kFloat64) {
    return field_name + " has datatype " + datatype_name(field.datatype) +
           ", it must be float32 (7) or float64 (8).";
  }
  // Some drivers leave the count 0; PCL takes it for 1, too.
  if (field.count > 1) return field_name + " has count " + text(field.count) + ", it must be 1.";
  const std::uint64_t end = std::uint64_t{field.offset} + size_of(field);
  const bool has_point_step = layout.point_step > 0;  // an empty cloud may leave it out
  if (has_point_step && end > layout.point_step) {
    return field_name + " of type " + datatype_name(field.datatype) + " at offset " +
           text(field.offset) + " ends at byte " + text(end) + ", beyond the point_step of " +
           text(layout.point_step) + ".";
  }
  *found = &field;
  return {};
}

std::string check_pair(const RawField& a, const RawField& b) {
  if (a.datatype != b.datatype) {
    return "field '" + a.name + "' has datatype " + datatype_name(a.datatype) + " but field '" +
           b.name + "' has " + datatype_name(b.datatype) + ", they must be the same.";
  }
  const std::uint32_t apart = std::max(a.offset, b.offset) - std::min(a.offset, b.offset);
  if (apart < size_of(a)) {
    return "field '" + a.name + "' at offset " + text(a.offset) + " and field '" + b.name +
           "' at offset " + text(b.offset) + " overlap.";
  }
  return {};
}

// Checks sizes in 64 bits, which hold the product of two 32-bit numbers.
std::string check_sizes(const CloudLayout& layout, std::uint64_t row_step, std::size_t max_points) {
  const std::uint64_t width = layout.width, height = layout.height, points = width * height;
  const std::uint64_t row = width * layout.point_step;
  if (row_step < row) {
    return "row_step is " + text(row_step) + ", less than width " + text(width) + " * point_step " +
           text(layout.point_step) + " = " + text(row) + ".";
  }
  const std::uint64_t needed = height * row_step;
  if (layout.data_size < needed) {
    return "data holds " + text(layout.data_size) + " bytes, less than height " + text(height) +
           " * row_step " + text(row_step) + " = " + text(needed) + ".";
  }
  if (points == 0 && layout.data_size > 0) {
    return "width " + text(width) + " * height " + text(height) + " is no point, but data holds " +
           text(layout.data_size) + " bytes.";
  }
  if (layout.data == nullptr && needed > 0) {
    return "data is null but " + text(needed) + " bytes are announced.";
  }
  if (points > std::numeric_limits<std::uint32_t>::max()) {
    return "width " + text(width) + " * height " + text(height) +
           " is more points than 32 bits can number.";
  }
  if (points > max_points) {
    return "width " + text(width) + " * height " + text(height) + " is " + text(points) +
           " points, allowed are at most " + text(max_points) + " (max_points).";
  }
  return {};
}

// Checks x, y and z, each by itself and with the others.
// @param found  the fields of x, y and z
std::string find_coordinates(const CloudLayout& layout, const RawField* (&found)[3]) {
  static const char* const kNames[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    std::string fault = find_coordinate(layout, kNames[i], &found[i]);
    if (!fault.empty()) return fault;
  }
  for (int i = 0; i < 3; ++i) {
    std::string fault = check_pair(*found[i / 2], *found[1 + (i + 1) / 2]);
    if (!fault.empty()) return fault;
  }
  return {};
}

}  // namespace

std::string check_layout(const CloudLayout& layout, RawCloud* cloud, std::size_t max_points) {
  const bool is_empty = layout.width == 0 || layout.height == 0;
  if (layout.point_step == 0 && !is_empty)
    return "point_step is 0, a point needs at least 12 bytes.";
  const RawField* xyz[3] = {};
  std::string fault = find_coordinates(layout, xyz);
  if (!fault.empty()) return fault;

  const bool row_step_omitted = layout.row_step == 0 && (layout.height == 1 || is_empty);
  const std::uint64_t row_step = row_step_omitted ? std::uint64_t{layout.width} * layout.point_step
                                                  : std::uint64_t{layout.row_step};
  fault = check_sizes(layout, row_step, max_points);
  if (!fault.empty()) return fault;

  *cloud = RawCloud();
  if (is_empty) return {};
  cloud->data = layout.data;
  cloud->width = layout.width;
  cloud->height = layout.height;
  cloud->point_step = layout.point_step;
  cloud->row_step = static_cast<std::size_t>(row_step);
  cloud->x = xyz[0]->offset;
  cloud->y = xyz[1]->offset;
  cloud->z = xyz[2]->offset;
  cloud->is_double = xyz[0]->datatype == kFloat64;
  cloud->swap_bytes = layout.is_bigendian != kMachineIsBigEndian;
  return {};
}

}  // namespace ist
