#pragma once

#include <std_msgs/ColorRGBA.h>

namespace ist {

std_msgs::ColorRGBA make_color(double r, double g, double b, double a);

/// The one scale of nearness in rviz: red at touch and in contact, yellow at half of ~max_distance,
/// green from ~max_distance on. Grey for NaN: not known.
/// @param max_distance  [m]
std_msgs::ColorRGBA nearness_color(double distance, double max_distance);

}  // namespace ist
