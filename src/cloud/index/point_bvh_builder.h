#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/filters/point_filter.h"
#include "cloud/format/cloud_point.h"
#include "cloud/index/point_cells.h"
#include "cloud/index/point_slicer.h"
#include "cloud/index/slice_kernel.h"
#include "internal/bvh/box_hierarchy.h"
#include "internal/cloud/point_bvh.h"

namespace ist {

constexpr auto kTilePoints = static_cast<std::size_t>(kPointWidth);

/// Builds the data of point indices; keeps its working memory, so a steady stream of clouds
/// allocates nothing. Not thread safe.
///
/// Points in any order are brought together by the cells of a coarse grid. Each cell, which fits
/// the first caches, is sliced across the longest side of its box, and the slices again, until
/// sixteen neighbours are a tile. A tile whose points are apart (split_rule.h) is split further, so
/// that no tile has a large box, but for tiles of distant cells. Consecutive tiles are grouped into
/// nodes.
class PointBvhBuilder {
 public:
  /// Builds over points in any order.
  /// @param X_FO    frame of the points -> fixed frame, rigid
  /// @param drop    may be empty. Called once for each tile, before boxes are made: to filter a
  /// tile
  ///                at a time is much cheaper than a point at a time.
  /// @param bvh     overwritten, its buffers reused
  void build(const Eigen::Isometry3d& X_FO, const CloudPoint* points, std::size_t n,
             const PointFilter& drop, PointBvh* bvh);

  /// Builds over the points in cells().
  /// @param may_drop    may be empty: a filter may drop any point
  /// @param is_distant  may be empty. Called once for the box of each cell: whether no query will
  ///                    look at its points soon, and `drop` would drop none of them. They are not
  ///                    sliced then, and not filtered: their tiles are as large as the cell, or as
  ///                    a part of it where there are many.
  void build_from_cells(const Eigen::Isometry3d& X_FO, const PointFilter& drop,
                        const BoxFilter& may_drop, const BoxFilter& is_distant, PointBvh* bvh);
  PointCells& cells() { return cells_; }

  /// Builds tile by tile, for callers that know which points are neighbours: start(), then
  /// next_tiles() and add_tile() for each tile, then finish(). The data must not be read before.
  void start(const Eigen::Isometry3d& X_FO, PointBvh* bvh);
  /// The next `count` tiles, for the caller to fill in: points, ids and count.
  PointTile* next_tiles(std::size_t count);
  /// Adds the first tile of next_tiles(), without the points that `drop` names.
  /// @param box   of exactly its points
  /// @param drop  may be empty
  void add_tile(const PaddedBox& box, const PointFilter& drop);
  /// Adds the first tiles of next_tiles(), whose unused slots are far away.
  /// @param boxes  of exactly the points of each tile, in order; others between them
  /// @param which  bit k: slot k of `boxes` belongs to a tile
  void add_loaded_tiles(const BoxNode& boxes, std::uint32_t which);
  /// Instead of start(), for an organized cloud: add_lazy_tile() adds tiles that are loaded when a
  /// query first looks at them.
  /// @param cloud  tiles are loaded at once where its bytes have no owner
  /// @param X_OS   sensor frame -> O
  void start_organized(const Eigen::Isometry3d& X_FO, const RawCloud& cloud,
                       const Eigen::Isometry3d& X_OS, PointBvh* bvh);
  /// Adds a tile of which all sixteen pixels are kept.
  /// @param box  holds its points
  /// @param first_pixel  its number in the message
  void add_lazy_tile(const PaddedBox& box, std::uint32_t first_pixel);
  /// Adds sixteen such tiles as a node of their own, for neighbours that are close together.
  /// @param boxes  hold the points of each tile
  /// @param first_pixels  of each tile
  void add_lazy_node(const BoxNode& boxes, const std::uint32_t* first_pixels);
  /// Ends a group: the tiles added since the last call are neighbours. They become a node of their
  /// own if they fill most of it and are close together; else finish() groups them with others.
  void end_group();
  void finish();

 private:
  struct Filters {
    const PointFilter& drop;
    const BoxFilter& may_drop;
  };
  /// Consecutive tiles.
  struct TileRun {
    std::size_t first, count;
  };

  void read_few_lazy_tiles();
  void append_lazy(const std::uint32_t* first_pixels, std::size_t count);
  void reserve();
  bool add_if_distant(const BoxFilter& is_distant);
  void add_distant_points(CloudPoint* points, CloudPoint* spare, std::size_t n);
  void add_unsliced(const CloudPoint* points, std::size_t n, const PaddedBox& box);
  void add_points(CloudPoint* points, CloudPoint* spare, std::size_t n, const Filters& filters);
  void slice_into_tiles(CloudPoint* points, CloudPoint* spare, std::size_t n);
  template <typename Visit>
  void for_each_slice(std::size_t n, std::size_t part, const Visit& visit) const;
  void add_batch(const Filters& filters);
  void add_clear_tiles(std::size_t begin, std::size_t end);
  void add_filtered_tiles(std::size_t begin, std::size_t end, const Filters& filters);
  static bool may_drop_any(const Filters& filters, const PaddedBox& box);
  void end_cell();

  PointCells cells_;
  PointSlicer slicer_;
  std::vector<CloudPoint> spare_;  ///< buffer for the points of the current cell
  TileBatch batch_;
  std::vector<PointTile> filtered_;        ///< copy of the batch, where points may be dropped
  std::vector<HierarchyChild> ungrouped_;  ///< tiles that are in no node yet
  std::size_t group_begin_ = 0;            ///< first of them since the last end_group()
  BoxHierarchy hierarchy_;
  PointBvh* bvh_ = nullptr;         ///< being built
  std::vector<TileRun> lazy_runs_;  ///< tiles that are not loaded
  std::size_t used_ = 0;            ///< complete tiles; later ones date from the last build
};

}  // namespace ist
