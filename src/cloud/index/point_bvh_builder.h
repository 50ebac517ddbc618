#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "cloud/format/cloud_point.h"
#include "cloud/index/divide_kernel.h"
#include "cloud/index/point_cells.h"
#include "cloud/index/point_slicer.h"
#include "internal/bvh/box_hierarchy.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

/// Says which points of a tile stay out of the index: bit k for slot k. The box holds exactly the
/// tile's points; its unused slots have no meaning yet.
using PointFilter = std::function<std::uint32_t(const PointTile& tile, const PaddedBox& box)>;

/// Says whether a PointFilter may drop a point of this box.
using BoxFilter = std::function<bool(const PaddedBox& box)>;

/// Builds point indices; keeps its working memory, so a steady stream of clouds allocates nothing.
/// Not thread safe.
///
/// Points in any order are brought together by the cells of a coarse grid; then each cell, which
/// fits the first caches, is sliced across the longest side of its box, and the slices again, until
/// sixteen neighbours are a tile. A tile with a gap is divided further, so that no tile has a big
/// box. Tiles that follow each other are a node's.
class PointBvhBuilder {
 public:
  /// As PointBvh::build, in any frame.
  /// @param X_FO    frame of the points -> fixed frame, rigid
  /// @param drop    may be empty. Called once for each tile-to-be, before boxes are made: to filter
  ///                a tile at a time is much cheaper than a point at a time.
  /// @param index   overwritten, its buffers reused
  void build(const Eigen::Isometry3d& X_FO, const CloudPoint* points, std::size_t n,
             const PointFilter& drop, PointBvh* index);

  /// The same for the points in cells().
  /// @param may_drop  may be empty: a filter may drop anything
  void build(const Eigen::Isometry3d& X_FO, const PointFilter& drop, const BoxFilter& may_drop,
             PointBvh* index);
  PointCells& cells() { return cells_; }

  /// The same for points of which neighbours in the list are mostly neighbours in space.
  void build_in_order(const Eigen::Isometry3d& X_FO, const std::vector<CloudPoint>& points,
                      PointBvh* index);

  /// The same tile by tile, for who knows which points are neighbours: start(), then room() and
  /// keep() for each tile, then finish(). Before finish(), the index is not to be read.
  void start(const Eigen::Isometry3d& X_FO, PointBvh* index);
  /// The next tiles, to be filled: points, ids and count.
  PointTile* room(std::size_t count);
  /// Keeps the first tile of room().
  /// @param box  of exactly its points
  void keep(const PaddedBox& box, const PointFilter& drop);
  /// Keeps the first tiles of room(), whose unused slots are far away, without a filter.
  /// @param boxes  of exactly the points of each tile, in order; others between them
  /// @param which  bit k: slot k of `boxes` is a tile's
  void keep_written(const BoxNode& boxes, std::uint32_t which);
  /// Tiles of an image may be kept before they are read: start(), then keep_unread() for each.
  /// @param image  where its bytes have no owner, tiles are read at once
  /// @param X_OS   sensor frame -> O
  void start_image(const Eigen::Isometry3d& X_FO, const RawCloud& image,
                   const Eigen::Isometry3d& X_OS, PointBvh* index);
  /// Keeps a whole tile.
  /// @param box  of its points, at least
  void keep_unread(const PaddedBox& box, std::uint32_t first_pixel);
  /// Keeps sixteen whole tiles as a node of their own. For neighbours that lie close together.
  /// @param boxes  of the points of each tile, at least
  /// @param first_pixels  of each tile
  void keep_unread_node(const BoxNode& boxes, const std::uint32_t* first_pixels);
  /// The tiles kept since the last call are neighbours: they become a node of their own if they
  /// fill it and lie close together, else they are grouped with others at the end.
  void end_neighbours();
  void finish();

 private:
  void add_unread(const std::uint32_t* first_pixels, std::size_t count);
  void add_runs(const CloudPoint* points, std::size_t n, const PointFilter& drop);
  struct Filters {
    const PointFilter& drop;
    const BoxFilter& may_drop;
  };
  void add_points(CloudPoint* points, CloudPoint* spare, std::size_t n, const Filters& filters);
  void add_part(CloudPoint* points, CloudPoint* spare, std::size_t n);
  template <typename Visit>
  void for_each_slice(std::size_t n, std::size_t part, const Visit& visit) const;
  void keep_batch(const Filters& filters);
  void keep_made(std::size_t begin, std::size_t end);
  void keep_filtered(std::size_t begin, std::size_t end, const PointFilter& drop);
  void end_cell();

  PointCells cells_;
  PointSlicer slicer_;
  std::vector<CloudPoint> spare_;  ///< for the points of the cell in work
  TileBatch batch_;
  std::vector<PointTile> filtered_;    ///< tiles in work of which points may be dropped
  std::vector<HierarchyChild> loose_;  ///< tiles that no node holds yet
  std::size_t neighbours_ = 0;         ///< first of them since the last end_neighbours()
  BoxHierarchy hierarchy_;
  PointBvh* index_ = nullptr;  ///< in work
  struct Run {
    std::size_t first, count;
  };
  std::vector<Run> unread_;  ///< of its tiles
  std::size_t used_ = 0;     ///< its tiles that are complete; later ones are of last time
};

}  // namespace ist
