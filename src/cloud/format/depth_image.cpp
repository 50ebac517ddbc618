#include "ist_proximity/cloud/depth_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "cloud/format/byte_order.h"

namespace ist {
namespace {

constexpr std::uint32_t kMostPixels = 65535;         // along a side
constexpr double kMetre = 1.0, kMillimetre = 0.001;  // REP 118
constexpr double kWidestRay = 57.3;                  // tan(89 degrees)
constexpr double kFarthestCenter = 10.0;      // [m] from the optical frame: no camera is as large
constexpr std::size_t kLongestEncoding = 32;  // characters that are repeated

template <typename Value>
std::string text(const Value& value) {
  std::ostringstream stream;
  stream << value;
  return stream.str();
}

std::string fault(const std::string& member, double value, const char* expected) {
  return member + " is " + text(value) + ", " + expected + ".";
}

// A pinhole along one axis of the image, in pixels of the sensor.
struct Axis {
  const char* side;  // of the image
  std::uint32_t size, offset, length, binning;
  double focal_length, center;

  std::uint32_t binned() const { return std::max(1U, binning); }
  std::uint32_t extent() const { return (length > 0 ? length : size) / binned(); }
};

// The matrix that is used, and the places of its numbers.
struct Projection {
  const char* name;
  const double* numbers;
  int columns;

  double at(int row, int column) const { return numbers[columns * row + column]; }
  std::string element(int row, int column) const {
    return std::string(name) + "[" + std::to_string(columns * row + column) + "]";
  }
};

// @returns what must hold of a number and does not; null where all holds
const char* element_fault(double value, int row, int column) {
  if (!std::isfinite(value)) return "it must be finite";
  if (row == column && row < 2) {
    return value > 0.0 ? nullptr : "a focal length must be more than 0 pixels";
  }
  const bool is_center = row < 2 && column == 2;
  if (is_center) return nullptr;
  if (row == 2 && column == 2) return value == 1.0 ? nullptr : "it must be 1";
  const bool is_baseline = row < 2 && column == 3;
  return is_baseline || value == 0.0 ? nullptr : "it must be 0";
}

std::string check_projection(const Projection& projection) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < projection.columns; ++column) {
      const double value = projection.at(row, column);
      if (const char* what = element_fault(value, row, column)) {
        return fault(projection.element(row, column), value, what);
      }
    }
  }
  return {};
}

std::string check_axis(const Axis& axis) {
  if (axis.size == 0 || axis.size > kMostPixels) {
    return fault(axis.side, axis.size, "it must be 1 to 65535 pixels");
  }
  if (std::uint64_t{axis.offset} + axis.length > axis.size) {
    return "the region of interest ends at pixel " +
           text(std::uint64_t{axis.offset} + axis.length) + ", outside the " + axis.side + " of " +
           text(axis.size) + ".";
  }
  if (axis.length == 0 && axis.offset > 0) {
    return "the region of interest begins at pixel " + text(axis.offset) + " of the " + axis.side +
           " and is empty.";
  }
  if (axis.extent() == 0) {
    return fault(std::string("binning of the ") + axis.side, axis.binning,
                 "more than the pixels that there are");
  }
  return {};
}

// @returns empty where a ray is too far off the camera's axis
std::vector<double> rays_along(const Axis& axis) {
  const double binning = axis.binned();
  const double focal_length = axis.focal_length / binning;
  const double center = (axis.center - axis.offset) / binning;
  std::vector<double> rays(axis.extent());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays[i] = (static_cast<double>(i) - center) / focal_length;
    if (!(std::abs(rays[i]) <= kWidestRay)) return {};
  }
  return rays;
}

std::string check_sizes(const DepthImage& image, std::uint64_t pixel, std::size_t max_points) {
  const std::uint64_t width = image.width, height = image.height, step = image.step;
  if (width == 0 || height == 0) {
    return "width " + text(width) + " * height " + text(height) +
           " is no pixel, an image has at least one.";
  }
  if (step < width * pixel) {
    return "step is " + text(step) + ", less than width " + text(width) + " * " + text(pixel) +
           " bytes = " + text(width * pixel) + ".";
  }
  if (image.data_size < height * step) {
    return "data holds " + text(image.data_size) + " bytes, less than height " + text(height) +
           " * step " + text(step) + " = " + text(height * step) + ".";
  }
  if (image.data == nullptr) return "data is null.";
  if (width * height > max_points) {
    return "width " + text(width) + " * height " + text(height) + " is " + text(width * height) +
           " pixels, allowed are at most " + text(max_points) + " (max_points).";
  }
  return {};
}

// [rad] Between two neighbouring pixels in the middle of the image, where it is largest.
double spacing(const std::vector<double>& rays) {
  return rays.size() > 1 ? std::abs(rays[1] - rays[0]) : 0.0;
}

}  // namespace

std::string check_camera(const CameraModel& camera, std::shared_ptr<const DepthRays>* rays) {
  const bool has_P =
      std::any_of(camera.P.begin(), camera.P.end(), [](double value) { return value != 0.0; });
  const bool has_K =
      std::any_of(camera.K.begin(), camera.K.end(), [](double value) { return value != 0.0; });
  if (!has_P && !has_K) return "K and P are all zero: the camera is not calibrated.";
  const Projection projection =
      has_P ? Projection{"P", camera.P.data(), 4} : Projection{"K", camera.K.data(), 3};
  std::string problem = check_projection(projection);
  if (!problem.empty()) return problem;
  const Axis across = {"width",          camera.width,        camera.roi_x_offset, camera.roi_width,
                       camera.binning_x, projection.at(0, 0), projection.at(0, 2)};
  const Axis down = {"height",         camera.height,       camera.roi_y_offset, camera.roi_height,
                     camera.binning_y, projection.at(1, 1), projection.at(1, 2)};
  auto result = std::make_shared<DepthRays>();
  if (has_P) {
    const Eigen::Vector3d& center =
        result->center = {-camera.P[3] / camera.P[0], -camera.P[7] / camera.P[5], 0.0};
    if (!(center.cwiseAbs().maxCoeff() <= kFarthestCenter)) {
      return "P[3] and P[7] put the centre of projection at (" + text(center.x()) + ", " +
             text(center.y()) + ", 0) m, allowed are at most 10 m.";
    }
  }
  for (const Axis* axis : {&across, &down}) {
    problem = check_axis(*axis);
    if (!problem.empty()) return problem;
    std::vector<double>& along = axis == &across ? result->x : result->y;
    along = rays_along(*axis);
    if (along.empty()) {
      return std::string(projection.name) + " has a focal length of " + text(axis->focal_length) +
             " and a centre at " + text(axis->center) + " pixels: with a " + axis->side + " of " +
             text(axis->size) + " some pixel would look more than 89 degrees off the axis.";
    }
  }
  *rays = std::move(result);
  return {};
}

bool is_distorted(const CameraModel& camera) {
  return std::any_of(camera.D.begin(), camera.D.end(), [](double value) { return value != 0.0; });
}

std::string check_depth_image(const DepthImage& image, const std::shared_ptr<const DepthRays>& rays,
                              RawCloud* cloud, std::size_t max_points) {
  const bool is_float = image.encoding == "32FC1";
  if (!is_float && image.encoding != "16UC1" && image.encoding != "mono16") {
    return "encoding is '" + image.encoding.substr(0, kLongestEncoding) +
           "', a depth image has 16UC1 or mono16 (mm) or 32FC1 (m).";
  }
  const std::size_t pixel = is_float ? sizeof(float) : sizeof(std::uint16_t);
  std::string problem = check_sizes(image, pixel, max_points);
  if (!problem.empty()) return problem;
  if (!(image.unit >= 0.0) || !std::isfinite(image.unit)) {
    return fault("unit", image.unit, "it must be a length in m, or 0");
  }
  if (rays == nullptr) return "the camera of the image is not known.";
  if (image.width != rays->x.size() || image.height != rays->y.size()) {
    return "the image has " + text(image.width) + " x " + text(image.height) +
           " pixels, its camera (width and height, or region of interest, over binning) has " +
           text(rays->x.size()) + " x " + text(rays->y.size()) + ".";
  }
  *cloud = RawCloud();
  cloud->data = image.data;
  cloud->width = image.width;
  cloud->height = image.height;
  cloud->point_step = pixel;
  cloud->row_step = image.step;
  cloud->depth = is_float ? DepthType::kFloat32 : DepthType::kUint16;
  cloud->rays = rays;
  cloud->origin = rays->center;
  cloud->from_rays = true;
  cloud->depth_unit = image.unit > 0.0 ? image.unit : is_float ? kMetre : kMillimetre;
  cloud->pixel_angle = std::max(spacing(rays->x), spacing(rays->y));
  cloud->swap_bytes = image.is_bigendian != kMachineIsBigEndian;
  return {};
}

}  // namespace ist
