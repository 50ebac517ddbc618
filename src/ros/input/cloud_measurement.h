#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <cstddef>
#include <memory>
#include <string>

#include "internal/cloud/noise_filter.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"
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

/// Views a message's points without copying them; `raw` is valid as long as the message.
/// @param max_points  a cloud of more points is faulty
/// @returns empty, or one sentence with the faulty field and values
std::string view_cloud(const sensor_msgs::PointCloud2& message, std::size_t max_points,
                       RawCloud* raw);

/// Makes a message of the points that queries see: x, y, z in float32 [m] in the fixed frame.
sensor_msgs::PointCloud2Ptr to_message(const CloudSnapshot& snapshot, const ros::Time& stamp,
                                       const std::string& fixed_frame);

}  // namespace ist
