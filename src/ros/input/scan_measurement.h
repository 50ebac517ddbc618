#pragma once

#include <sensor_msgs/LaserScan.h>

#include "ros/input/measurement.h"

namespace ist {

/// A LaserScan: each beam is placed where the sensor was at the beam's own time, and the
/// self-filter knows the robot at several instants of the scan.
/// @param min_range, max_range  [m] of the points to keep
Received read_scan(const sensor_msgs::LaserScanConstPtr& message, double min_range,
                   double max_range);

}  // namespace ist
