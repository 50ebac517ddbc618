#include "ros/output/sphere_publisher.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>

#include "ros/common/publish.h"
#include "ros/output/markers.h"

namespace ist {
namespace {

constexpr std::size_t kMaxSpheresPerLink = 250;  // each sphere is a marker
constexpr std::chrono::seconds kFirstDelay(1), kLastDelay(4);
constexpr std::chrono::milliseconds kShadePeriod(500);
constexpr int kShades = 8;  // steps of the scale of nearness

// The step of a distance on the scale of nearness; -1: not known.
int shade_of(double distance, double max_distance) {
  if (std::isnan(distance)) return -1;
  return static_cast<int>(std::lround(kShades * std::clamp(distance / max_distance, 0.0, 1.0)));
}

}  // namespace

SpherePublisher::SpherePublisher(ros::NodeHandle private_nh)
    : publisher_(private_nh.advertise<visualization_msgs::MarkerArray>("spheres", 1, true)) {}

void SpherePublisher::show(const ModelState& model) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (model.robot == shown_robot_) return;
  shown_robot_ = model.robot;
  if (!shown_.markers.empty()) publish_message(publisher_, deleted(shown_));
  shown_.markers.clear();
  shades_.clear();
  next_shades_ = {};
  if (!model.robot) return;
  shown_ = sphere_markers(*model.robot, model.monitored, kMaxSpheresPerLink);
  publish_message(publisher_, shown_);
}

void SpherePublisher::show_nearness(const ist_proximity::ProximityArray& proximity,
                                    double max_distance) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock || shown_.markers.empty() || publisher_.getNumSubscribers() == 0) return;
  const auto now = Clock::now();
  if (now < next_shades_) return;
  std::vector<int> shades;
  std::map<std::string, std_msgs::ColorRGBA> color_of;
  for (const auto& link : proximity.links) {
    const int shade = shade_of(link.distance, max_distance);
    shades.push_back(shade);
    color_of[link.link] =
        nearness_color(shade < 0 ? link.distance : max_distance * shade / kShades, max_distance);
    color_of[link.link].a = kSphereAlpha;
  }
  if (shades == shades_) return;
  shades_ = shades;
  next_shades_ = now + kShadePeriod;
  for (visualization_msgs::Marker& marker : shown_.markers) {
    const auto color = color_of.find(marker.ns);
    if (color != color_of.end()) marker.color = color->second;
  }
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
