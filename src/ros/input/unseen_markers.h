#pragma once

#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include "ist_proximity/cloud/memory_map.h"

namespace ist {

/// Draws the unknown space near a robot as small grey cubes, the fainter the farther they are,
/// after what was drawn before is deleted. Where there are more cubes than rviz can turn smoothly,
/// the nearest are drawn.
/// @param boxes  [m] of unknown space
/// @param links  [m] each holds a link, in the same frame
/// @param range  [m] what is farther than this from each of `links` is not drawn
/// @param header  its frame is that of boxes and links
visualization_msgs::MarkerArray unseen_markers(const VoxelBoxes& boxes, const VoxelBoxes& links,
                                               double range, const std_msgs::Header& header);

}  // namespace ist
