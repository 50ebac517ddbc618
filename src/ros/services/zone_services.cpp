#include "ros/services/zone_services.h"

#include <algorithm>

#include "internal/geometry/limits.h"
#include "internal/robot/package_resolver.h"
#include "ist_proximity/geometry/error.h"
#include "ros/common/frame_name.h"
#include "ros/common/publish.h"
#include "ros/common/text.h"
#include "ros/input/world_conversion.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

using ist_proximity::SetZone;

/// @throws ModelError naming the field that is wrong, its value and what is allowed
ZoneConfig to_zone(const SetZone::Request& request) {
  if (request.shape < SetZone::Request::BOX || request.shape > SetZone::Request::SPHERE) {
    throw ModelError("its shape is " + std::to_string(request.shape) +
                     "; allowed is 1 (box), 2 (cylinder), 3 (sphere)");
  }
  ist_proximity::WorldObject described;  // its numbers of shapes and its dimensions are the same
  described.shape = request.shape;
  described.dimensions = request.dimensions;
  ZoneConfig zone;
  zone.name = request.name;
  zone.frame = request.frame_id;
  zone.shape = to_element(described, environment_package_finder(), {}).shape;
  zone.X_BZ = to_object_pose(request.pose);
  zone.links = request.links;
  zone.lifetime = request.lifetime;
  return zone;
}

}  // namespace

ZoneServices::ZoneServices(ros::NodeHandle private_nh, const ServerConfig& config,
                           const TransformBuffer& buffer, const ModelLoader& loader,
                           ZoneStore* zones)
    : config_(config),
      buffer_(buffer),
      loader_(loader),
      zones_(*zones),
      markers_(private_nh.advertise<visualization_msgs::MarkerArray>("zones", 1, true)),
      services_{private_nh.advertiseService("set_zone", &ZoneServices::set, this),
                private_nh.advertiseService("remove_zone", &ZoneServices::remove, this)} {
  show();
}

void ZoneServices::show() {
  visualization_msgs::MarkerArray array = zones_.markers(ros::Time::now());
  const std::lock_guard<std::mutex> lock(mutex_);
  shown_.complete(&array);
  if (!array.markers.empty()) publish_message(markers_, array);
}

bool ZoneServices::set(SetZone::Request& request, SetZone::Response& response) {
  response.message = set_zone(request);
  response.success = response.message.empty();
  if (!response.success) {
    response.message = "zone '" + printable(request.name) + "' is not set: " + response.message;
    return true;
  }
  response.message = "zone '" + request.name + "' is set";
  const std::string without = without_effect();
  if (!without.empty()) response.message += "; " + without;
  show();
  return true;
}

/// @returns why it cannot be used; empty: it is
std::string ZoneServices::set_zone(const SetZone::Request& request) {
  const std::shared_ptr<const ModelState> model = loader_.state();
  if (!model->robot) return "the robot's model is not there yet";
  try {
    const ZoneConfig zone = to_zone(request);
    std::string fault = zones_fault({zone});
    if (!fault.empty()) return fault;
    std::string unknown = unmonitored_name(zone.links, *model);
    if (!unknown.empty()) return unknown;
    Eigen::Isometry3d ignored;
    const std::string lost = look_up(buffer_, fixed_frame_of(*model, config_),
                                     without_slash(zone.frame), ros::Time(), &ignored);
    if (!lost.empty()) return "nobody knows where its frame is: " + lost;
    return zones_.set(zone, ros::Time::now());
  } catch (const ModelError& error) {
    return error.what();
  }
}

bool ZoneServices::remove(ist_proximity::RemoveZone::Request& request,
                          ist_proximity::RemoveZone::Response& response) {
  response.success = zones_.remove(request.name);
  response.message = "zone '" + printable(request.name) +
                     (response.success ? "' is removed" : "' is none that is set");
  show();
  return true;
}

/// The sentence about sources for whose obstacles no zone holds; empty: there are none.
std::string ZoneServices::without_effect() const {
  std::vector<std::string> names;
  for (const SourceConfig& source : config_.sources) {
    if (!source.has_zones()) names.push_back("'" + source.name + "'");
    if (source.memory.enabled) names.push_back("'" + source.name + "/memory'");
  }
  return names.empty() ? "" : "zones have no effect on " + join(names, ", ");
}

std::vector<std::string> ZoneServices::remarks() const {
  const ros::Time now = ros::Time::now();
  const std::string summary = zones_.summary(now);
  const std::shared_ptr<const ModelState> model = loader_.state();
  if (summary.empty() || !model->robot) return {};
  std::vector<std::string> texts = zones_.off(fixed_frame_of(*model, config_), now);
  for (const ZoneConfig& zone : config_.zones) {
    std::string unknown = unmonitored_name(zone.links, *model);
    if (!unknown.empty()) texts.push_back("~zones/" + zone.name + "/links: " + unknown);
  }
  const std::string without = without_effect();
  if (!without.empty()) texts.push_back(without);
  return texts;
}

}  // namespace ist
