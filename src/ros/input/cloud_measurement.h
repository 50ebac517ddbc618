#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <memory>

#include "internal/cloud/noise_filter.h"
#include "ros/input/measurement.h"

namespace ist {

/// Points of one instant: a cloud, or the pixels of a depth image.
/// @param points  keep their message alive
/// @param bytes   of that message
/// @param noise   null: no noise filter
std::shared_ptr<const Measurement> make_cloud_measurement(
    const std_msgs::Header& header, const RawCloud& points, std::size_t bytes,
    const std::shared_ptr<NoiseFilter>& noise);

/// Reads a PointCloud2.
/// @param max_points  a cloud of more points is faulty
/// @param noise       null: no noise filter
Received read_cloud(const sensor_msgs::PointCloud2ConstPtr& message, std::size_t max_points,
                    const std::shared_ptr<NoiseFilter>& noise);

}  // namespace ist
