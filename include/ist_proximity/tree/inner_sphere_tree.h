#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

class DistanceField;

/// Children of an inner node, or spheres of a leaf, side by side for SIMD.
constexpr int kSphereWidth = 8;
/// Levels of a tree of up to 2^31 spheres, at most, leaves included.
constexpr int kMaxTreeLevels = 16;

/// An inner node of the tree: the bounding spheres of its children. Unused slots have so negative a
/// radius that they are farther than anything.
struct alignas(32) SphereNode {
  float x[kSphereWidth];             ///< [m] centres, link frame
  float y[kSphereWidth];             ///< [m] centres, link frame
  float z[kSphereWidth];             ///< [m] centres, link frame
  float radius[kSphereWidth];        ///< [m] encloses all cover spheres below (wrapped hierarchy)
  float max_inner[kSphereWidth];     ///< [m] largest inner radius below: bounds penetration depths
  std::int32_t child[kSphereWidth];  ///< >= 0: inner node; < 0: leaf ~child
  std::int32_t count;                ///< used slots
};

/// A leaf: up to eight spheres.
struct alignas(32) SphereLeaf {
  float x[kSphereWidth];             ///< [m] centres, link frame
  float y[kSphereWidth];             ///< [m] centres, link frame
  float z[kSphereWidth];             ///< [m] centres, link frame
  float inner_radius[kSphereWidth];  ///< [m] inner radius, rounded down
  float cover_radius[kSphereWidth];  ///< [m] cover radius, rounded up
  std::int32_t count;                ///< used slots
};

/// The Inner Sphere Tree (IST) of one link: a flat array of wide nodes, in float, in the link's
/// frame.
///
/// It is a wrapped hierarchy (Weller 2013, section 5.2): the bounding sphere of a node encloses the
/// cover spheres of all leaves below it, not the bounding spheres of its children. The construction
/// is deterministic. Radii are rounded so that bounds hold in float: a cover sphere holds the cover
/// sphere that it was made from, an inner sphere lies inside its own. Immutable, thread safe.
class InnerSphereTree {
 public:
  InnerSphereTree() = default;
  /// Builds the tree over the spheres of a packing.
  explicit InnerSphereTree(const Packing& packing);

  bool empty() const { return leaves_.empty(); }                     ///< whether it has no spheres
  const std::vector<SphereNode>& nodes() const { return nodes_; }    ///< nodes()[0] is the root
  const std::vector<SphereLeaf>& leaves() const { return leaves_; }  ///< named by SphereNode::child

  const Eigen::Vector3d& center() const { return center_; }   ///< [m] root sphere, link frame
  double radius() const { return radius_; }                   ///< [m] of the root sphere
  std::size_t sphere_count() const { return sphere_count_; }  ///< spheres in all leaves
  /// [m] No point inside the link is farther than this from the cover spheres.
  double interior_gap() const { return interior_gap_; }

  /// Minimum over the spheres of |p - center| - inner radius [m], by brute force: the definition of
  /// the distance to the inner spheres.
  double inner_distance(const Eigen::Vector3d& p_L) const;
  /// Minimum over the spheres of |p - center| - cover radius [m], rounded down: a lower bound of
  /// the distance of a point outside to the solid. A value above interior_gap() proves that p_L is
  /// outside.
  /// @param p_L         [m] link frame
  /// @param stop_below  [m] the search ends, with any value below this, once the minimum is smaller
  /// @param coarse      [m] bounding spheres up to this radius stand for the spheres in them
  double cover_distance(const Eigen::Vector3d& p_L, double stop_below = -1e30,
                        double coarse = 0.0) const;
  /// cover_distance(p_L) > distance [m], found sooner.
  bool cover_distance_exceeds(const Eigen::Vector3d& p_L, double distance) const;

 private:
  double rounding(const Eigen::Vector3d& p_L) const;

  std::vector<SphereNode> nodes_;
  std::vector<SphereLeaf> leaves_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double radius_ = 0.0;
  double interior_gap_ = 0.0;
  std::size_t sphere_count_ = 0;
};

/// One link's geometry at a pose, for whatever needs to know where a robot is but not what a robot
/// is. The same link at several instants is as many of them, each for the points that were measured
/// about that instant.
struct PosedSolid {
  const InnerSphereTree* tree = nullptr;  ///< in the link frame L; not owned, not null
  const Solid* solid = nullptr;           ///< exact geometry in L; not owned, not null
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();  ///< link frame -> fixed frame, rigid
  /// The first point of the message, by its number in it, that was measured while the link was
  /// there.
  std::uint32_t first_point = 0;
  std::uint32_t last_point = std::numeric_limits<std::uint32_t>::max();  ///< the last such point
  const DistanceField* field = nullptr;  ///< distances about `solid`; not owned; null: none
};

}  // namespace ist
