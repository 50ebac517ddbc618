#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/index/point_bvh_builder.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

/// Keeps one point of each occupied cell of a cubic grid that is aligned to the fixed frame: the
/// one nearest to the cell's centre, so that which one it is does not depend on the points' order
/// and changes little as they move. Keeps its memory. Not thread safe.
class Thinning {
 public:
  /// @param all   what to thin
  /// @param cell_size  [m] > 0, edge of a cell
  /// @param thin  overwritten, with the same origin and ids, along the fixed frame's axes
  void run(const PointBvh& all, double cell_size, PointBvhBuilder* builder, PointBvh* thin);

 private:
  /// Number of a cell along each axis, from the origin.
  struct Cell {
    std::int32_t x, y, z;
    bool operator==(const Cell& other) const {
      return x == other.x && y == other.y && z == other.z;
    }
    /// In a cube of 8 x 8 x 8 that is repeated all over space.
    std::size_t place() const {
      return static_cast<std::size_t>((x & 7) | (y & 7) << 3 | (z & 7) << 6);
    }
  };

  /// The best point of a cell so far.
  struct Entry {
    Cell cell;
    float off_centre;  ///< squared distance to the cell's centre, in cells
    float x, y, z;     ///< [m] in the frame of the index
    std::uint32_t id;

    bool better_than(const Entry& other) const;
  };

  static std::size_t hash(const Cell& cell);
  bool is_beaten(const Cell& cell, float off_centre) const;
  void add(const Entry& entry);
  std::uint32_t* find(const Cell& cell);
  void grow();

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> table_;  ///< open addressing: number of an entry plus one, or 0
  /// Entries of the cells seen last, by their place: neighbours share cells.
  std::array<std::uint32_t, 512> recent_{};
  std::vector<CloudPoint> points_;
};

}  // namespace ist
