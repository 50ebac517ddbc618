#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// The speeds [m/s] at which a link and the nearest obstacle get closer, positive when they do; NaN
/// where a speed cannot be known.
struct ClosingRates {
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  double total = kNaN;            ///< robot + obstacles, or from two distances where one is NaN
  double robot = kNaN;            ///< part by the motion of the link's witness
  double obstacles = kNaN;        ///< part by the change of the nearest source's cloud
  double time_to_contact = kNaN;  ///< [s] at this rate; +inf when not closing, 0 in contact
};

/// Computes the closing rates of one link from its successive answers. One thread.
class ClosingSpeed {
 public:
  /// The cloud that holds the nearest point.
  struct Nearest {
    int source = -1;               ///< its number; -1: no point is near
    std::uint64_t generation = 0;  ///< differs for each cloud of the source
    double stamp = 0.0;            ///< [s] acquisition time
  };

  /// Computes the rates. `robot`, and `total` where it comes from distances, compare with the last
  /// answer for another instant, which must be less than 0.2 s old. `obstacles` is the difference
  /// between the last two clouds of the nearest source that the link's motion does not explain, per
  /// time between their stamps (at most 2 s). It holds until the next cloud, and is unknown when
  /// the nearest point changes from one source to another.
  /// @param stamp   of the link poses
  /// @param result  the link's answer; one that is not NEAR or CONTACT ends the sequence
  /// @param X_FL    link frame -> fixed frame
  ClosingRates update(const ros::Time& stamp, const LinkProximity& result,
                      const Eigen::Isometry3d& X_FL, const Nearest& nearest);

 private:
  struct Sample {
    ros::Time stamp;
    double distance = std::numeric_limits<double>::quiet_NaN();
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    Nearest nearest;
  };

  void update_obstacles(const LinkProximity& result, const Sample& now);

  Sample latest_, previous_;  ///< previous_: at an earlier instant than latest_
  double obstacles_ = ClosingRates::kNaN;
};

}  // namespace ist
