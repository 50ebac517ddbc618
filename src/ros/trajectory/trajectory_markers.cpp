#include "ros/trajectory/trajectory_markers.h"

#include <Eigen/Geometry>
#include <utility>

#include "ros/common/eigen_conversion.h"
#include "ros/common/text.h"
#include "ros/output/markers.h"

namespace ist {
namespace {

using visualization_msgs::Marker;

constexpr std::size_t kMaxSpheresPerLink = 50;
constexpr double kLifetime = 0.5;    // [s]
constexpr double kTextHeight = 0.1;  // [m]

}  // namespace

visualization_msgs::MarkerArray trajectory_markers(
    const ist_proximity::TrajectoryClearance& message, const ModelState& model,
    const BodyPoses& bodies) {
  visualization_msgs::MarkerArray result;
  const std_msgs::ColorRGBA color = make_color(1.0, 0.35, 0.1, 0.3);
  for (Marker& sphere : sphere_markers(*model.robot, model.monitored, kMaxSpheresPerLink).markers) {
    const auto body = model.kinematics->find_body(sphere.ns);
    if (!body || !bodies.known[*body]) continue;
    assign(bodies.X_FB[*body] * to_vector(sphere.pose.position), &sphere.pose.position);
    sphere.ns = "ghost";
    sphere.color = color;
    sphere.frame_locked = false;
    result.markers.push_back(std::move(sphere));
  }
  const auto first = model.kinematics->find_body(message.first.link);
  Marker text;
  text.ns = "time";
  text.type = Marker::TEXT_VIEW_FACING;
  text.text = format_text("%.2f s", message.time_to_contact);
  text.scale.z = kTextHeight;
  text.color = make_color(1.0, 0.35, 0.1, 1.0);
  text.pose.orientation.w = 1.0;
  if (first && bodies.known[*first]) {
    assign(bodies.X_FB[*first].translation(), &text.pose.position);
    result.markers.push_back(text);
  }
  for (std::size_t k = 0; k < result.markers.size(); ++k) {
    Marker& marker = result.markers[k];
    marker.header = message.header;
    marker.id = static_cast<int>(k);
    marker.lifetime = ros::Duration(kLifetime);
  }
  return result;
}

}  // namespace ist
