#include "ros/output/sphere_publisher.h"

#include <cstddef>

#include "ros/common/publish.h"

namespace ist {
namespace {

constexpr std::size_t kMaxSpheresPerLink = 250;  // each sphere is a marker
constexpr std::chrono::seconds kFirstDelay(1), kLastDelay(4);

}  // namespace

SpherePublisher::SpherePublisher(ros::NodeHandle private_nh)
    : publisher_(private_nh.advertise<visualization_msgs::MarkerArray>("spheres", 1, true)) {}

void SpherePublisher::show(const ModelState& model) {
  if (model.robot != shown_robot_) {
    shown_robot_ = model.robot;
    spheres_.markers.clear();
    if (model.robot) {
      spheres_ = sphere_markers(*model.robot, model.monitored, kMaxSpheresPerLink);
    }
    shown_.complete(&spheres_);
    if (!spheres_.markers.empty()) publish_message(publisher_, spheres_);
  }
  const Clock::time_point now = Clock::now();
  if (has_jumped_.exchange(false)) next_repeat_ = now + (repeat_delay_ = kFirstDelay);
  if (now < next_repeat_) return;
  publish_message(publisher_, spheres_);
  repeat_delay_ *= 2;
  next_repeat_ = repeat_delay_ <= kLastDelay ? now + repeat_delay_ : Clock::time_point::max();
}

}  // namespace ist
