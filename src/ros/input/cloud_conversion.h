#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <cstddef>
#include <string>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Views a message's points without copying them; `raw` is valid as long as the message.
/// @param max_points  a cloud of more points is faulty
/// @returns empty, or one sentence with the faulty field and values
std::string view_cloud(const sensor_msgs::PointCloud2& message, std::size_t max_points,
                       RawCloud* raw);

/// Makes a message of the points that queries see: x, y, z in float32 [m] in the fixed frame.
sensor_msgs::PointCloud2Ptr to_message(const CloudSnapshot& snapshot, const ros::Time& stamp,
                                       const std::string& fixed_frame);

}  // namespace ist
