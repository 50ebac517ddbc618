#pragma once

#include <ros/node_handle.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <string>
#include <vector>

namespace ist {

/// Advertises an octomap_msgs/Octomap, whose wire format is written here, so that the package of
/// that message is not needed.
ros::Publisher advertise_map(ros::NodeHandle* nh, const std::string& topic);

/// Publishes a binary tree.
/// @param data  as MemoryMap::octree_bytes() makes it
void publish_map(const ros::Publisher& publisher, const std_msgs::Header& header, double resolution,
                 const std::vector<std::uint8_t>& data);

}  // namespace ist
