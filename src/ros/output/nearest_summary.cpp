#include "ros/output/nearest_summary.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "ros/common/text.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;
using Link = ist_proximity::LinkProximity;

constexpr const char* kStatuses[] = {"OK",       "NO_CLOUD",    "STALE_CLOUD", "NO_POSE",
                                     "DEGRADED", "MODEL_ERROR", "LOADING"};

const char* name_of(std::uint8_t status) {
  return status < std::size(kStatuses) ? kStatuses[status] : "OK";
}

}  // namespace

NearestSummary summarize_nearest(const ProximityArray& proximity, double max_distance,
                                 const std::vector<bool>& counts) {
  NearestSummary summary;
  const std::vector<Link>& links = proximity.links;
  std::size_t unknown = 0;
  double least = max_distance;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].state == Link::UNKNOWN) ++unknown;
    const bool does_count = counts.size() != links.size() || counts[i];
    if (does_count && links[i].state != Link::UNKNOWN)
      least = std::min(least, links[i].lower_bound);
    if (links[i].state < Link::NEAR || !does_count) continue;
    const bool is_nearer =
        summary.link < 0 ||
        links[i].distance < links[static_cast<std::size_t>(summary.link)].distance;
    if (is_nearer) summary.link = static_cast<int>(i);
  }
  if (links.empty() || unknown == links.size()) {
    summary.text = std::string("NOT KNOWN\n") + name_of(proximity.status);
    summary.color = make_color(1.0, 0.45, 0.1, 1.0);
    return summary;
  }
  if (summary.link >= 0) {
    const Link& nearest = links[static_cast<std::size_t>(summary.link)];
    summary.text = format_text("%.3f m\n", nearest.distance) + nearest.link;
    summary.color = nearness_color(nearest.distance, max_distance);
  } else {
    summary.text = format_text("> %.2f m", least);
    summary.color = nearness_color(least, max_distance);
  }
  if (unknown > 0) summary.text += "\n" + std::to_string(unknown) + " links NOT KNOWN";
  if (proximity.status != ProximityArray::OK) {
    summary.text += std::string("\n") + name_of(proximity.status);
  }
  return summary;
}

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
