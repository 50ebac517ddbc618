#include "ros/input/zone_store.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/input/world_markers.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

// Whether two zones of one name differ in nothing but their lifetime.
bool is_same(const ZoneConfig& a, const ZoneConfig& b) {
  return a.frame == b.frame && a.links == b.links && a.shape.index() == b.shape.index() &&
         zone_sizes(a.shape) == zone_sizes(b.shape) && a.X_BZ.matrix() == b.X_BZ.matrix();
}

bool is_before(const std::shared_ptr<LiveZone>& a, const std::shared_ptr<LiveZone>& b) {
  const auto key = [](const ZoneConfig& zone) {
    return std::make_pair(!zone.links.empty(), zone.name);
  };
  return key(a->config()) < key(b->config());
}

}  // namespace

ZoneStore::ZoneStore(const TransformBuffer& buffer, double max_age,
                     const std::vector<ZoneConfig>& zones)
    : buffer_(buffer), max_age_(max_age) {
  for (const ZoneConfig& zone : zones) set(zone, ros::Time::now());
}

std::string ZoneStore::set(const ZoneConfig& zone, const ros::Time& now) {
  std::string fault = zones_fault({zone});
  if (!fault.empty()) return fault;
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<ZoneConfig> all;
  std::shared_ptr<LiveZone> before;
  for (const std::shared_ptr<LiveZone>& other : zones_) {
    if (other->config().name == zone.name) {
      before = other;
    } else if (other->is_on(now)) {
      all.push_back(other->config());
    }
  }
  all.push_back(zone);
  fault = zones_fault(all);
  if (!fault.empty()) return fault;
  if (before && before->is_on(now) && is_same(before->config(), zone)) {
    before->lifetime().begin(zone.lifetime, now);
    return "";
  }
  if (before) before->remove();
  zones_.push_back(std::make_shared<LiveZone>(zone, now));
  zones_.erase(std::remove_if(zones_.begin(), zones_.end(),
                              [&now](const auto& one) { return !one->is_on(now); }),
               zones_.end());
  std::sort(zones_.begin(), zones_.end(), is_before);
  return "";
}

bool ZoneStore::remove(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = std::find_if(zones_.begin(), zones_.end(), [&name](const auto& zone) {
    return zone->config().name == name;
  });
  if (found == zones_.end()) return false;
  const bool was_on = (*found)->is_on(ros::Time::now());
  (*found)->remove();
  zones_.erase(found);
  return was_on;
}

std::vector<std::shared_ptr<LiveZone>> ZoneStore::newest(const ros::Time& now) const {
  std::vector<std::shared_ptr<LiveZone>> zones;
  const std::lock_guard<std::mutex> lock(mutex_);
  std::copy_if(zones_.begin(), zones_.end(), std::back_inserter(zones),
               [&now](const auto& zone) { return zone->is_on(now); });
  return zones;
}

std::string ZoneStore::look_up_zone(const std::string& fixed_frame, const LiveZone& zone,
                                    const ros::Time& time, Eigen::Isometry3d* X_FB) const {
  const std::string frame = without_slash(zone.config().frame);
  std::string problem = look_up(buffer_, fixed_frame, frame, time, X_FB);
  if (problem.empty()) return "";
  ros::Time stamp;
  std::string late = look_up_newest(buffer_, fixed_frame, frame, time, max_age_, X_FB, &stamp);
  return late.empty() && stamp > time ? problem : late;
}

PlacedZones ZoneStore::place(const std::string& fixed_frame, const ros::Time& time) const {
  PlacedZones placed;
  for (const std::shared_ptr<LiveZone>& live : newest(ros::Time::now())) {
    const ZoneConfig& config = live->config();
    Eigen::Isometry3d X_FB = Eigen::Isometry3d::Identity();
    if (!look_up_zone(fixed_frame, *live, time, &X_FB).empty()) continue;
    if (placed.links.empty()) placed.links.emplace_back();
    std::vector<std::string> links = config.links;
    std::sort(links.begin(), links.end());
    links.erase(std::unique(links.begin(), links.end()), links.end());
    const auto group = std::find(placed.links.begin(), placed.links.end(), links);
    Zone zone;
    zone.shape = config.shape;
    zone.X_FZ = X_FB * config.X_BZ;
    zone.group = static_cast<std::size_t>(group - placed.links.begin());
    if (group == placed.links.end()) placed.links.push_back(std::move(links));
    placed.zones.push_back(std::move(zone));
    placed.live.push_back(live);
  }
  return placed;
}

std::vector<std::string> ZoneStore::off(const std::string& fixed_frame,
                                        const ros::Time& now) const {
  std::vector<std::string> sentences;
  for (const std::shared_ptr<LiveZone>& zone : newest(now)) {
    Eigen::Isometry3d ignored;
    const std::string problem = look_up_zone(fixed_frame, *zone, now, &ignored);
    if (problem.empty()) continue;
    sentences.push_back("zone '" + zone->config().name + "' is off: " + problem);
  }
  return sentences;
}

std::string ZoneStore::summary(const ros::Time& now) const {
  std::vector<std::string> texts;
  for (const std::shared_ptr<LiveZone>& zone : newest(now)) {
    const ZoneConfig& config = zone->config();
    std::string text = "'" + config.name + "' for ";
    text += config.links.empty() ? "all links" : join(config.links, ", ");
    const double left = zone->lifetime().left(now);
    if (std::isfinite(left)) text += format_text(", %.1f s left", left);
    texts.push_back(std::move(text));
  }
  return join(texts, "; ");
}

visualization_msgs::MarkerArray ZoneStore::markers(const ros::Time& now) const {
  visualization_msgs::MarkerArray array;
  for (const std::shared_ptr<LiveZone>& zone : newest(now)) {
    const ZoneConfig& config = zone->config();
    visualization_msgs::Marker marker;
    marker.header.frame_id = without_slash(config.frame);
    marker.ns = config.name;
    marker.frame_locked = 1;
    marker.color.g = 0.7F;
    marker.color.b = 1.0F;
    marker.color.a = 0.25F;
    draw_shape(config.shape, config.X_BZ, &marker);
    array.markers.push_back(std::move(marker));
  }
  return array;
}

}  // namespace ist
