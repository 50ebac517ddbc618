#pragma once

#include <xxhash.h>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace ist {

/// Appends little-endian numbers to a string of bytes, on machines of any byte order.
class ByteWriter {
 public:
  void u32(std::uint32_t value) { integer(value, 4); }
  void u64(std::uint64_t value) { integer(value, 8); }
  void f64(double value) {
    std::uint64_t bits;
    const double canonical = value + 0.0;  // -0.0 becomes 0.0
    std::memcpy(&bits, &canonical, sizeof(bits));
    u64(bits);
  }
  void vector(const Eigen::Vector3d& v) {
    for (int i = 0; i < 3; ++i) f64(v[i]);
  }
  void raw(const char* data, std::size_t size) { bytes_.append(data, size); }
  /// The lowest `size` bytes of a number.
  void integer(std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) {
      bytes_.push_back(static_cast<char>((value >> (8 * i)) & 0xFFU));
    }
  }
  void reserve(std::size_t size) { bytes_.reserve(size); }

  std::uint64_t hash(std::uint64_t seed) const { return XXH64(bytes_.data(), bytes_.size(), seed); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Reads what ByteWriter wrote. The caller must have checked that there are enough bytes.
class ByteReader {
 public:
  explicit ByteReader(const std::string& bytes) : bytes_(bytes) {}

  std::uint32_t u32() { return static_cast<std::uint32_t>(integer(4)); }
  std::uint64_t u64() { return integer(8); }
  double f64() {
    const std::uint64_t bits = u64();
    double value;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
  }
  std::string raw(std::size_t size) {
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  std::uint64_t integer(std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes_[at_++])) << (8 * i);
    }
    return value;
  }
  std::size_t left() const { return bytes_.size() - at_; }  ///< bytes that are not read yet

 private:
  const std::string& bytes_;
  std::size_t at_ = 0;
};

}  // namespace ist
