#pragma once

#include <cstdint>

namespace ist {

/// A point while an index is built; it fits one SIMD register.
struct alignas(16) CloudPoint {
  float x, y, z;     ///< [m] from the index's origin
  std::uint32_t id;  ///< carried through to the answers
};

}  // namespace ist
