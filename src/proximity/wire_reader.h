#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "ist_proximity/geometry/span.h"

namespace ist {

/// A fault in the bytes of a message.
struct WireError {
  std::string what;
};

/// Reads the fields of a serialized ROS message, one after another. Whatever the bytes are, it
/// reads none behind their end, and a count of elements that cannot follow is a fault before
/// anything is done for them.
class WireReader {
 public:
  explicit WireReader(Span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::size_t left() const { return bytes_.size() - at_; }  ///< [bytes]

  std::uint8_t u8(const char* what) { return *take(1, what); }
  bool boolean(const char* what) { return u8(what) != 0; }
  std::uint32_t u32(const char* what) {
    const std::uint8_t* b = take(4, what);
    return static_cast<std::uint32_t>(b[0]) | static_cast<std::uint32_t>(b[1]) << 8U |
           static_cast<std::uint32_t>(b[2]) << 16U | static_cast<std::uint32_t>(b[3]) << 24U;
  }
  double f64(const char* what) {
    const std::uint64_t low = u32(what);
    const std::uint64_t bits = low | static_cast<std::uint64_t>(u32(what)) << 32U;
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  /// A count of elements of at least `size` bytes each.
  std::size_t count(std::size_t size, const char* what) {
    const std::size_t count = u32(what);
    if (count > left() / size) {
      fail(std::string("it states ") + std::to_string(count) + " " + what + ", of at least " +
           std::to_string(size) + " bytes each");
    }
    return count;
  }

  /// @param most  bytes that are kept
  std::string string(std::size_t most, const char* what) {
    const std::size_t size = count(1, what);
    const auto* text = reinterpret_cast<const char*>(take(size, what));
    return {text, size < most ? size : most};
  }

  /// @returns the next `size` bytes, of those that the reader was given
  const std::uint8_t* take(std::size_t size, const char* what) {
    if (size > left()) fail(std::string("it ends within ") + what);
    const std::uint8_t* first = bytes_.data() + at_;
    at_ += size;
    return first;
  }

  void skip(std::size_t size, const char* what) { take(size, what); }
  void skip_string(const char* what) { skip(count(1, what), what); }
  void skip_array(std::size_t size, const char* what) { skip(count(size, what) * size, what); }
  /// @returns how many strings there were
  std::size_t skip_strings(const char* what) {
    const std::size_t strings = count(4, what);
    for (std::size_t i = 0; i < strings; ++i) skip_string(what);
    return strings;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw WireError{"byte " + std::to_string(at_) + " of " + std::to_string(bytes_.size()) + ": " +
                    what};
  }

 private:
  Span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

}  // namespace ist
