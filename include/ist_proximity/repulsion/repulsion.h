#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/packing/packing.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The repulsion vector of a link.
struct RepulsionConfig {
  /// [m] > 0: at and beyond it the vector is zero. Not more than the query's max_distance: what is
  /// CLEAR repels nothing.
  double influence_distance = 0.3;
  double gain = 1.0;  ///< length of the vector at touch and in contact; >= 0
  /// [m] > 0: pairs this much farther than the nearest still count. Less than 1 mm is as 1 mm.
  double smoothing = 0.1;
  /// [s] >= 0: mean delay of what a new cloud changes, see RepulsionFilter; 0: no filter.
  double filter_time = 0.05;
};

/// What pushes a link away from obstacles, in the fixed frame. NaN where it is not known.
struct Push {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< unit of the gain
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< [that unit * m] about the link's origin

  static Push unknown();
};

constexpr int kSphereGroupWidth = 16;

/// Spheres side by side for SIMD, in metres in the link's frame. Unused slots are far away.
struct alignas(64) SphereGroup {
  float x[kSphereGroupWidth], y[kSphereGroupWidth], z[kSphereGroupWidth], radius[kSphereGroupWidth];
  float center[3], reach;  ///< a sphere around all of them
};

/// Blended repulsion, continuous in the robot's motion.
///
/// A link is a fixed, coarse set of its inner spheres, an obstacle the thinned points; of a map,
/// each box's point that is nearest to the sphere, so that a large leaf counts once. With d the
/// distance of a pair (negative for a point in a sphere) and n its unit vector from point to sphere
/// centre,
///   u = sum(a w n) / sum(a w),  w = max(0, 1 - (d - d_min) / smoothing)^2,
/// over all pairs: the nearest pair alone would jump when two obstacles are equally near. a is how
/// much of its cell a surface through the thinned point covers, about (1 - rho^2)^2 with rho = 0 in
/// the cell's middle and 1 in a corner: cells that a surface hardly cuts, which more points would
/// find and fewer would not, count little. It depends on the cloud alone. The
/// vector is gain * s * u with s = 1 - distance / influence_distance, not below 0 and not above 1:
/// its length is 0 at and beyond the influence distance and never more than the gain. In contact it
/// stays at the gain (how deep is for the penetration wrench to say), and in a symmetric squeeze
/// the terms cancel.
///
/// The torque is that of the same terms, each with its own witness on the link: the terms of a
/// sphere act along lines through its centre, so no other witness than the centre is needed. With J
/// the Jacobian of the link's origin, J^T (force; torque) is the sum of every term through the
/// Jacobian at its own witness: as continuous as the force, which the nearest pair's witness is
/// not.
///
/// A point at a sphere's very centre has no direction, nor has a box that holds the centre; it
/// takes the link's `direction`.
class Repulsion {
 public:
  /// Chooses the spheres; the model is not needed afterwards.
  explicit Repulsion(const std::shared_ptr<const RobotModel>& model);

  /// @param link      index in the model
  /// @param X_FL      link frame -> fixed frame, rigid
  /// @param clouds    as given to ProximityQuery::run
  /// @param proximity the link's answer: supplies state, distance, direction and witness
  /// @returns zero when CLEAR, NaN when UNKNOWN
  /// Allocates nothing. Thread safe.
  Push push(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
            const LinkProximity& proximity, const RepulsionConfig& config) const;

  /// The force alone.
  Eigen::Vector3d operator()(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                             const LinkProximity& proximity, const RepulsionConfig& config) const {
    return push(link, X_FL, clouds, proximity, config).force;
  }

 private:
  std::vector<std::vector<SphereGroup>> groups_;  ///< by link, of at most kCoarseSpheres spheres
};

/// 1 - distance / influence_distance, from 0 to 1: 0 when CLEAR or UNKNOWN, 1 in contact.
double repulsion_strength(const LinkProximity& proximity, const RepulsionConfig& config);

/// Spheres that stand for a link: whole groups.
constexpr std::size_t kCoarseSpheres = 48;

/// The first `count` spheres of those that stand for a link best: starting with the largest, the
/// sphere that reaches farthest beyond the chosen ones is next. Unlike the first spheres of the
/// packing, which may be those of the link's first element, they are spread over the whole link.
std::vector<InnerSphere> coarse_spheres(const Packing& packing, std::size_t count);

/// The same spheres in groups of neighbours.
std::vector<SphereGroup> group_spheres(std::vector<InnerSphere> spheres);

}  // namespace ist
