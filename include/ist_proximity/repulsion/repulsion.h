#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// [m] A smaller smoothing counts as this: it would be lost in the rounding of float coordinates
/// far from the origin.
constexpr double kLeastSmoothing = 1e-3;

/// The repulsion vector of a link.
struct RepulsionConfig {
  /// [m] > 0: from this distance on the vector is zero. Not more than the query's max_distance: a
  /// link that is CLEAR is not repelled.
  double influence_distance = 0.3;
  double gain = 1.0;  ///< length of the vector at touch and in contact; >= 0
  /// [m] > 0: pairs this much farther than the nearest still count. Values below 1 mm count as
  /// 1 mm.
  double smoothing = 0.1;
  /// [s] >= 0: mean delay of the change that a new cloud brings, see RepulsionFilter; 0: no filter.
  double filter_time = 0.05;
};

/// The repulsive wrench on a link, which pushes it away from obstacles; in the fixed frame, about
/// the link's origin. NaN where it is not known.
struct RepulsiveWrench {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< unit of the gain
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();  ///< [that unit * m]

  static RepulsiveWrench unknown();  ///< NaN
};

class BlendExpansion;

/// Blended repulsion, continuous in the robot's motion.
///
/// A fixed, coarse set of its inner spheres stands for a link, and the thinned points for a cloud;
/// each box of a map stands for its point that is nearest to the sphere, so that a large leaf
/// counts once. With d the distance of a pair (negative for a point in a sphere) and n its unit
/// vector from point to sphere centre,
///   u = sum(a w n) / sum(a w),  w = max(0, 1 - (d - d_min) / smoothing)^2,
/// over all pairs: the nearest pair alone would jump when two obstacles are equally near. a is the
/// part of its cell that a surface through the thinned point covers, about (1 - rho^2)^2 with
/// rho = 0 in the cell's middle and 1 in a corner: cells that a surface hardly cuts, which more
/// points would find and fewer would not, count little. It depends on the cloud alone. The
/// vector is gain * s * u with s = 1 - distance / influence_distance, not below 0 and not above 1:
/// its length is 0 from the influence distance on and never more than the gain. In contact it
/// stays at the gain (the penetration wrench grows with the depth), and in a symmetric squeeze the
/// terms cancel.
///
/// The torque is that of the same terms, each acting at its own witness on the link: the terms of a
/// sphere act along lines through its centre, so the centre serves as the witness. With J the
/// Jacobian of the link's origin, J^T (force; torque) is the sum of every term through the Jacobian
/// at its own witness: as continuous as the force, which the nearest pair's witness is not.
///
/// A point at a sphere's very centre has no direction, nor has a box that contains the centre; the
/// link's `direction` takes its place.
class Repulsion {
 public:
  /// Chooses the spheres; the model is not needed afterwards.
  explicit Repulsion(const std::shared_ptr<const RobotModel>& model);

  /// @param link      index in the model
  /// @param X_FL      link frame -> fixed frame, rigid
  /// @param clouds    as given to ProximityQuery::run
  /// @param proximity the link's answer: supplies state, distance, direction and witness
  /// @param end       when the blend has to end, if it has not yet
  /// @returns zero when CLEAR, NaN when UNKNOWN, and NaN when it was not computed by `end`
  /// Allocates nothing. Thread safe.
  RepulsiveWrench wrench(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                         const LinkProximity& proximity, const RepulsionConfig& config,
                         TimePoint end = TimePoint::max()) const;

  /// The force alone.
  Eigen::Vector3d operator()(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                             const LinkProximity& proximity, const RepulsionConfig& config) const {
    return wrench(link, X_FL, clouds, proximity, config).force;
  }

 private:
  friend class KeptRepulsion;
  struct Spheres;

  /// The wrench as wrench() has it, and how it changes with the pose.
  /// @param expansion  may be null; overwritten, and empty where nothing was blended
  RepulsiveWrench blend(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                        const LinkProximity& proximity, const RepulsionConfig& config,
                        TimePoint end, BlendExpansion* expansion) const;

  std::shared_ptr<const Spheres> spheres_;  ///< of all links; copies share them
};

/// The repulsive wrench of the answer's own pair of closest points alone: of the same length as the
/// blended one, but not continuous. Zero when CLEAR, NaN when UNKNOWN.
RepulsiveWrench nearest_repulsion(const Eigen::Isometry3d& X_FL, const LinkProximity& proximity,
                                  const RepulsionConfig& config);

/// 1 - distance / influence_distance, from 0 to 1: 0 when CLEAR or UNKNOWN, 1 in contact.
double repulsion_strength(const LinkProximity& proximity, const RepulsionConfig& config);

/// Removes the jump from one link's repulsion when a new cloud replaces the old one.
///
/// While the cloud is the same, changes that come from the robot's motion pass at once. The change
/// that a new cloud brings is spread over time: the filter adds an offset to the wrench that starts
/// at minus the jump and falls to zero as a critically damped second-order lag does,
///   (1 + t / T) exp(-t / T),  T = filter_time / 2.
/// A change is thus delayed by filter_time in the mean, has come by 59 % after one filter_time and
/// by 99 % after 3.3, never overshoots, and within dt no more than 0.74 dt / filter_time of it
/// comes. In the cycle in which the cloud changes, and only there, the robot's own motion is
/// delayed in the same way, because the two changes cannot be separated.
///
/// The filter applies to repulsion alone: distances and bounds are never delayed. An obstacle that
/// appears next to a link is in `distance` at once, and in the repulsion gradually. An obstacle
/// that moves out of the influence distance stops repelling at once: over the last tenth of that
/// distance the length fades, whatever the filter holds.
///
/// A wrench that is late (a deadline passed before the blend) is the last one that was not, turned
/// with the link and as long as the distance of now says; where there is none, or it was zero, that
/// of the nearest point is held instead. Obstacles may have moved meanwhile, so it is let go after
/// kHoldTime, and not known (NaN) until a blend is in time. One thread.
class RepulsionFilter {
 public:
  /// [s] A late wrench is held for so long at most; about what an arm at 1 m/s needs to come from
  /// the default influence distance to an obstacle.
  static constexpr double kHoldTime = 0.2;

  /// @param time       [s] of the poses; an earlier one than before starts anew
  /// @param obstacles  another number whenever the obstacles are others: see obstacles_key
  /// @param raw        the wrench without a filter; NaN is late where the link is not UNKNOWN, else
  ///                   it starts anew
  /// @param proximity  the link's answer that `raw` belongs to
  /// @param config     filter_time, gain and influence_distance are read
  /// @param X_FL       link frame -> fixed frame
  RepulsiveWrench update(double time, std::uint64_t obstacles, const RepulsiveWrench& raw,
                         const LinkProximity& proximity, const RepulsionConfig& config,
                         const Eigen::Isometry3d& X_FL = Eigen::Isometry3d::Identity());

  /// The change at the next update() is spread like that of a new cloud, because the link's spheres
  /// are others.
  void expect_jump() { obstacles_ = ~obstacles_; }

  /// The next update() is the first.
  void reset() { *this = RepulsionFilter(); }

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  void decay(double seconds, double lag);
  Vector6 held(double time, double length, const Eigen::Isometry3d& X_FL,
               const LinkProximity& proximity, const RepulsionConfig& config);
  void hold(double time, double length, const Eigen::Isometry3d& X_FL, const Vector6& wrench);

  bool started_ = false;
  bool is_late_ = false;      ///< the last update was
  bool is_let_go_ = false;    ///< what was held is too old
  double hold_begin_ = 0.0;   ///< [s] of the last update that was not late
  Vector6 held_per_length_ =  ///< the wrench of that update, in the link's frame; NaN: none
      Vector6::Constant(std::numeric_limits<double>::quiet_NaN());
  double time_ = 0.0;  ///< [s]
  std::uint64_t obstacles_ = 0;
  Vector6 raw_ = Vector6::Zero();     ///< at the last update
  Vector6 offset_ = Vector6::Zero();  ///< added to it
  Vector6 speed_ = Vector6::Zero();   ///< [1/s] of the offset
};

/// A key of a set of clouds: the same only for the same snapshots, in the same order.
std::uint64_t obstacles_key(SnapshotSpan clouds);

}  // namespace ist
