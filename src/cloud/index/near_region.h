#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "cloud/filters/self_filter.h"
#include "internal/bvh/padded_box.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// The part of a cloud that queries look at soon: around each link as far as the point nearest to
/// it, or kFarthest where that is less, and what the link may move until the next cloud comes.
/// Points outside of it need no index that is quick to search. The region is a guess, which changes
/// the cost of a query and never its answer. Keeps its memory. Not thread safe.
class NearRegion {
 public:
  /// [m] Points that are farther away are of no interest to most queries.
  static constexpr float kFarthest = 1.0F;

  /// Begins a cloud.
  /// @param links  as SelfFilter has them, in the frame O of the points
  /// @param stamp  [s] of the cloud. The time since the last one tells what a link may move until
  ///               the next one comes.
  void start(const std::vector<SelfFilter::Link>& links, double stamp);
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
    Spheres x, y, z, radius;  ///< [m] in O
    Spheres reach_sq;         ///< [m^2] of the region around each centre; -1: unused slot
    float clear_distance;     ///< [m] points farther than this from the spheres are not the robot's
    float here;               ///< [m] from the spheres to the point added last
    float nearest;            ///< [m] from the spheres to the nearest obstacle
  };

  std::vector<Link> links_;
  double stamp_ = std::numeric_limits<double>::infinity();  ///< [s] of the last cloud
  float motion_ = 0.0F;                                     ///< [m] of a link until the next one
};

}  // namespace ist
