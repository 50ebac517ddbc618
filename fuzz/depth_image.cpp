// A depth image and its camera: what check_camera() and check_depth_image() let pass is read within
// its bytes, and each pixel's point is the pinhole's, in double.
// Covers: src/cloud/format/depth_image.cpp src/cloud/format/depth_reader.cpp
// Longest input: 400

#include "ist_proximity/cloud/depth_image.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "cloud/format/point_reader.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;

std::uint32_t side(ByteReader* in) {
  const std::uint8_t kind = in->byte();
  return kind < 230 ? kind % 12U : in->raw<std::uint32_t>();
}

ist::CameraModel camera_from(ByteReader* in) {
  ist::CameraModel camera;
  camera.width = side(in);
  camera.height = side(in);
  const bool has_P = in->flag();
  double* f = has_P ? camera.P.data() : camera.K.data();
  const std::size_t columns = has_P ? 4 : 3;
  f[0] = std::abs(in->number(20.0)) + (in->flag() ? 5.0 : 0.0);
  f[2] = in->number(8.0);
  f[columns + 1] = std::abs(in->number(20.0)) + (in->flag() ? 5.0 : 0.0);
  f[columns + 2] = in->number(8.0);
  f[2 * columns + 2] = 1.0;
  const std::size_t any = in->below(64);
  if (any < 9) f[any] = in->number(2.0);
  if (in->flag()) return camera;
  camera.binning_x = in->byte() % 4U;
  camera.binning_y = side(in);
  camera.roi_x_offset = side(in);
  camera.roi_y_offset = in->byte() % 4U;
  camera.roi_width = in->byte() % 8U;
  camera.roi_height = side(in);
  return camera;
}

// The depth of a pixel, byte by byte [m]; NaN where nothing is known.
double depth_of(const ist::DepthImage& image, const std::uint8_t* bytes) {
  std::uint8_t ordered[4] = {};
  const std::size_t size = image.encoding == "32FC1" ? 4 : 2;
  for (std::size_t k = 0; k < size; ++k) {
    ordered[k] = image.is_bigendian ? bytes[size - 1 - k] : bytes[k];
  }
  if (size == 2) {
    const int millimetres = ordered[0] + 256 * ordered[1];
    return millimetres == 0 ? NAN : millimetres / 1000.0;
  }
  float value;
  std::memcpy(&value, ordered, 4);
  return value > 0.0F ? static_cast<double>(value) : NAN;
}

void check_pixel(const Eigen::Vector3d& p, double depth, double x, double y) {
  if (std::isnan(depth)) {
    FUZZ_CHECK(p.array().isNaN().all(), "a pixel without depth is at %g, %g, %g", p[0], p[1], p[2]);
  } else if (std::isinf(depth)) {
    FUZZ_CHECK(p.array().isInf().all(), "a pixel at infinity is at %g, %g, %g", p[0], p[1], p[2]);
  } else {
    const double off = (p - Eigen::Vector3d(x * depth, y * depth, depth)).norm();
    FUZZ_CHECK(off <= 1e-12 * depth * (1.0 + std::abs(x) + std::abs(y)), "a pixel is %g m off",
               off);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const ist::CameraModel camera = camera_from(&in);
  std::shared_ptr<const ist::DepthRays> rays;
  const std::string camera_fault = ist::check_camera(camera, &rays);
  FUZZ_CHECK(camera_fault.empty() == (rays != nullptr), "rays and fault: %s", camera_fault.c_str());
  if (!camera_fault.empty()) {
    FUZZ_CHECK(camera_fault.back() == '.', "no sentence: %s", camera_fault.c_str());
  }
  ist::DepthImage image;
  const char* const encodings[] = {"16UC1", "32FC1", "mono16", "rgb8"};
  image.encoding = encodings[in.below(4)];
  image.is_bigendian = in.flag();
  const bool fits = rays != nullptr && in.byte() < 200;
  image.width = fits ? static_cast<std::uint32_t>(rays->x.size()) : side(&in);
  image.height = fits ? static_cast<std::uint32_t>(rays->y.size()) : side(&in);
  const std::uint32_t pixel = image.encoding == "32FC1" ? 4 : 2;
  image.step = fits && image.width < 1000 ? image.width * pixel + in.byte() % 3U : side(&in);
  // A copy of exactly these bytes, so that reading beyond them is noticed.
  const std::vector<std::uint8_t> bytes(in.rest(), in.rest() + in.left());
  image.data = bytes.empty() ? nullptr : bytes.data();
  image.data_size = bytes.size();
  ist::RawCloud raw;
  const std::string fault = ist::check_depth_image(image, rays, &raw, 10000);
  if (!fault.empty()) {
    FUZZ_CHECK(fault.back() == '.' && raw.data == nullptr, "no sentence: %s", fault.c_str());
    return 0;
  }
  for (std::size_t row = 0; row < raw.height; ++row) {
    for (std::size_t column = 0; column < raw.width; ++column) {
      const double depth = depth_of(image, image.data + row * image.step + column * pixel);
      check_pixel(ist::point_at(raw, row, column), depth, rays->x[column], rays->y[row]);
    }
  }
  return 0;
}
