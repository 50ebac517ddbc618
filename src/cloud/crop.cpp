#include "cloud/crop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFarFromSensor = 1000.0;  // [m]
constexpr std::size_t kSamples = 1024;     // points that the middle of a cloud is made of
constexpr std::size_t kBlock = 256;        // points at a time: fits the first-level cache

template <typename Bits>
Bits swapped(Bits bits) {
  Bits result = 0;
  for (std::size_t byte = 0; byte < sizeof(Bits); ++byte) {
    result = static_cast<Bits>(result << 8 | (bits & 0xFFU));
    bits >>= 8;
  }
  return result;
}

// Coordinates in a message are not aligned to anything.
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

// One row of points where the rows follow each other without gaps, and a column is a row as well:
// blocks are to be full.
RawCloud flattened(RawCloud cloud) {
  if (cloud.width == 1) {
    cloud.point_step = cloud.row_step;
  } else if (cloud.row_step != cloud.width * cloud.point_step) {
    return cloud;
  }
  cloud.width *= cloud.height;
  cloud.height = 1;
  return cloud;
}

template <typename Scalar, bool kSwap>
class Cropper {
 public:
  Cropper(const RawCloud& cloud, double min_range, double max_range)
      : cloud_(flattened(cloud)),
        min_range_sq_(min_range * min_range),
        max_range_sq_(std::min(max_range, kLargestRange) * std::min(max_range, kLargestRange)) {}

  // Where a cloud is that does not lie about its sensor: the median, axis by axis, of some of its
  // points. In the sensor frame [m]; zero where the cloud is about its sensor.
  Eigen::Vector3d middle() const {
    std::array<std::array<double, kSamples>, 3> samples;
    std::size_t count = 0;
    const std::size_t n = cloud_.width * cloud_.height;
    const std::size_t stride = (n + kSamples - 1) / kSamples;
    for (std::size_t i = 0; i < n; i += stride) {
      const Eigen::Vector3d p = point(i);
      if (!in_range(p.squaredNorm())) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        samples[axis][count] = p[static_cast<Eigen::Index>(axis)];
      }
      ++count;
    }
    if (count == 0) return Eigen::Vector3d::Zero();
    Eigen::Vector3d median;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto begin = samples[axis].begin();
      const auto half = static_cast<std::ptrdiff_t>(count / 2);
      std::nth_element(begin, begin + half, begin + static_cast<std::ptrdiff_t>(count));
      median[static_cast<Eigen::Index>(axis)] = samples[axis][count / 2];
    }
    return median.norm() > kFarFromSensor ? median : Eigen::Vector3d::Zero();
  }

  // @param X_OS  sensor frame -> fixed frame's axes at the origin
  void run(const Eigen::Isometry3d& X_OS, CroppedCloud* out, IngestCounts* counts) {
    std::uint32_t id = 0;
    for (std::size_t row = 0; row < cloud_.height; ++row) {
      for (std::size_t column = 0; column < cloud_.width; column += kBlock) {
        const std::size_t count = std::min(kBlock, cloud_.width - column);
        load(cloud_.data + row * cloud_.row_step + column * cloud_.point_step, count);
        transform(X_OS, count);
        append(count, id, out, counts);
        id += static_cast<std::uint32_t>(count);
      }
    }
  }

 private:
  Eigen::Vector3d point(std::size_t i) const {
    const std::uint8_t* bytes =
        cloud_.data + i / cloud_.width * cloud_.row_step + i % cloud_.width * cloud_.point_step;
    return Eigen::Matrix<Scalar, 3, 1>(read<Scalar, kSwap>(bytes + cloud_.x),
                                       read<Scalar, kSwap>(bytes + cloud_.y),
                                       read<Scalar, kSwap>(bytes + cloud_.z))
        .template cast<double>();
  }

  // False for NaN, and for what overflows. Without a branch.
  bool in_range(double range_sq) const {
    return static_cast<bool>(static_cast<int>(range_sq >= min_range_sq_) &
                             static_cast<int>(range_sq <= max_range_sq_));
  }

  void load(const std::uint8_t* bytes, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i, bytes += cloud_.point_step) {
      x_S_[i] = read<Scalar, kSwap>(bytes + cloud_.x);
      y_S_[i] = read<Scalar, kSwap>(bytes + cloud_.y);
      z_S_[i] = read<Scalar, kSwap>(bytes + cloud_.z);
    }
  }

  void transform(const Eigen::Isometry3d& X_OS, std::size_t count) {
    const Eigen::Matrix3d R = X_OS.linear();
    const Eigen::Vector3d t = X_OS.translation();
    for (std::size_t i = 0; i < count; ++i) {
      const double x = x_S_[i], y = y_S_[i], z = z_S_[i];
      range_sq_[i] = x * x + y * y + z * z;
      x_[i] = static_cast<float>(R(0, 0) * x + R(0, 1) * y + R(0, 2) * z + t[0]);
      y_[i] = static_cast<float>(R(1, 0) * x + R(1, 1) * y + R(1, 2) * z + t[1]);
      z_[i] = static_cast<float>(R(2, 0) * x + R(2, 1) * y + R(2, 2) * z + t[2]);
    }
  }

  // Writes every point and moves on only past those to keep: no branch to mispredict.
  void append(std::size_t count, std::uint32_t first_id, CroppedCloud* out, IngestCounts* counts) {
    std::size_t size = out->size;
    std::uint32_t not_a_number = 0;
    for (std::size_t i = 0; i < count; ++i) {
      out->x[size] = x_[i];
      out->y[size] = y_[i];
      out->z[size] = z_[i];
      out->id[size] = first_id + static_cast<std::uint32_t>(i);
      const double range_sq = range_sq_[i];
      size += static_cast<std::size_t>(in_range(range_sq));
      not_a_number += static_cast<std::uint32_t>(range_sq != range_sq);
      if (range_sq == kInfinity) counts->infinite += static_cast<std::uint32_t>(is_infinite(i));
    }
    counts->not_a_number += not_a_number;
    out->size = size;
  }

  // Not merely so large that its square is.
  bool is_infinite(std::size_t i) const {
    return std::isinf(x_S_[i]) || std::isinf(y_S_[i]) || std::isinf(z_S_[i]);
  }

  const RawCloud cloud_;
  const double min_range_sq_, max_range_sq_;  // [m^2]
  std::array<Scalar, kBlock> x_S_, y_S_, z_S_;
  std::array<double, kBlock> range_sq_;  // [m^2]
  std::array<float, kBlock> x_, y_, z_;
};

template <typename Scalar, bool kSwap>
void crop_as(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, double min_range,
             double max_range, CroppedCloud* cropped, IngestCounts* counts) {
  Cropper<Scalar, kSwap> cropper(cloud, min_range, max_range);
  Eigen::Vector3d near_S = Eigen::Vector3d::Zero();
  if (max_range > kFarFromSensor) near_S = cropper.middle();
  cropped->origin = (X_FS * near_S).array().round();
  Eigen::Isometry3d X_OS = X_FS;
  X_OS.translation() -= cropped->origin;
  cropper.run(X_OS, cropped, counts);
}

}  // namespace

void crop(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, double min_range, double max_range,
          CroppedCloud* cropped, IngestCounts* counts) {
  const std::size_t n = cloud.size();
  if (cropped->x.size() <= n) {  // one slot to spare, for the point after the last that is kept
    cropped->x.resize(n + 1);
    cropped->y.resize(n + 1);
    cropped->z.resize(n + 1);
    cropped->id.resize(n + 1);
  }
  cropped->size = 0;
  counts->received = static_cast<std::uint32_t>(n);
  if (cloud.is_double) {
    (cloud.swap_bytes ? crop_as<double, true> : crop_as<double, false>)(cloud, X_FS, min_range,
                                                                        max_range, cropped, counts);
  } else {
    (cloud.swap_bytes ? crop_as<float, true> : crop_as<float, false>)(cloud, X_FS, min_range,
                                                                      max_range, cropped, counts);
  }
  counts->out_of_range = counts->received - counts->not_a_number - counts->infinite -
                         static_cast<std::uint32_t>(cropped->size);
}

}  // namespace ist
