#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>

namespace ist::fuzz {

/// Takes typed values from the bytes of a fuzz input, front to back. Where the bytes end, values
/// are zero. Every byte string is a valid input, and small changes of it are small changes of the
/// values.
class ByteReader {
 public:
  ByteReader(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::size_t left() const { return size_; }
  const std::uint8_t* rest() const { return data_; }

  /// The bytes of a number as they are.
  template <typename T>
  T raw() {
    T value{};
    const std::size_t n = size_ < sizeof value ? size_ : sizeof value;
    if (n > 0) std::memcpy(&value, data_, n);
    data_ += n;
    size_ -= n;
    return value;
  }
  std::uint8_t byte() { return raw<std::uint8_t>(); }
  bool flag() { return (byte() & 1U) != 0; }
  /// 0 to n - 1.
  std::size_t below(std::size_t n) { return n < 257 ? byte() % n : raw<std::uint32_t>() % n; }

  /// A number from -size to size, on 2^16 steps.
  double within(double size) { return size * (raw<std::int16_t>() / 32768.0); }
  /// A number from low to high.
  double between(double low, double high) {
    return low + (high - low) * (raw<std::uint16_t>() / 65535.0);
  }
  Eigen::Vector3d vector(double size) {
    const double x = within(size), y = within(size), z = within(size);
    return {x, y, z};
  }
  /// An ordinary number, or now and then one that is hard: zero, tiny, huge, infinite, NaN.
  double number(double size) {
    const std::uint8_t kind = byte();
    if (kind < 200) return within(size);
    constexpr double kInf = std::numeric_limits<double>::infinity();
    constexpr double kHard[] = {0.0,
                                -0.0,
                                1e-300,
                                1e-45,
                                1e-9,
                                1e9,
                                1e15,
                                1e39,
                                1e300,
                                -1e39,
                                kInf,
                                -kInf,
                                std::numeric_limits<double>::quiet_NaN()};
    if (kind < 240) return kHard[kind % (sizeof kHard / sizeof kHard[0])];
    return raw<double>();
  }
  /// Rigid: any rotation, often none, and a translation within size.
  Eigen::Isometry3d pose(double size) {
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    const Eigen::Vector3d axis = vector(1.0);
    X.translation() = vector(size);
    if (axis.norm() > 1e-3)
      X.linear() = Eigen::AngleAxisd(4.0 * axis.norm(), axis.normalized()).toRotationMatrix();
    return X;
  }
  /// Up to `most` bytes as text: its length comes first.
  std::string text(std::size_t most) {
    std::size_t n = below(most + 1);
    if (n > size_) n = size_;
    const std::string value(reinterpret_cast<const char*>(data_), n);
    data_ += n;
    size_ -= n;
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

}  // namespace ist::fuzz
