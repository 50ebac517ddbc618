#include "ros/output/markers.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;
using LinkMessage = ist_proximity::LinkProximity;

constexpr double kLineWidth = 0.005;        // [m]
constexpr double kPointSize = 0.015;        // [m]
constexpr double kTextHeight = 0.03;        // [m]
constexpr double kArrowPerRepulsion = 0.3;  // [m] for a repulsion of length 1

std_msgs::ColorRGBA color(double r, double g, double b, double a) {
  std_msgs::ColorRGBA result;
  result.r = static_cast<float>(r);
  result.g = static_cast<float>(g);
  result.b = static_cast<float>(b);
  result.a = static_cast<float>(a);
  return result;
}

std_msgs::ColorRGBA color_of(double distance, double max_distance) {
  const double far = std::clamp(distance / max_distance, 0.0, 1.0);
  return color(std::min(1.0, 2.0 * (1.0 - far)), std::min(1.0, 2.0 * far), 0.1, 1.0);
}

/// Gives neighbours different colours, by the golden ratio on the circle of hues.
std_msgs::ColorRGBA color_of_link(std::size_t index) {
  const double hue = std::fmod(0.61803398875 * static_cast<double>(index), 1.0) * 2.0 * M_PI;
  const auto channel = [hue](double phase) { return 0.55 + 0.4 * std::cos(hue - phase); };
  return color(channel(0.0), channel(2.0 * M_PI / 3.0), channel(4.0 * M_PI / 3.0), 0.6);
}

void scale(double x, double y, double z, Marker* marker) {
  marker->scale.x = x;
  marker->scale.y = y;
  marker->scale.z = z;
}

}  // namespace

Marker ProximityMarkers::marker(const std::string& ns, int id, int type) const {
  Marker result;
  result.header = header_;
  result.ns = ns;
  result.id = id;
  result.type = type;
  result.action = Marker::ADD;
  result.pose.orientation.w = 1.0;
  result.lifetime = ros::Duration(lifetime_);
  return result;
}

void ProximityMarkers::draw_link(const LinkMessage& link, int id,
                                 std::vector<Marker>* markers) const {
  const std_msgs::ColorRGBA shade = color_of(link.distance, max_distance_);

  Marker line = marker("distance", id, Marker::LINE_LIST);
  scale(kLineWidth, 0, 0, &line);
  line.color = shade;
  line.points = {link.point_on_obstacle, link.point_on_link};
  markers->push_back(line);

  const auto add_point = [&](const char* ns, const geometry_msgs::Point& position,
                             const std_msgs::ColorRGBA& point_color) {
    Marker point = marker(ns, id, Marker::SPHERE);
    scale(kPointSize, kPointSize, kPointSize, &point);
    point.color = point_color;
    point.pose.position = position;
    markers->push_back(point);
  };
  add_point("point_on_link", link.point_on_link, shade);
  add_point("point_on_obstacle", link.point_on_obstacle, color(0.2, 0.4, 1.0, 1.0));

  const Eigen::Vector3d repulsion = to_vector(link.repulsion);
  const double length = repulsion.norm() * kArrowPerRepulsion;
  if (length > 1e-3 && std::isfinite(length)) {
    Marker arrow = marker("repulsion", id, Marker::ARROW);
    scale(2 * kLineWidth, 4 * kLineWidth, std::min(0.3 * length, 6 * kLineWidth), &arrow);
    arrow.color = color(1.0, 0.5, 0.0, 0.9);
    geometry_msgs::Point tip = link.point_on_link;
    assign(to_vector(tip) + repulsion * kArrowPerRepulsion, &tip);
    arrow.points = {link.point_on_link, tip};
    markers->push_back(arrow);
  }

  Marker text = marker("text", id, Marker::TEXT_VIEW_FACING);
  scale(0, 0, kTextHeight, &text);
  text.color = color(1, 1, 1, 1);
  assign((to_vector(link.point_on_link) + to_vector(link.point_on_obstacle)) / 2,
         &text.pose.position);
  text.text = link.link + format_text(" %.3f m", link.distance);
  markers->push_back(text);
}

MarkerArray ProximityMarkers::draw(const ist_proximity::ProximityArray& proximity) {
  header_ = proximity.header;
  MarkerArray result;
  for (std::size_t i = 0; i < proximity.links.size(); ++i) {
    if (proximity.links[i].state >= LinkMessage::NEAR) {
      draw_link(proximity.links[i], static_cast<int>(i), &result.markers);
    }
  }

  std::map<Key, std_msgs::Header> shown;
  for (const Marker& drawn : result.markers) shown[{drawn.ns, drawn.id}] = drawn.header;
  for (const auto& [key, header] : shown_) {
    if (shown.count(key) > 0) continue;
    Marker removed;
    removed.header = header;
    removed.ns = key.first;
    removed.id = key.second;
    removed.action = Marker::DELETE;
    result.markers.push_back(removed);
  }
  shown_ = std::move(shown);
  return result;
}

MarkerArray sphere_markers(const RobotModel& model, const std::vector<std::size_t>& links,
                           std::size_t max_per_link) {
  MarkerArray result;
  for (const std::size_t i : links) {
    const LinkModel& link = model.links[i];
    std::vector<InnerSphere> spheres = link.packing.spheres;
    std::stable_sort(
        spheres.begin(), spheres.end(),
        [](const InnerSphere& a, const InnerSphere& b) { return a.radius > b.radius; });
    if (spheres.size() > max_per_link) spheres.resize(max_per_link);
    for (std::size_t k = 0; k < spheres.size() && spheres[k].radius > 0.0; ++k) {
      Marker marker;  // its stamp is 0, so rviz takes the newest transform
      marker.header.frame_id = without_slash(link.name);
      marker.ns = link.name;
      marker.id = static_cast<int>(k);
      marker.type = Marker::SPHERE;
      marker.action = Marker::ADD;
      marker.frame_locked = true;
      assign(spheres[k].center, &marker.pose.position);
      marker.pose.orientation.w = 1.0;
      scale(2 * spheres[k].radius, 2 * spheres[k].radius, 2 * spheres[k].radius, &marker);
      marker.color = color_of_link(i);
      result.markers.push_back(marker);
    }
  }
  return result;
}

MarkerArray deleted(const MarkerArray& markers) {
  MarkerArray result = markers;
  for (Marker& marker : result.markers) marker.action = Marker::DELETE;
  return result;
}

}  // namespace ist
