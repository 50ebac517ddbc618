#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/bvh/box_node.h"
#include "internal/cloud/lazy_tile_flags.h"
#include "internal/cloud/page_vector.h"
#include "internal/cloud/point_tile.h"
#include "internal/cloud/thinned_cloud.h"
#include "internal/cloud/voxel_grid.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// The data of a PointIndex: tiles of up to sixteen points, mostly neighbours, and a bounding
/// volume hierarchy of boxes over them. A traversal takes it once, by PointIndex::bvh(). Immutable
/// once built, thread safe.
///
/// Tiles of an organized cloud whose bytes stay where they are get loaded when a query first looks
/// at them; queries look at few.
class PointBvh {
 public:
  PointBvh() = default;
  PointBvh(const PointBvh& other) { *this = other; }
  PointBvh& operator=(const PointBvh& other);  ///< loads all tiles
  PointBvh(PointBvh&&) = default;
  PointBvh& operator=(PointBvh&&) = default;
  ~PointBvh() = default;

  bool empty() const { return tiles_.empty(); }
  std::size_t size() const { return size_; }                    ///< points
  const Eigen::Isometry3d& X_FO() const { return X_FO_; }       ///< index's -> fixed frame
  const std::vector<BoxNode>& nodes() const { return nodes_; }  ///< the root is nodes()[root()]
  std::int32_t root() const { return root_; }                   ///< -1 when empty
  using Tile = PointTile;
  std::size_t tile_count() const { return tiles_.size(); }
  /// Neither allocates nor waits.
  /// @param i        below tile_count()
  /// @param scratch  may hold the answer
  const PointTile& tile(std::size_t i, PointTile* scratch) const {
    return flags_.is_loaded(i) ? tiles_[i] : load(i, scratch);
  }
  bool is_loaded(std::size_t i) const { return flags_.is_loaded(i); }  ///< tile i holds its points
  /// The place of a tile, loaded or not, for prefetching.
  const PointTile* place_of_tile(std::size_t i) const { return &tiles_[i]; }
  Eigen::AlignedBox3f bounds() const { return bounds_; }  ///< [m] in O
  /// [bytes] Reserved; pages of tiles that no query has looked at are not in use.
  std::size_t memory() const {
    return nodes_.capacity() * sizeof(BoxNode) + tiles_.capacity() * sizeof(PointTile) +
           first_pixel_.capacity() * sizeof(std::uint32_t) + flags_.memory() + thinned_.memory();
  }
  std::uint64_t build_id() const { return build_id_; }  ///< 0 before the first build

  /// Makes it empty and lets go of the message, and keeps its memory for the next build. Not to be
  /// called while others read.
  void clear();

  /// Gives it a thinned cloud until it is built again. Not to be called while others read.
  /// @param voxel_size  [m] > 0, edge of a voxel
  void set_thinning(double voxel_size);
  /// Empty unless set_thinning() was called.
  ThinnedCloud thinned() const { return ThinnedCloud(*this); }

 private:
  friend class PointBvhBuilder;
  friend class ThinnedCloud;

  const PointTile& load(std::size_t i, PointTile* scratch) const;

  Eigen::Isometry3d X_FO_ = Eigen::Isometry3d::Identity();
  Eigen::AlignedBox3f bounds_;
  std::vector<BoxNode> nodes_;  ///< level by level, the root last
  mutable PageVector<PointTile> tiles_;
  LazyTileFlags flags_;
  // The source of the tiles that are not loaded.
  RawCloud cloud_;
  Eigen::Isometry3d X_OS_ = Eigen::Isometry3d::Identity();
  PageVector<std::uint32_t> first_pixel_;  ///< by tile, of those that are loaded lazily
  std::size_t size_ = 0;
  std::int32_t root_ = -1;
  std::uint64_t build_id_ = 0;
  bool is_thinned_ = false;
  VoxelGrid grid_;  ///< of the thinned cloud
  ThinnedStorage thinned_;
};

}  // namespace ist
