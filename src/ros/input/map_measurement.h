#pragma once

#include <ros/node_handle.h>
#include <std_msgs/Header.h>
#include <topic_tools/shape_shifter.h>

#include <cstdint>
#include <string>
#include <vector>

#include "ist_proximity/cloud/octree.h"
#include "ros/input/measurement.h"

namespace ist {

/// Reads an octomap_msgs/Octomap from its bytes, so that octomap_msgs is not needed.
Received read_map(const topic_tools::ShapeShifter& message, const OctreeLimits& limits);

/// Reads a map file. The header of the result has no stamp.
Received read_map_file(const std::string& path, const std::string& frame_id,
                       const OctreeLimits& limits);

/// Advertises an octomap_msgs/Octomap, whose wire format is written here, so that the package of
/// that message is not needed.
ros::Publisher advertise_map(ros::NodeHandle* nh, const std::string& topic);

/// Publishes a binary tree.
/// @param data  as MemoryMap::octree_bytes() makes it
void publish_map(const ros::Publisher& publisher, const std_msgs::Header& header, double resolution,
                 const std::vector<std::uint8_t>& data);

}  // namespace ist
