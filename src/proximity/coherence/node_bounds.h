#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/bvh/box_node.h"
#include "proximity/coherence/displacement.h"

namespace ist {

/// Bounds of the points below each child of a BVH node, or of each point of a tile, for a whole
/// link. Every such point has one of two properties:
///  - its signed distance is at least `floor`, in the sense of PointDepth::floor;
///  - it is outside the link, and so is every place that is nearer to it than `outside` > 0.
/// The bound is inf where no point has the one or the other property. Closed links need the first
/// only. -inf: nothing is known.
struct ChildBounds {
  std::array<double, kBoxWidth> floor, outside;  ///< [m]

  ChildBounds() { set_all(-std::numeric_limits<double>::infinity()); }
  void set_all(double floor_bound, double outside_bound = std::numeric_limits<double>::infinity()) {
    floor.fill(floor_bound);
    outside.fill(outside_bound);
  }
};

/// ChildBounds of the nodes and tiles that the last single-tree traversals of a link met, kept for
/// the poses to come (the invariant is in displacement.h). They are stored as of the first pose, as
/// BvttFront does it: the displacement since then is added when they are stored, and subtracted
/// when they are read.
///
/// A direct-mapped table of fixed size. Neighbouring nodes, and neighbouring tiles, have places of
/// their own. One thread.
class NodeBounds {
 public:
  explicit NodeBounds(const LinkModel& link);

  /// Sets the index and the pose of what is loaded and stored from now on.
  /// @param build_id  of the index, not 0
  /// @param X_OL      link -> the index's frame
  void begin(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
             const DisplacementBound& displacement);
  /// [m] How far the link has moved since the last begin() with the same index; inf: unknown.
  double last_step() const { return last_step_; }
  /// @param child  of the BVH: node, or tile if negative
  /// @returns false: nothing is known; `bounds` is unchanged
  bool load(std::int32_t child, ChildBounds* bounds) const;
  void store(std::int32_t child, const ChildBounds& bounds);
  void forget();
  std::size_t memory() const {  ///< [bytes]
    return keys_.capacity() * sizeof(Key) +
           (floors_.capacity() + outsides_.capacity()) * sizeof(Row);
  }

 private:
  static constexpr std::size_t kNodes = 2048, kTiles = 256, kIndices = 4;
  struct Key {
    std::uint64_t index = 0;  ///< Index::id; 0: none
    std::int32_t child = 0;
  };
  struct Index {
    std::uint64_t build_id = 0;
    std::uint64_t id = 0;  ///< a new one where older bounds are discarded
    Eigen::Isometry3d X_OL = Eigen::Isometry3d::Identity();
    double displacement = 0.0;  ///< [m] since the first pose
    std::uint64_t last_used = 0;
  };
  using Row = std::array<float, kBoxWidth>;

  std::size_t slot(std::int32_t child) const;
  void start(Index* index);

  std::vector<Key> keys_;
  std::vector<Row> floors_, outsides_;  // [m] the latter of meshes with holes only
  std::array<Index, kIndices> indices_;
  std::size_t now_ = 0;  // in indices_
  std::uint64_t last_id_ = 0, uses_ = 0;
  double last_step_ = std::numeric_limits<double>::infinity();
};

}  // namespace ist
