#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// Takes the jump out of one link's repulsion when a new cloud replaces the old one.
///
/// While the cloud is the same, what the robot's motion changes passes at once. What a new cloud
/// changes is taken back at first and given back smoothly: added to the push is an offset that
/// starts at the jump and falls to zero as a critically damped second-order lag does,
///   (1 + t / T) exp(-t / T),  T = filter_time / 2.
/// A change is thus delayed by filter_time in the mean, has come by 59 % after one filter_time and
/// by 99 % after 3.3, never overshoots, and within dt no more than 0.74 dt / filter_time of it
/// comes. Of the cycle in which the cloud changes, and of that one alone, the robot's own motion is
/// delayed in the same way: the two cannot be told apart there.
///
/// The filter sees repulsion alone: distances and bounds are never delayed. An obstacle that
/// appears next to a link is in `distance` at once, and in the repulsion by and by. One that is
/// gone beyond the influence distance repels no more, at once: over the last tenth of that distance
/// the length fades, whatever the filter holds. One thread.
class RepulsionFilter {
 public:
  /// @param time       [s] of the poses; an earlier one than before starts anew
  /// @param obstacles  another number whenever the obstacles are others: see obstacles_key
  /// @param raw        as it is without a filter; NaN starts anew
  /// @param proximity  the link's answer that `raw` is of
  /// @param config     filter_time, gain and influence_distance are read
  Push update(double time, std::uint64_t obstacles, const Push& raw, const LinkProximity& proximity,
              const RepulsionConfig& config);

  /// The next update() is the first.
  void reset() { *this = RepulsionFilter(); }

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  void decay(double seconds, double lag);

  bool started_ = false;
  double time_ = 0.0;  ///< [s]
  std::uint64_t obstacles_ = 0;
  Vector6 raw_ = Vector6::Zero();     ///< of the last update
  Vector6 offset_ = Vector6::Zero();  ///< added to it
  Vector6 speed_ = Vector6::Zero();   ///< [1/s] of the offset
};

/// Tells sets of clouds apart: the same only for the same snapshots, in the same order.
std::uint64_t obstacles_key(SnapshotSpan clouds);

}  // namespace ist
