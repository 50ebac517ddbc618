#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "cloud/filters/self_filter.h"
#include "internal/bvh/padded_box.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// The part of a cloud that queries look at soon: about each link, as far as an obstacle is known
/// to be or queries reach, and what the link may move until the next cloud comes. Points outside
/// need no index that is quick to search. How far the region reaches changes the cost of a query
/// and never its answer; it always holds all points of the robot. Keeps its memory. Not thread
/// safe.
class NearRegion {
 public:
  /// Begins a cloud.
  /// @param links            as SelfFilter has them, in the frame O of the points; viewed until
  ///                         finish()
  /// @param search_distance  [m] queries look no farther from a link than this
  /// @param stamp            [s] of the cloud. The time since the last one tells what a link may
  ///                         move until the next one comes.
  void start(const std::vector<SelfFilter::Link>& links, double search_distance, double stamp);
  /// Adds a point of the cloud: some are enough, spread over all of it. Those that may be the
  /// robot's tell nothing of its obstacles. @param p_O  [m]
  void add(const Eigen::Vector3f& p_O);
  /// Ends the points. Without an obstacle among them, the region holds everything.
  void finish();

  /// Whether a box lies outside the region, after finish(). No point in such a box is the robot's.
  bool is_outside(const PaddedBox& box) const;

 private:
  using Spheres = Eigen::Array<float, kSphereWidth, 1>;
  /// The bounding spheres of the root's children, which hold the link.
  struct Link {
    const SelfFilter::Link* link;
    Spheres x, y, z, radius;  ///< [m] in O
    Spheres reach_sq;         ///< [m^2] of the region around each centre; -1: unused slot
    float to_spheres;         ///< [m] from the spheres to the point added last
    float nearest;            ///< [m] from the spheres to the nearest obstacle
    Eigen::Vector3f p_O;      ///< [m] that obstacle
  };

  static float distance_of_nearest(const Link& link);

  std::vector<Link> links_;
  float search_distance_ = 0.0F;                            ///< [m]
  float motion_ = 0.0F;                                     ///< [m] of a link until the next cloud
  double stamp_ = std::numeric_limits<double>::infinity();  ///< [s] of the last cloud
};

}  // namespace ist
