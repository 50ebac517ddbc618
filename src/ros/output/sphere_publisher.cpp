#include "ros/output/sphere_publisher.h"

#include <cstddef>

#include "ros/common/publish.h"
#include "ros/output/markers.h"

namespace ist {
namespace {

constexpr std::size_t kMaxSpheresPerLink = 250;  // each sphere is a marker
constexpr std::chrono::seconds kFirstDelay(1), kLastDelay(4);

}  // namespace

SpherePublisher::SpherePublisher(ros::NodeHandle private_nh)
    : publisher_(private_nh.advertise<visualization_msgs::MarkerArray>("spheres", 1, true)) {}

void SpherePublisher::show(const ModelState& model) {
  const std::lock_guard<std::mutex> lock(mutex_);
  draw(model);
}

void SpherePublisher::show_finer(const ModelState& model) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (model.robot == shown_robot_ || !model.robot || !shown_robot_ ||
      !same_geometry(*model.robot, *shown_robot_)) {
    return;  // another model is shown by the cycle
  }
  draw(model);
}

/// The caller holds mutex_.
void SpherePublisher::draw(const ModelState& model) {
  shown_robot_ = model.robot;
  if (!shown_.markers.empty()) publish_message(publisher_, deleted(shown_));
  shown_.markers.clear();
  if (!model.robot) return;
  shown_ = sphere_markers(*model.robot, model.monitored, kMaxSpheresPerLink);
  publish_message(publisher_, shown_);
}

void SpherePublisher::repeat_after_clock_jump() {
  const std::lock_guard<std::mutex> lock(mutex_);
  repeat_delay_ = kFirstDelay;
  next_repeat_ = Clock::now() + repeat_delay_;
}

void SpherePublisher::repeat_when_due() {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock) return;
  if (Clock::now() < next_repeat_) return;
  publish_message(publisher_, shown_);
  repeat_delay_ *= 2;
  next_repeat_ =
      repeat_delay_ <= kLastDelay ? Clock::now() + repeat_delay_ : Clock::time_point::max();
}

}  // namespace ist
