// The description that a cloud gives of its own bytes: check_layout() lets pass what can be read.
// Covers: src/cloud/format/cloud_layout.cpp src/cloud/format/point_reader.h
// Longest input: 600

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "cloud/format/point_reader.h"
#include "ist_proximity/cloud/ingest.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;

// Small numbers mostly, so that layouts are often valid; sometimes any number.
std::uint32_t size(ByteReader* in) {
  const std::uint8_t small = in->byte();
  return small < 250 ? small % 64 : in->raw<std::uint32_t>();
}

ist::RawField field(ByteReader* in) {
  static const char* const kNames[] = {"x", "y", "z", "rgb", "intensity", "", "X"};
  ist::RawField field;
  field.name = kNames[in->below(sizeof kNames / sizeof kNames[0])];
  field.offset = size(in);
  const std::uint8_t type = in->byte();
  field.datatype = type < 100 ? 7 : type < 200 ? 8 : type;
  field.count = in->byte() < 200 ? 1 : size(in);
  return field;
}

ist::CloudLayout any_layout(ByteReader* in) {
  ist::CloudLayout layout;
  for (std::size_t i = in->below(6); i > 0; --i) layout.fields.push_back(field(in));
  layout.width = size(in);
  layout.height = size(in);
  layout.point_step = size(in);
  layout.row_step = size(in);
  return layout;
}

// A layout that fits the data, but for one or two members.
ist::CloudLayout nearly_valid_layout(ByteReader* in) {
  ist::CloudLayout layout;
  const bool is_double = in->flag();
  const std::uint32_t number = is_double ? 8 : 4;
  std::uint32_t offset = 0;
  for (const char* name : {"x", "y", "z", "rgb"}) {
    offset += static_cast<std::uint32_t>(in->below(3));
    layout.fields.push_back({name, offset, static_cast<std::uint8_t>(is_double ? 8 : 7), 1});
    offset += number;
  }
  layout.width = 1 + static_cast<std::uint32_t>(in->below(3));
  layout.height = 1 + static_cast<std::uint32_t>(in->below(3));
  layout.point_step = offset + static_cast<std::uint32_t>(in->below(3));
  layout.row_step = layout.width * layout.point_step + static_cast<std::uint32_t>(in->below(3));
  for (std::size_t i = in->below(3); i > 0; --i) {
    switch (in->below(6)) {
      case 0:
        layout.width = size(in);
        break;
      case 1:
        layout.height = size(in);
        break;
      case 2:
        layout.point_step = size(in);
        break;
      case 3:
        layout.row_step = size(in);
        break;
      case 4:
        layout.fields[in->below(4)] = field(in);
        break;
      default:
        layout.fields.erase(layout.fields.begin() +
                            static_cast<std::ptrdiff_t>(in->below(layout.fields.size())));
    }
    if (layout.fields.size() < 4) break;
  }
  return layout;
}

ist::CloudLayout layout_from(ByteReader* in) {
  ist::CloudLayout layout = in->byte() < 80 ? any_layout(in) : nearly_valid_layout(in);
  layout.is_bigendian = in->flag();
  layout.data = in->left() > 0 ? in->rest() : nullptr;
  layout.data_size = in->left();
  return layout;
}

// Every coordinate lies within the data; computed where nothing overflows.
void check_places(const ist::CloudLayout& layout, const ist::RawCloud& cloud) {
  using Wide = long double;
  const std::size_t bytes = cloud.is_double ? 8 : 4;
  const Wide last = static_cast<Wide>(cloud.height - 1) * static_cast<Wide>(cloud.row_step) +
                    static_cast<Wide>(cloud.width - 1) * static_cast<Wide>(cloud.point_step);
  for (const std::size_t offset : {cloud.x, cloud.y, cloud.z}) {
    FUZZ_CHECK(offset + bytes <= cloud.point_step, "offset %zu, point_step %zu", offset,
               cloud.point_step);
    FUZZ_CHECK(last + static_cast<Wide>(offset + bytes) <= static_cast<Wide>(layout.data_size),
               "%zu x %zu points in %zu bytes", cloud.width, cloud.height, layout.data_size);
  }
  FUZZ_CHECK(cloud.row_step >= cloud.width * cloud.point_step, "row_step %zu", cloud.row_step);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const ist::CloudLayout layout = layout_from(&in);
  ist::RawCloud cloud;
  const std::string fault = ist::check_layout(layout, &cloud);
  if (!fault.empty()) {
    FUZZ_CHECK(fault.back() == '.', "no sentence: %s", fault.c_str());
    return 0;
  }
  FUZZ_CHECK(cloud.size() == std::size_t{layout.width} * layout.height, "%zu points", cloud.size());
  if (cloud.size() == 0) return 0;
  check_places(layout, cloud);
  volatile double sum = 0.0;  // the address sanitizer sees every byte that is read
  for (std::size_t row = 0; row < cloud.height; ++row) {
    for (std::size_t column = 0; column < cloud.width; ++column) {
      sum = sum + ist::point_at(cloud, row, column).sum();
    }
  }
  return 0;
}
