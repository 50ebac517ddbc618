#pragma once

#include <ist_proximity/ProximityArray.h>
#include <std_msgs/ColorRGBA.h>

#include <string>

namespace ist {

/// What a viewer reads in one glance.
struct NearestSummary {
  int link = -1;     ///< the nearest link's place in the array; -1: no link is near
  std::string text;  ///< its distance and name, "clear", or that something is not known
  std_msgs::ColorRGBA color;
};

/// @param max_distance  [m]
NearestSummary summarize_nearest(const ist_proximity::ProximityArray& proximity,
                                 double max_distance);

}  // namespace ist
