#include "ros/output/markers.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>

#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using geometry_msgs::Point;
using ist_proximity::ProximityArray;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;
using LinkMessage = ist_proximity::LinkProximity;

constexpr double kLineWidth = 0.005;        // [m]
constexpr double kPointSize = 0.015;        // [m]
constexpr double kTextHeight = 0.04;        // [m]
constexpr double kRow = 1.3 * kTextHeight;  // [m] from a label to the next
constexpr double kLabelled = 0.3;           // [m] farther links have no label
constexpr std::size_t kLabels = 4;          // the nearest ones
constexpr double kNumberHeight = 0.09;      // [m]
constexpr double kGap = 0.03;               // [m] from the number to the labels, to the robot
constexpr double kListFollows = 0.05;       // share of its way that the list moves at a time
constexpr double kListJumps = 2.0;          // [m] farther ways it takes at once
constexpr double kArrowPerRepulsion = 0.3;  // [m] for a repulsion of length 1

constexpr const char* kStatuses[] = {"OK",       "NO_CLOUD",    "STALE_CLOUD", "NO_POSE",
                                     "DEGRADED", "MODEL_ERROR", "LOADING"};

const char* name_of(std::uint8_t status) {
  return status < std::size(kStatuses) ? kStatuses[status] : "OK";
}

void scale(double x, double y, double z, Marker* marker) {
  marker->scale.x = x;
  marker->scale.y = y;
  marker->scale.z = z;
}

Point point_of(const Eigen::Vector3d& p) {
  Point point;
  assign(p, &point);
  return point;
}

}  // namespace

NearestSummary summarize_nearest(const ProximityArray& proximity, double max_distance,
                                 const std::vector<bool>& counts) {
  NearestSummary summary;
  const std::vector<LinkMessage>& links = proximity.links;
  std::size_t unknown = 0;
  double least = max_distance;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].state == LinkMessage::UNKNOWN) ++unknown;
    const bool does_count = counts.size() != links.size() || counts[i];
    if (does_count && links[i].state != LinkMessage::UNKNOWN)
      least = std::min(least, links[i].lower_bound);
    if (links[i].state < LinkMessage::NEAR || !does_count) continue;
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
    const LinkMessage& nearest = links[static_cast<std::size_t>(summary.link)];
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

Marker& ProximityMarkers::add(const char* ns, std::size_t id, int type, double x, double y,
                              double z, const Color& color) {
  drawn_.emplace_back();
  Marker& marker = drawn_.back();
  marker.header = header_;
  marker.ns = ns;
  marker.id = static_cast<int>(id);
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.lifetime = ros::Duration(lifetime_);
  scale(x, y, z, &marker);
  marker.color = color;
  return marker;
}

void ProximityMarkers::add_line(const char* ns, std::size_t id, double width, const Color& color,
                                const Point& from, const Point& to) {
  add(ns, id, Marker::LINE_LIST, width, 0, 0, color).points = {from, to};
}

void ProximityMarkers::add_solid(const char* ns, std::size_t id, int type, double size,
                                 const Color& color, const Point& center) {
  add(ns, id, type, size, size, size, color).pose.position = center;
}

/// @param above  [m] of its middle, from the lower edge of the large number
void ProximityMarkers::add_text(const char* ns, std::size_t id, double height, double above,
                                const Color& color, const std::string& text) {
  Marker& marker = add(ns, id, Marker::TEXT_VIEW_FACING, 0, 0, height, color);
  marker.pose.position = point_of(list_position_ + Eigen::Vector3d(0, 0, above));
  marker.text = text;
}

void ProximityMarkers::draw_link(const LinkMessage& link, std::size_t id) {
  const std_msgs::ColorRGBA shade = nearness_color(link.distance, max_distance_);
  const Point &on_link = link.point_on_link, &on_obstacle = link.point_on_obstacle;
  add_line("distance", id, kLineWidth, shade, on_obstacle, on_link);
  add_solid("point_on_link", id, Marker::SPHERE, kPointSize, shade, on_link);
  add_solid("point_on_obstacle", id, Marker::SPHERE, kPointSize, make_color(0.2, 0.4, 1.0, 1.0),
            on_obstacle);
  const Eigen::Vector3d arrow = to_vector(link.repulsion) * kArrowPerRepulsion;
  const double length = arrow.norm();
  if (!(length > 1e-3 && std::isfinite(length))) return;
  add("repulsion", id, Marker::ARROW, 2 * kLineWidth, 4 * kLineWidth,
      std::min(0.3 * length, 6 * kLineWidth), make_color(0.8, 0.35, 1.0, 0.9))
      .points = {on_link, point_of(to_vector(on_link) + arrow)};
}

void ProximityMarkers::draw_labels(const std::vector<LinkMessage>& links) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].state >= LinkMessage::NEAR && links[i].distance <= kLabelled) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return links[a].distance < links[b].distance;
  });
  for (std::size_t row = 0; row < std::min(order.size(), kLabels); ++row) {
    const LinkMessage& link = links[order[row]];
    std::string text = link.link + format_text(" %.3f m", link.distance);
    if (std::isfinite(link.robot_future)) {
      text += format_text(", %.3f m until it stands", link.robot_future);
    } else if (!std::isnan(link.robot_future)) {
      text += ", NOT KNOWN until it stands";
    }
    add_text("text", order[row], kTextHeight, -kGap - (static_cast<double>(row) + 0.5) * kRow,
             nearness_color(link.distance, max_distance_), text);
  }
}

void ProximityMarkers::draw_nearest(const ProximityArray& proximity) {
  NearestSummary summary = summarize_nearest(proximity, max_distance_, counts_);
  const auto lines = 1 + std::count(summary.text.begin(), summary.text.end(), '\n');
  const double above = 0.5 * kNumberHeight * static_cast<double>(lines);  // rviz centers the text
  add_text("nearest", 0, kNumberHeight, above, summary.color, summary.text);
  if (summary.link < 0) return;
  const LinkMessage& link = proximity.links[static_cast<std::size_t>(summary.link)];
  add_line("nearest", 1, 3 * kLineWidth, summary.color, link.point_on_obstacle, link.point_on_link);
  summary.color.a = 0.5F;  // a halo
  add_solid("nearest", 2, Marker::SPHERE, 3 * kPointSize, summary.color, link.point_on_link);
}

/// Moves number and labels slowly to a place above the robot, so that they can be read while it
/// moves. Where the robot is not known they stay.
void ProximityMarkers::place_list(const Eigen::AlignedBox3d& robot) {
  if (robot.isEmpty()) return;
  Eigen::Vector3d wanted = robot.center();
  wanted.z() = robot.max().z() + 2.0 * kGap + static_cast<double>(kLabels) * kRow;
  const bool is_far = !is_placed_ || !((wanted - list_position_).norm() <= kListJumps);
  is_placed_ = true;
  list_position_ += (is_far ? 1.0 : kListFollows) * (wanted - list_position_);
}

MarkerArray ProximityMarkers::draw(const ist_proximity::ProximityArray& proximity,
                                   const MarkerScene& scene) {
  header_ = proximity.header;
  place_list(scene.robot);
  for (std::size_t i = 0; i < proximity.links.size(); ++i) {
    if (proximity.links[i].state >= LinkMessage::NEAR) draw_link(proximity.links[i], i);
  }
  const std_msgs::ColorRGBA grey = nearness_color(std::nan(""), max_distance_);
  for (const MarkerScene::UnseenLine& unseen : scene.unseen) {
    const Point end = point_of(unseen.p_FCo);
    add_line("unseen", unseen.link, kLineWidth, grey, end, point_of(unseen.p_FCl));
    add_solid("unseen_end", unseen.link, Marker::CUBE, kPointSize, grey, end);  // a voxel
  }
  draw_labels(proximity.links);
  draw_nearest(proximity);

  MarkerArray result;
  result.markers = std::move(drawn_);
  drawn_.clear();
  shown_.complete(&result);
  return result;
}

MarkerArray sphere_markers(const RobotModel& model, const std::vector<std::size_t>& links,
                           std::size_t max_per_link) {
  MarkerArray result;
  const std_msgs::ColorRGBA color = make_color(0.6, 0.6, 0.6, 0.6);
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
      marker.color = color;
      result.markers.push_back(marker);
    }
  }
  return result;
}

void ShownMarkers::complete(MarkerArray* markers) {
  decltype(shown_) shown;
  for (const Marker& marker : markers->markers) shown[{marker.ns, marker.id}] = marker.header;
  for (const auto& [key, header] : shown_) {
    if (shown.count(key) > 0) continue;
    Marker removed;
    removed.header = header;
    std::tie(removed.ns, removed.id) = key;
    removed.action = Marker::DELETE;
    removed.pose.orientation.w = 1.0;
    markers->markers.push_back(removed);
  }
  shown_ = std::move(shown);
}

}  // namespace ist
