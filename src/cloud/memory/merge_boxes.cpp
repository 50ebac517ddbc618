#include "cloud/memory/merge_boxes.h"

namespace ist {
namespace {

constexpr std::uint64_t kRow = 0xFF;

// The bits of x from `begin` on up to, not including, `end`, of a row.
std::uint64_t run(int begin, int end) { return (kRow >> (kBlockSide - end)) & (kRow << begin); }

// Takes the rectangle with the lowest bit of a layer as its corner, first along x, then along y.
struct Rectangle {
  int x0, x1, y0, y1;

  std::uint64_t bits() const {
    std::uint64_t all = 0;
    for (int y = y0; y < y1; ++y) all |= run(x0, x1) << (kBlockSide * y);
    return all;
  }
};

Rectangle first_rectangle(std::uint64_t layer) {
  const int lowest = __builtin_ctzll(layer);
  Rectangle r{lowest % kBlockSide, 0, lowest / kBlockSide, 0};
  r.x1 = r.x0 + 1;
  while (r.x1 < kBlockSide && (layer >> (kBlockSide * r.y0 + r.x1) & 1U) != 0) ++r.x1;
  r.y1 = r.y0 + 1;
  const std::uint64_t row = run(r.x0, r.x1);
  while (r.y1 < kBlockSide && (layer >> (kBlockSide * r.y1) & row) == row) ++r.y1;
  return r;
}

}  // namespace

void append_boxes(const BlockBits& bits, const VoxelKey& first, const VoxelScale& scale,
                  VoxelBoxes* boxes) {
  BlockBits left = bits;
  for (int z = 0; z < kBlockSide; ++z) {
    while (left[z] != 0) {
      const Rectangle r = first_rectangle(left[z]);
      const std::uint64_t rectangle = r.bits();
      int z1 = z;
      while (z1 < kBlockSide && (left[z1] & rectangle) == rectangle) left[z1++] &= ~rectangle;
      boxes->emplace_back(
          Eigen::Vector3d(scale.border(first.x + r.x0), scale.border(first.y + r.y0),
                          scale.border(first.z + z)),
          Eigen::Vector3d(scale.border(first.x + r.x1), scale.border(first.y + r.y1),
                          scale.border(first.z + z1)));
    }
  }
}

}  // namespace ist
