#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>

namespace ist {

/// The kind and size of a number in a file.
struct NumberFormat {
  enum class Kind { kSigned, kUnsigned, kFloat } kind = Kind::kFloat;
  std::size_t size = 4;        ///< [bytes] 1, 2, 4 or 8; 4 or 8 for kFloat
  bool is_big_endian = false;  ///< byte order in the file

  bool is_valid() const {
    if (kind == Kind::kFloat) return size == 4 || size == 8;
    return size == 1 || size == 2 || size == 4 || size == 8;
  }

  /// The number that a text stands for: a float32's digits are not all its own.
  double nearest(double value) const {
    return kind == Kind::kFloat && size == 4 ? static_cast<double>(static_cast<float>(value))
                                             : value;
  }

  /// Reads the number at `data`, of `size` bytes.
  double read(const char* data) const {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t at = is_big_endian ? i : size - 1 - i;
      bits = bits << 8U | static_cast<unsigned char>(data[at]);
    }
    if (kind == Kind::kUnsigned) return static_cast<double>(bits);
    if (kind == Kind::kFloat && size == 4) {
      const auto half = static_cast<std::uint32_t>(bits);
      float value;
      std::memcpy(&value, &half, sizeof(value));
      return static_cast<double>(value);
    }
    if (kind == Kind::kFloat) {
      double value;
      std::memcpy(&value, &bits, sizeof(value));
      return value;
    }
    const std::uint64_t sign = std::uint64_t{1} << (8 * size - 1);
    return static_cast<double>(static_cast<std::int64_t>((bits ^ sign) - sign));
  }
};

}  // namespace ist
