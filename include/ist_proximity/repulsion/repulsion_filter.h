#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

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
/// distance the length fades, whatever the filter holds. One thread.
class RepulsionFilter {
 public:
  /// @param time       [s] of the poses; an earlier one than before starts anew
  /// @param obstacles  another number whenever the obstacles are others: see obstacles_key
  /// @param raw        the wrench without a filter; NaN starts anew
  /// @param proximity  the link's answer that `raw` belongs to
  /// @param config     filter_time, gain and influence_distance are read
  RepulsiveWrench update(double time, std::uint64_t obstacles, const RepulsiveWrench& raw,
                         const LinkProximity& proximity, const RepulsionConfig& config);

  /// The next update() is the first.
  void reset() { *this = RepulsionFilter(); }

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  void decay(double seconds, double lag);

  bool started_ = false;
  double time_ = 0.0;  ///< [s]
  std::uint64_t obstacles_ = 0;
  Vector6 raw_ = Vector6::Zero();     ///< at the last update
  Vector6 offset_ = Vector6::Zero();  ///< added to it
  Vector6 speed_ = Vector6::Zero();   ///< [1/s] of the offset
};

/// A key of a set of clouds: the same only for the same snapshots, in the same order.
std::uint64_t obstacles_key(SnapshotSpan clouds);

}  // namespace ist
