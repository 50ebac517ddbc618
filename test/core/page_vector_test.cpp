// Memory of large arrays of an index: pages that nothing was written to take none, and all are
// returned.

#include "internal/cloud/page_vector.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace ist {
namespace {

struct alignas(64) Tile {
  float values[80];
};

constexpr std::size_t kTiles = 20000;  // 6.4 MB

// The pages of an array that take memory.
std::size_t resident_pages(const Tile* tiles, std::size_t count) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const auto begin = reinterpret_cast<std::uintptr_t>(tiles) / page * page;
  const auto end = reinterpret_cast<std::uintptr_t>(tiles + count);
  std::vector<unsigned char> state((end - begin + page - 1) / page);
  if (mincore(reinterpret_cast<void*>(begin), end - begin, state.data()) != 0) return 0;
  return static_cast<std::size_t>(
      std::count_if(state.begin(), state.end(), [](unsigned char s) { return (s & 1U) != 0; }));
}

TEST(PageVector, PagesTakeMemoryOnceTheyAreWrittenTo) {
  PageVector<Tile> tiles;
  tiles.reserve(kTiles);
  tiles.resize(kTiles);
  EXPECT_EQ(resident_pages(tiles.data(), kTiles), 0U);
  for (std::size_t i = 0; i < kTiles; i += 1000) tiles[i].values[0] = 1.0F;
  const std::size_t used = resident_pages(tiles.data(), kTiles);
  EXPECT_GE(used, 20U);
  EXPECT_LE(used, 40U) << "a tile lies in two pages at most";
  tiles.clear();
  tiles.resize(kTiles);
  EXPECT_EQ(resident_pages(tiles.data(), kTiles), used) << "the same memory again";
}

TEST(PageVector, FreedMemoryIsReturned) {
  PageVector<Tile> tiles(kTiles);
  for (Tile& tile : tiles) tile.values[0] = 1.0F;
  const Tile* const place = tiles.data();
  EXPECT_GT(resident_pages(place, kTiles), 1000U);
  tiles = PageVector<Tile>();
  EXPECT_EQ(resident_pages(place, kTiles), 0U) << "no such memory any more";
}

TEST(PageVector, SmallAndLargeOnesHoldTheirElements) {
  PageVector<Tile> tiles;
  for (std::size_t i = 0; i < kTiles; ++i) {  // from the heap to pages of its own
    tiles.emplace_back();
    tiles.back().values[79] = static_cast<float>(i);
    ASSERT_EQ(reinterpret_cast<std::uintptr_t>(tiles.data()) % alignof(Tile), 0U);
  }
  const PageVector<Tile> copy = tiles;
  for (std::size_t i = 0; i < kTiles; ++i) ASSERT_EQ(copy[i].values[79], static_cast<float>(i));
}

}  // namespace
}  // namespace ist
