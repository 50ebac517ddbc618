#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/cancelled.h"
#include "internal/geometry/convex_part.h"
#include "internal/geometry/hull_coreset.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// Bounding volume hierarchy of oriented boxes (Gottschalk, Lin and Manocha 1996) over the convex
/// parts of a link, in the link's frame L: the triangles of its meshes and boxes, its spheres and
/// its cylinders. Two of them find the closest points of two links. Immutable; const members are
/// thread safe and allocate nothing.
class SurfaceBvh {
 public:
  static constexpr int kWidth = 8;

  /// The oriented boxes of up to eight children, side by side for SIMD. A point x of a child has
  /// |axis_i.(x - center)| <= half_i, but for the rounding of float. Unused slots repeat the first.
  struct alignas(32) Node {
    float center[3][kWidth];     ///< [m] in L
    float axis[3][3][kWidth];    ///< axis[i][k]: component k of unit vector i, in L
    float half[3][kWidth];       ///< [m]
    float radius[kWidth];        ///< [m] half the box's diagonal
    std::int32_t child[kWidth];  ///< >= 0: node; < 0: part ~child
    std::int32_t count;          ///< used slots, at the front
  };

  /// A child by its place: kWidth * node + slot.
  using Slot = std::uint32_t;
  static constexpr Slot kRoot = 0;  ///< the only slot of node 0 holds everything

  SurfaceBvh() = default;
  /// @throws Cancelled when the request says so
  explicit SurfaceBvh(const Solid& solid, const CancelRequest& cancelled = {});
  /// Over any parts, in their order of numbers.
  explicit SurfaceBvh(std::vector<ConvexPart> parts, const CancelRequest& cancelled = {});

  bool empty() const { return parts_.empty(); }
  const Node& node(std::int32_t index) const { return nodes_[static_cast<std::size_t>(index)]; }
  const Node& node_of(Slot slot) const { return nodes_[slot / kWidth]; }
  std::int32_t child(Slot slot) const { return node_of(slot).child[slot % kWidth]; }
  double radius(Slot slot) const { return node_of(slot).radius[slot % kWidth]; }
  const std::vector<ConvexPart>& parts() const { return parts_; }
  /// The part of a slot that holds a single one.
  const ConvexPart& part(Slot slot) const { return parts_[static_cast<std::size_t>(~child(slot))]; }
  /// [m] No point of a part is farther from L's origin.
  double extent() const { return extent_; }
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }  ///< of all parts, in L
  /// [m] The support function: the largest n.x of all points, in double. @param n_L  unit
  double support(const Eigen::Vector3d& n_L) const;
  /// The hull of the surface of a solid; empty where parts were given.
  const HullCoreset& hull() const { return hull_; }
  /// The hull of what is below a slot, for the first levels of a solid's nodes; null elsewhere.
  const HullCoreset* hull_of(Slot slot) const {
    return slot < hull_of_.size() && hull_of_[slot] >= 0
               ? &hulls_[static_cast<std::size_t>(hull_of_[slot])]
               : nullptr;
  }
  /// A part that is near a point: the nearest one, or the first that is no farther than `enough`
  /// [m]. There must be any. @param p_L  [m] in L
  Slot nearest_part(const Eigen::Vector3d& p_L, double enough) const;

  /// Levels of nodes, at most: the root's, and one for each division of 2^32 parts by eight.
  static constexpr std::size_t kMaxLevels = 12;

 private:
  using Range = std::pair<std::uint32_t, std::uint32_t>;
  void build(const CancelRequest& cancelled);
  std::int32_t add_node(const Range& range, int depth, const CancelRequest& cancelled);
  void add_hull(const Range& range, Slot slot, const CancelRequest& cancelled);
  void set_box(const Range& range, Node* node, int slot) const;

  std::vector<Node> nodes_;
  std::vector<ConvexPart> parts_;
  HullCoreset hull_;
  bool has_hulls_ = false;             // of the first levels
  std::vector<HullCoreset> hulls_;     // of these
  std::vector<std::int32_t> hull_of_;  // by slot, as far as there are hulls; below 0: none
  Eigen::AlignedBox3d bounds_;
  double extent_ = 0.0;
};

/// An oriented box and a direction, in the frame of the nodes that it is compared with.
struct OrientedBox {
  float center[3];     ///< [m]
  float axis[3][3];    ///< axis[i][k]: component k of unit vector i
  float half[3];       ///< [m]
  float direction[3];  ///< unit, from this box to the node's boxes; zero: none
};

/// Lower bounds [m] of the distances from a box to the children of a node: to the box about it that
/// is aligned with the child, to the box about the child that is aligned with it, and along the
/// direction. Negative where none of these separates them. The error is below 2e-6 of the sum of
/// all coordinates and sizes involved.
void oriented_box_bounds(const SurfaceBvh::Node& node, const OrientedBox& box,
                         float bounds[SurfaceBvh::kWidth]);

/// Upper bounds [m] of the supports n.x of a node's children; the error is that of float.
void oriented_box_supports(const SurfaceBvh::Node& node, const float n[3],
                           float supports[SurfaceBvh::kWidth]);

}  // namespace ist
