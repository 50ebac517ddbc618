#pragma once

#include <ros/time.h>

#include <limits>

namespace ist {

/// Rate at which one link's distance falls, from two answers for different instants.
class ClosingSpeed {
 public:
  /// @param stamp     of the link poses
  /// @param distance  [m]; anything not finite (CLEAR, UNKNOWN) breaks the sequence
  /// @returns [m/s], positive when getting closer; NaN without a finite distance at another instant
  ///          less than 0.2 s before
  double update(const ros::Time& stamp, double distance);

 private:
  struct Sample {
    ros::Time stamp;
    double distance = std::numeric_limits<double>::quiet_NaN();
  };
  Sample latest_, previous_;  ///< previous_: at an earlier instant than latest_
};

}  // namespace ist
