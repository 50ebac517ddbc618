#pragma once

#include <ist_proximity/ProximityArray.h>
#include <std_msgs/ColorRGBA.h>

#include <string>
#include <vector>

namespace ist {

/// The text that a viewer reads in one glance.
struct NearestSummary {
  int link = -1;     ///< the nearest link's place in the array; -1: no link is near
  std::string text;  ///< its distance and name, "clear", or that something is not known
  std_msgs::ColorRGBA color;
};

/// @param max_distance  [m]
/// @param counts  by link of the message: whether it counts, as in ~min_distance; where it has
///                another size, all do
NearestSummary summarize_nearest(const ist_proximity::ProximityArray& proximity,
                                 double max_distance, const std::vector<bool>& counts);

std_msgs::ColorRGBA make_color(double r, double g, double b, double a);

/// The one scale of nearness in rviz: red at touch and in contact, yellow at half of ~max_distance,
/// green from ~max_distance on. Grey for NaN: not known.
/// @param max_distance  [m]
std_msgs::ColorRGBA nearness_color(double distance, double max_distance);

}  // namespace ist
