#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/tree/tree_config.h"

namespace ist {

/// Children of an inner node, or spheres of a leaf, side by side for SIMD.
constexpr int kSphereWidth = 8;
/// No tree is deeper, for up to 2^31 spheres: what descends needs a stack of no more than
/// kSphereWidth * kMaxTreeLevels entries.
constexpr int kMaxTreeLevels = 16;

/// An inner node of the tree: the bounding spheres of its children. Unused slots have a radius so
/// negative that they are farther than anything.
struct alignas(32) SphereNode {
  float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];  ///< [m] centres, link frame
  float radius[kSphereWidth];     ///< [m] encloses all cover spheres below (wrapped hierarchy)
  float max_inner[kSphereWidth];  ///< [m] largest inner radius below: no sphere is entered deeper
  std::int32_t child[kSphereWidth];  ///< >= 0: inner node; < 0: leaf ~child
  std::int32_t count;                ///< used slots
};

/// A leaf: up to eight spheres.
struct alignas(32) SphereLeaf {
  float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];  ///< [m] centres, link frame
  float inner_radius[kSphereWidth];                         ///< [m] inner radius, rounded down
  float cover_radius[kSphereWidth];                         ///< [m] cover radius, rounded up
  std::int32_t count;                                       ///< used slots
};

/// The Inner Sphere Tree of one link: flat, wide, float, in the link's frame.
///
/// A wrapped hierarchy (Weller 2013, section 5.2): the sphere of a node encloses the cover spheres
/// of all its leaves, not its child spheres. Deterministic. Radii are rounded so that bounds
/// survive float: the cover spheres cover what the double spheres covered. Immutable, thread safe.
class InnerSphereTree {
 public:
  InnerSphereTree() = default;
  explicit InnerSphereTree(const Packing& packing, const TreeConfig& config = {});

  bool empty() const { return leaves_.empty(); }
  const std::vector<SphereNode>& nodes() const { return nodes_; }  ///< nodes()[0] is the root
  const std::vector<SphereLeaf>& leaves() const { return leaves_; }

  const Eigen::Vector3d& center() const { return center_; }  ///< [m] root sphere, link frame
  double radius() const { return radius_; }                  ///< [m] of the root sphere
  std::size_t sphere_count() const { return sphere_count_; }
  /// [m] no interior point is farther than this from the cover spheres.
  double interior_gap() const { return interior_gap_; }

  /// min over spheres of |p - c| - radius [m]; the brute-force meaning of the inner distance.
  double inner_distance(const Eigen::Vector3d& p_L) const;
  /// min over spheres of |p - c| - cover_radius [m], rounded down: a lower bound of the distance
  /// from an outside p_L to the solid. A value above interior_gap() proves that p_L is outside.
  /// Stops early, with any value below `stop_below`, once it cannot exceed that.
  double cover_distance(const Eigen::Vector3d& p_L, double stop_below = -1e30) const;
  /// cover_distance(p_L) > distance, found sooner.
  bool cover_distance_exceeds(const Eigen::Vector3d& p_L, double distance) const;

 private:
  std::vector<SphereNode> nodes_;
  std::vector<SphereLeaf> leaves_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double radius_ = 0.0;
  double interior_gap_ = 0.0;
  std::size_t sphere_count_ = 0;
};

}  // namespace ist
