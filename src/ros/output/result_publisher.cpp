#include "ros/output/result_publisher.h"

#include <algorithm>

#include "ros/common/publish.h"

namespace ist {
namespace {

constexpr std::chrono::milliseconds kMarkerPeriod(40);  // rviz draws no faster

}  // namespace

ResultPublisher::ResultPublisher(ros::NodeHandle private_nh, const ServerConfig& config)
    : summary_(private_nh, config),
      marker_drawer_(config.query.max_distance, std::max(1.0, 3.0 / config.rate)) {
  proximity_ = private_nh.advertise<ist_proximity::ProximityArray>("proximity", 10);
  joint_repulsion_ = private_nh.advertise<ist_proximity::JointRepulsion>("joint_repulsion", 10);
  markers_ = private_nh.advertise<visualization_msgs::MarkerArray>("markers", 2);
}

bool ResultPublisher::publish(
    const ist_proximity::ProximityArrayConstPtr& result,
    const ist_proximity::ProximityArrayConstPtr& self, const SpeedScaleConfig& speed_scale,
    const std::function<void(ist_proximity::JointRepulsion*)>& fill_joint_repulsion,
    const std::function<MarkerScene()>& scene) {
  summary_.publish(*result, self.get(), speed_scale, ros::Time::now());
  publish_message(proximity_, result);
  if (joint_repulsion_.getNumSubscribers() > 0) {
    ist_proximity::JointRepulsion message;
    message.header.stamp = result->header.stamp;
    message.status = result->status;
    message.status_text = result->status_text;
    fill_joint_repulsion(&message);
    publish_message(joint_repulsion_, message);
  }

  const auto now = std::chrono::steady_clock::now();
  if (markers_.getNumSubscribers() == 0 || now < next_markers_) return false;
  next_markers_ = now + kMarkerPeriod;
  publish_message(markers_, marker_drawer_.draw(*result, scene()));
  return true;
}

}  // namespace ist
