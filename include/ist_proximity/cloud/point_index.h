#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/raw_cloud.h"
#include "ist_proximity/cloud/written_tiles.h"

namespace ist {

constexpr int kPointWidth = 16;

/// Points side by side for SIMD, in the index's frame [m]. Unused slots hold a point so
/// far away that no bound is touched by it (but whose square is still finite).
struct alignas(64) PointTile {
  float x[kPointWidth], y[kPointWidth], z[kPointWidth];
  std::uint32_t id[kPointWidth];  ///< index of the point in the message it came from
  std::int32_t count;             ///< used slots, at the front

  Eigen::Vector3d point(int k) const { return {x[k], y[k], z[k]}; }
};

/// Boxes of up to sixteen children side by side.
struct alignas(64) BoxNode {
  float min_x[kPointWidth], min_y[kPointWidth], min_z[kPointWidth];
  float max_x[kPointWidth], max_y[kPointWidth], max_z[kPointWidth];
  std::int32_t child[kPointWidth];  ///< >= 0: node; < 0: tile ~child
  std::int32_t count;               ///< used slots, at the front
};

constexpr float kFarAway = 1e15F;  ///< [m] coordinates of unused slots

/// An immutable hierarchy of boxes over points: tiles of up to 16 neighbours, 16-wide boxes above.
/// Coordinates are in a frame O of its own: its origin is near the points, so that float loses
/// nothing far from zero, and its axes lie along the scene's surfaces where ingest has found such,
/// so that boxes are thin; else along the fixed frame's. Thread safe.
///
/// Of an image whose bytes stay where they are, tiles are written when they are first looked at:
/// queries look at few of them.
class PointIndex {
 public:
  PointIndex() = default;
  PointIndex(const PointIndex& other) { *this = other; }
  PointIndex& operator=(const PointIndex& other);  ///< reads all tiles
  PointIndex(PointIndex&&) = default;
  PointIndex& operator=(PointIndex&&) = default;
  ~PointIndex() = default;

  /// Builds over points given relative to `origin` (fixed frame, double) along the fixed frame's
  /// axes, in structure-of-arrays.
  /// The result depends on nothing but the arguments. For a stream of clouds use
  /// PointIndexBuilder, which keeps its working memory; this allocates.
  /// @param x,y,z  n coordinates [m] each, finite, below kFarAway
  /// @param id     n identities, carried through to the answers
  void build(const Eigen::Vector3d& origin, const float* x, const float* y, const float* z,
             const std::uint32_t* id, std::size_t n);

  bool empty() const { return tiles_.empty(); }
  std::size_t size() const { return size_; }                    ///< points
  const Eigen::Isometry3d& X_FO() const { return X_FO_; }       ///< index's -> fixed frame
  const std::vector<BoxNode>& nodes() const { return nodes_; }  ///< the root is nodes()[root()]
  std::int32_t root() const { return root_; }                   ///< -1 when empty
  using Tile = PointTile;
  std::size_t tile_count() const { return tiles_.size(); }
  /// Neither allocates nor waits.
  /// @param i     below tile_count()
  /// @param room  may be used for the answer
  const PointTile& tile(std::size_t i, PointTile* room) const {
    return written_.is_written(i) ? tiles_[i] : read(i, room);
  }
  Eigen::AlignedBox3f bounds() const { return bounds_; }  ///< [m] in O
  /// Another number after every build() of any index: tells whether an answer belongs to it.
  std::uint64_t build_id() const { return build_id_; }

 private:
  friend class PointIndexBuilder;

  const PointTile& read(std::size_t i, PointTile* room) const;

  Eigen::Isometry3d X_FO_ = Eigen::Isometry3d::Identity();
  Eigen::AlignedBox3f bounds_;
  std::vector<BoxNode> nodes_;  ///< level by level, the root last
  mutable std::vector<PointTile> tiles_;
  WrittenTiles written_;
  // Where tiles are that have not been written.
  RawCloud image_;
  Eigen::Isometry3d X_OS_ = Eigen::Isometry3d::Identity();
  std::vector<std::uint32_t> first_pixel_;  ///< by tile
  std::size_t size_ = 0;
  std::int32_t root_ = -1;
  std::uint64_t build_id_ = 0;  ///< never 0 once built
};

}  // namespace ist
