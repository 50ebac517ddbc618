#pragma once

#include <sensor_msgs/LaserScan.h>

#include "ist_proximity/cloud/laser_scan.h"
#include "ros/input/measurement.h"

namespace ist {

/// Reads a LaserScan. Each beam is placed with the sensor's pose at the beam's own time, and the
/// self-filter uses the robot's poses at several instants of the scan.
/// @param ranges  its min_range, max_range and sensor_range apply to each beam
Received read_scan(const sensor_msgs::LaserScanConstPtr& message, const IngestConfig& ranges,
                   const ScanLimits& limits);

}  // namespace ist
