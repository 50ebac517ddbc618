#include "ros/output/nearness_color.h"

#include <algorithm>
#include <cmath>

namespace ist {

std_msgs::ColorRGBA make_color(double r, double g, double b, double a) {
  std_msgs::ColorRGBA color;
  color.r = static_cast<float>(r);
  color.g = static_cast<float>(g);
  color.b = static_cast<float>(b);
  color.a = static_cast<float>(a);
  return color;
}

std_msgs::ColorRGBA nearness_color(double distance, double max_distance) {
  if (std::isnan(distance)) return make_color(0.6, 0.6, 0.6, 1.0);
  const double far = std::clamp(distance / max_distance, 0.0, 1.0);
  return make_color(std::min(1.0, 2.0 * (1.0 - far)), std::min(1.0, 2.0 * far), 0.1, 1.0);
}

}  // namespace ist
