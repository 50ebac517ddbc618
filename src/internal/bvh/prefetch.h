#pragma once

#include <hwy/cache_control.h>

#include <cstddef>
#include <cstdint>

namespace ist {

/// Asks for the cache lines of an object that will be read soon. Hierarchies are larger than the
/// fastest caches. It reads nothing itself: any address is allowed.
/// @param begin  the object
/// @param size   [bytes] of the object
HWY_INLINE void prefetch_lines(const void* begin, std::size_t size) {
  constexpr std::size_t kLine = 64;
  const auto* bytes = static_cast<const char*>(begin);
  for (std::size_t i = 0; i < size; i += kLine) hwy::Prefetch(bytes + i);
}

/// Asks for what the expansion of a box hierarchy's child will read.
/// @tparam Bvh   PointBvh or BoxBvh
/// @param bvh    the hierarchy
/// @param child  index of a node, or, inverted, of a tile
template <class Bvh>
HWY_INLINE void prefetch_child(const Bvh& bvh, std::int32_t child) {
  if (child < 0) {
    prefetch_lines(bvh.place_of_tile(static_cast<std::size_t>(~child)), sizeof(typename Bvh::Tile));
  } else {
    const auto& node = bvh.nodes()[static_cast<std::size_t>(child)];
    prefetch_lines(&node, sizeof node);
  }
}

}  // namespace ist
