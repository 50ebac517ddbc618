#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/memory/voxel_blocks.h"

namespace ist {

/// Calls a function with the place of each bit that is set.
template <typename Visit>
void for_each_bit(const BlockBits& bits, const Visit& visit) {
  for (unsigned word = 0; word < kBlockSide; ++word) {
    for (std::uint64_t rest = bits[word]; rest != 0; rest &= rest - 1) {
      visit(64 * word + static_cast<unsigned>(__builtin_ctzll(rest)));
    }
  }
}

inline std::size_t count_bits(const BlockBits& bits) {
  std::size_t count = 0;
  for (const std::uint64_t word : bits) {
    count += static_cast<std::size_t>(__builtin_popcountll(word));
  }
  return count;
}

inline bool test_bit(const BlockBits& bits, unsigned place) {
  return (bits[place >> 6U] >> (place & 63U) & 1U) != 0;
}
inline void set_bit(unsigned place, BlockBits* bits) {
  (*bits)[place >> 6U] |= std::uint64_t{1} << (place & 63U);
}
inline void clear_bit(unsigned place, BlockBits* bits) {
  (*bits)[place >> 6U] &= ~(std::uint64_t{1} << (place & 63U));
}

/// The bits of one set that are not in another.
inline BlockBits without(const BlockBits& bits, const BlockBits& others) {
  BlockBits result{};
  for (int z = 0; z < kBlockSide; ++z) result[z] = bits[z] & ~others[z];
  return result;
}

}  // namespace ist
