#include "ros/output/markers.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ros/poses/transforms.h"

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

/// Colours that differ for neighbours: the golden ratio around the circle of hues.
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

  Marker on_link = marker("point_on_link", id, Marker::SPHERE);
  scale(kPointSize, kPointSize, kPointSize, &on_link);
  on_link.color = shade;
  on_link.pose.position = link.point_on_link;
  markers->push_back(on_link);

  Marker on_obstacle = marker("point_on_obstacle", id, Marker::SPHERE);
  scale(kPointSize, kPointSize, kPointSize, &on_obstacle);
  on_obstacle.color = color(0.2, 0.4, 1.0, 1.0);
  on_obstacle.pose.position = link.point_on_obstacle;
  markers->push_back(on_obstacle);

  const auto& f = link.repulsion;
  const double length = Eigen::Vector3d(f.x, f.y, f.z).norm() * kArrowPerRepulsion;
  if (length > 1e-3 && std::isfinite(length)) {
    Marker arrow = marker("repulsion", id, Marker::ARROW);
    scale(2 * kLineWidth, 4 * kLineWidth, std::min(0.3 * length, 6 * kLineWidth), &arrow);
    arrow.color = color(1.0, 0.5, 0.0, 0.9);
    geometry_msgs::Point tip = link.point_on_link;
    tip.x += f.x * kArrowPerRepulsion;
    tip.y += f.y * kArrowPerRepulsion;
    tip.z += f.z * kArrowPerRepulsion;
    arrow.points = {link.point_on_link, tip};
    markers->push_back(arrow);
  }

  Marker text = marker("text", id, Marker::TEXT_VIEW_FACING);
  scale(0, 0, kTextHeight, &text);
  text.color = color(1, 1, 1, 1);
  text.pose.position.x = (link.point_on_link.x + link.point_on_obstacle.x) / 2;
  text.pose.position.y = (link.point_on_link.y + link.point_on_obstacle.y) / 2;
  text.pose.position.z = (link.point_on_link.z + link.point_on_obstacle.z) / 2;
  char number[32];
  std::snprintf(number, sizeof number, " %.3f m", link.distance);
  text.text = link.link + number;
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
    Marker gone;
    gone.header = header;
    gone.ns = key.first;
    gone.id = key.second;
    gone.action = Marker::DELETE;
    result.markers.push_back(gone);
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
      Marker marker;
      marker.header.frame_id =
          without_slash(link.name);  // stamp 0: rviz takes the newest transform
      marker.ns = link.name;
      marker.id = static_cast<int>(k);
      marker.type = Marker::SPHERE;
      marker.action = Marker::ADD;
      marker.frame_locked = true;
      marker.pose.position.x = spheres[k].center.x();
      marker.pose.position.y = spheres[k].center.y();
      marker.pose.position.z = spheres[k].center.z();
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
