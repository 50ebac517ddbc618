#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/bvh/box_node.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// Solid boxes side by side for SIMD, in metres from the index's origin. Unused slots are far away.
struct alignas(64) BoxTile {
  float min_x[kBoxWidth], min_y[kBoxWidth], min_z[kBoxWidth];
  float max_x[kBoxWidth], max_y[kBoxWidth], max_z[kBoxWidth];
  std::uint32_t id[kBoxWidth];  ///< number of the box, as given to BoxIndex::build()
  std::int32_t count;           ///< used slots, at the front

  Eigen::AlignedBox3d box(int k) const {
    return {Eigen::Vector3d(min_x[k], min_y[k], min_z[k]),
            Eigen::Vector3d(max_x[k], max_y[k], max_z[k])};
  }
};

/// The data of a BoxIndex: tiles of up to sixteen neighbouring boxes and a bounding volume
/// hierarchy over them, with the interface of PointBvh. Immutable, thread safe.
class BoxBvh {
 public:
  BoxBvh() = default;
  explicit BoxBvh(const std::vector<Eigen::AlignedBox3d>& boxes);  ///< as BoxIndex::build()

  bool empty() const { return tiles_.empty(); }
  std::size_t size() const { return size_; }                    ///< boxes
  const Eigen::Vector3d& origin() const { return origin_; }     ///< [m] in M
  const std::vector<BoxNode>& nodes() const { return nodes_; }  ///< the root is nodes()[root()]
  std::int32_t root() const { return static_cast<std::int32_t>(nodes_.size()) - 1; }  ///< -1: empty
  const std::vector<BoxTile>& tiles() const { return tiles_; }
  using Tile = BoxTile;
  const BoxTile& tile(std::size_t i, BoxTile* /*scratch*/) const { return tiles_[i]; }
  const BoxTile* place_of_tile(std::size_t i) const { return &tiles_[i]; }
  std::uint64_t build_id() const { return build_id_; }  ///< 0 before the first build

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::vector<BoxNode> nodes_;  ///< level by level, the root last
  std::vector<BoxTile> tiles_;
  std::size_t size_ = 0;
  std::uint64_t build_id_ = 0;
};

}  // namespace ist
