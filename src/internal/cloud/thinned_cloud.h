#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "internal/bvh/box_node.h"
#include "internal/cloud/page_vector.h"
#include "internal/cloud/point_tile.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

class PointBvh;

/// A box in the layout of a BoxNode with a single slot.
struct SingleBox {
  float min_x[1], min_y[1], min_z[1];
  float max_x[1], max_y[1], max_z[1];
};

/// The weight of a thinned point, which stands for the part of a surface through it that lies
/// within its cell: with rho its distance from the cell's centre over that of a corner, about (1 -
/// rho^2)^2 of the largest section. So a cell that a surface only just cuts, where the number of
/// points decides whether one is in it, counts little. It counts something, so that every sum of
/// weights is positive.
/// @param offset_sq  squared distance to the cell's centre, in cells
inline float cell_weight(float offset_sq) {
  constexpr float kLeast = 0.01F;
  constexpr float kCornerSquared = 0.75F;  // cells^2 from a cell's centre
  const float section = std::max(1.0F - offset_sq / kCornerSquared, 0.0F);
  return kLeast + (1.0F - kLeast) * section * section;
}

/// Weighted points as they act from afar.
struct PointMoments {
  float weight;     ///< sum of the weights
  float middle[3];  ///< [m] weighted mean
  float spread[6];  ///< [m^2] weighted sum of products about the middle: xx, yy, zz, xy, yz, zx
};

/// Points of the thinned cloud.
struct ThinnedTile : PointTile {
  float weight[kPointWidth];  ///< by point, see cell_weight(); 0 in unused slots
  SingleBox box;              ///< [m] in O; of exactly its points
  PointMoments moments;       ///< of exactly its points, in O
};

/// The thinned points of a node of the lowest level; no more tiles than the node has.
struct ThinnedNode {
  ThinnedTile tiles[kBoxWidth];
  std::uint32_t count;  ///< of tiles
};

/// Storage for the thinned points of an index, node by node. The points of a node are found when a
/// query first asks for them. A node's points are a function of the index alone, so that it does
/// not matter who finds them: every reader of a node that is not stored finds them in a buffer of
/// its own, and the first one also stores them. Nobody waits.
class ThinnedStorage {
 public:
  /// Forgets what is stored. Not to be called while others read.
  /// @param nodes  of the index
  /// @param tiles  of the index; as many thinned tiles fit
  void reset(std::size_t nodes, std::size_t tiles);

  std::size_t memory() const {  ///< [bytes] reserved
    return word_capacity_ * sizeof words_[0] + tiles_.capacity() * sizeof(ThinnedTile);
  }

  /// The tiles of a node where they are stored. @returns whether they are
  bool find(std::size_t node, Span<const ThinnedTile>* tiles) const;

  /// Stores the tiles of a node unless somebody else does.
  void store(std::size_t node, const ThinnedNode& thinned) const;

 private:
  // A word for each node: 0, kClaimed, or kStored with the number of the first tile and the count.
  static constexpr std::uint64_t kClaimed = 1, kStored = 2;
  static constexpr std::uint64_t kCountShift = 2, kCountMask = 31, kFirstShift = 7;
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "nobody may wait");

  std::unique_ptr<std::atomic<std::uint64_t>[]> words_;  ///< the last one counts used tiles
  mutable PageVector<ThinnedTile> tiles_;                ///< pages are used when they are filled
  std::size_t word_capacity_ = 0, nodes_ = 0;
};

/// The thinned cloud of an index: of the points in each voxel of a grid that is aligned to the
/// fixed frame, the one nearest to the voxel's centre, so that the choice does not depend on the
/// order of the points and changes little as they move. It has the hierarchy of the index, whose
/// nodes of the lowest level are its leaves. A view, thread safe; neither allocates nor waits.
class ThinnedCloud {
 public:
  explicit ThinnedCloud(const PointBvh& all) : all_(all) {}

  bool empty() const;  ///< no points, or not to be thinned
  const Eigen::Isometry3d& X_FO() const;
  const std::vector<BoxNode>& nodes() const;
  std::int32_t root() const;
  /// Whether a node is a leaf: of the lowest level.
  static bool is_leaf(const BoxNode& node) { return node.child[0] < 0; }

  /// Whether tiles() of a leaf need not be found any more, which takes microseconds.
  bool is_stored(std::int32_t leaf) const;

  /// The thinned points of a leaf.
  /// @param buffer  may hold the answer
  Span<const ThinnedTile> tiles(std::int32_t leaf, ThinnedNode* buffer) const;

 private:
  const PointBvh& all_;
};

}  // namespace ist
