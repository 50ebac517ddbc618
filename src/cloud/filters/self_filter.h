#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

#include "cloud/filters/sphere_verdict_kernel.h"
#include "internal/bvh/padded_box.h"
#include "internal/cloud/point_tile.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Separates the robot's own points from obstacles: a point is the robot's when its exact distance
/// to a link is at most the padding, or when it is inside the link.
///
/// The points of a box are first tested as one sphere: the trees' cover spheres prove that it is
/// clear of the links, an inner sphere proves that it is the robot's. So most tiles near the robot
/// are decided without a look at their points. Where both leave it open, the link's field of
/// distances decides most of a tile's points; the others are tested one by one, against the exact
/// geometry where spheres leave it open, too. Keeps its memory. Not thread safe.
class SelfFilter {
 public:
  /// One of the solids.
  struct Link {
    std::size_t number;  ///< in `solids`
    const InnerSphereTree* tree;
    const Solid* solid;
    const DistanceField* field;             ///< null: none
    Eigen::Isometry3d X_LO;                 ///< frame of the points -> link frame
    Eigen::Vector3f center_O;               ///< [m] of the link's bounding sphere
    double padding;                         ///< [m]
    float padded_radius;                    ///< [m] of the bounding sphere, and the clear distance
    float rounding;                         ///< [m] more than what float rounds off
    float clear_distance;                   ///< [m] a cover distance above it proves a point clear
    std::uint32_t first_point, last_point;  ///< ids of the points that the pose is for

    bool is_for_all_points() const {
      return first_point == 0 && last_point == std::numeric_limits<std::uint32_t>::max();
    }
  };

  /// @param solids   the robot's links, at one or several instants; viewed until the next call. A
  ///                 point is compared with those that it was measured at
  /// @param X_FO     frame of the points -> fixed frame
  /// @param padding  [m] >= 0
  /// @param own      [m] >= 0, by solid: in place of `padding`; empty: none
  void set_poses(Span<const PosedSolid> solids, const Eigen::Isometry3d& X_FO, double padding,
                 Span<const double> own = {});

  /// Whether a point is the robot's. @param p_O  [m]
  static bool is_on_link(const Link& link, const Eigen::Vector3d& p_O);
  const std::vector<Link>& links() const { return links_; }
  /// The links of the group that began last.
  const std::vector<const Link*>& group() const { return group_; }

  /// Begins a group of neighbouring boxes: finds the links that any of its points may be on.
  /// @param box  holds all boxes of the calls below until the next group
  /// @returns false: none of the points in this box is the robot's
  bool begin_group(const PaddedBox& box);

  using Verdict = SphereVerdict;
  /// Whether none or all points of a box in the group are the robot's, as far as spheres prove it.
  Verdict test(const PaddedBox& box);
  /// The links that points of the box tested last may be on. After kOnRobot: the last of them is
  /// the one that all points are on, and others may be missing.
  const std::vector<const Link*>& near_links() const { return undecided_; }

  /// Bit k: the point in slot k is the robot's.
  /// @param box  of the tile's points, in the group
  std::uint32_t points_on_robot(const PointTile& tile, const PaddedBox& box);
  /// The same for a box that test() has left undecided just now.
  std::uint32_t undecided_points_on_robot(const PointTile& tile) const;

 private:
  static bool may_touch(const Link& link, const Eigen::Vector3f& center_O, float radius);
  enum class Effort { kProveClear, kDecide };
  static Verdict test_spheres(Effort effort, const Link& link, const Eigen::Vector3d& center_L,
                              double radius);
  static bool test_geometry(const Link& link, const Eigen::Vector3d& p_L);
  static std::uint32_t points_on_link(const Link& link, const PointTile& tile,
                                      std::uint32_t measured);
  Verdict test(const PaddedBox& box, std::uint32_t first, std::uint32_t last);

  std::vector<Link> links_;
  std::vector<const Link*> group_;      ///< links that points of the group may be on
  std::vector<const Link*> undecided_;  ///< the same of the box that was tested last
};

}  // namespace ist
