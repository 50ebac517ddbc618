#include "cloud/format/depth_reader.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "internal/geometry/numbers.h"
#include "ist_proximity/cloud/depth_image.h"

namespace ist {
namespace {

// The depth of a pixel in the image's unit; NaN where nothing is known.
struct Integers {
  using Bits = std::uint16_t;
  static double depth(Bits bits) { return bits == 0 ? kNaN : static_cast<double>(bits); }
};

struct Floats {
  using Bits = std::uint32_t;
  static double depth(Bits bits) {
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value > 0.0F ? static_cast<double>(value) : kNaN;
  }
};

inline std::uint16_t swapped(std::uint16_t bits) { return __builtin_bswap16(bits); }
inline std::uint32_t swapped(std::uint32_t bits) { return __builtin_bswap32(bits); }

template <typename Pixel, bool kSwap>
void read_as(const RawCloud& image, std::size_t row, std::size_t column, std::size_t count,
             double* x, double* y, double* z) {
  using Bits = typename Pixel::Bits;
  const std::uint8_t* bytes = image.data + row * image.row_step + column * sizeof(Bits);
  const double* ray_x = image.rays->x.data() + column;
  const double ray_y = image.rays->y[row], unit = image.depth_unit;
  for (std::size_t i = 0; i < count; ++i) {
    Bits bits;
    std::memcpy(&bits, bytes + i * sizeof(Bits), sizeof bits);
    const double depth = unit * Pixel::depth(kSwap ? swapped(bits) : bits);
    x[i] = ray_x[i] * depth;
    y[i] = ray_y * depth;
    z[i] = depth;
  }
  if constexpr (sizeof(Bits) == sizeof(float)) {  // 0 times infinity is NaN
    for (std::size_t i = 0; i < count; ++i) {
      if (std::isinf(z[i])) x[i] = y[i] = z[i];
    }
  }
}

}  // namespace

void read_depth_pixels(const RawCloud& image, std::size_t row, std::size_t column,
                       std::size_t count, double* x, double* y, double* z) {
  const bool is_float = image.depth == DepthType::kFloat32;
  const auto read = is_float ? image.swap_bytes ? &read_as<Floats, true> : &read_as<Floats, false>
                    : image.swap_bytes ? &read_as<Integers, true>
                                       : &read_as<Integers, false>;
  read(image, row, column, count, x, y, z);
}

}  // namespace ist
