#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <string>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// How fast a link and what is nearest to it get closer [m/s], positive when they do; NaN where it
/// cannot be known.
struct ClosingRates {
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  double total = kNaN;      ///< robot + obstacles, or what two distances tell where one is NaN
  double robot = kNaN;      ///< from the motion of the link's witness
  double obstacles = kNaN;  ///< from the change of the nearest source's cloud
  double time_to_contact = kNaN;  ///< [s] at this rate; +inf when not closing, 0 in contact
};

/// The closing rates of one link, from its answers one after the other. One thread.
class ClosingSpeed {
 public:
  /// The cloud that holds the nearest point.
  struct Nearest {
    std::string source;            ///< name; empty: no point is near
    std::uint64_t generation = 0;  ///< another one for each cloud of the source
    double stamp = 0.0;            ///< [s] acquisition
  };

  /// @param stamp   of the link poses
  /// @param result  the link's answer; one that is not NEAR or CONTACT breaks the sequence
  /// @param X_FL    link frame -> fixed frame
  /// total, where only distances tell, and robot: from the last answer for another instant, less
  /// than 0.2 s before. obstacles: by how much the last two clouds of the nearest source differ
  /// beyond what the link's motion explains, over the time between their stamps (at most 2 s); it
  /// holds until the next one, and is not known while the nearest point changes from one source to
  /// another.
  ClosingRates update(const ros::Time& stamp, const LinkProximity& result,
                      const Eigen::Isometry3d& X_FL, const Nearest& nearest);

 private:
  struct Sample {
    ros::Time stamp;
    double distance = std::numeric_limits<double>::quiet_NaN();
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    Nearest nearest;
  };

  void look_at_obstacles(const LinkProximity& result, const Sample& now);

  Sample latest_, previous_;  ///< previous_: at an earlier instant than latest_
  double obstacles_ = ClosingRates::kNaN;
};

}  // namespace ist
