#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/point_index.h"

namespace ist {

/// Solid boxes side by side for SIMD, in metres from the index's origin. Unused slots are far away,
/// as in PointTile.
struct alignas(64) BoxTile {
  float min_x[kPointWidth], min_y[kPointWidth], min_z[kPointWidth];
  float max_x[kPointWidth], max_y[kPointWidth], max_z[kPointWidth];
  std::uint32_t id[kPointWidth];  ///< number of the box, as given to build()
  std::int32_t count;             ///< used slots, at the front

  Eigen::AlignedBox3d box(int k) const {
    return {Eigen::Vector3d(min_x[k], min_y[k], min_z[k]),
            Eigen::Vector3d(max_x[k], max_y[k], max_z[k])};
  }
};

/// An immutable hierarchy over solid boxes of any sizes, axis-aligned in a frame M of their own (a
/// map's): tiles of up to 16 neighbours, 16-wide nodes above, as PointIndex. Boxes may overlap or
/// touch. Coordinates are relative to `origin`, the middle of all boxes on whole metres, so that
/// float loses no more than 1e-7 of the way from there. Thread safe.
class BoxIndex {
 public:
  /// @param boxes  [m] in M, finite, none empty (an edge may be 0), below kFarAway
  void build(const std::vector<Eigen::AlignedBox3d>& boxes);

  bool empty() const { return tiles_.empty(); }
  std::size_t size() const { return size_; }                    ///< boxes
  const Eigen::Vector3d& origin() const { return origin_; }     ///< [m] in M
  const std::vector<BoxNode>& nodes() const { return nodes_; }  ///< the root is nodes()[root()]
  std::int32_t root() const { return static_cast<std::int32_t>(nodes_.size()) - 1; }  ///< -1: empty
  const std::vector<BoxTile>& tiles() const { return tiles_; }
  /// As PointIndex::tile().
  using Tile = BoxTile;
  const BoxTile& tile(std::size_t i, BoxTile* /*room*/) const { return tiles_[i]; }
  /// As PointIndex::build_id(), and different from that of any PointIndex.
  std::uint64_t build_id() const { return build_id_; }

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::vector<BoxNode> nodes_;  ///< level by level, the root last
  std::vector<BoxTile> tiles_;
  std::size_t size_ = 0;
  std::uint64_t build_id_ = 0;  ///< never 0 once built
};

}  // namespace ist
