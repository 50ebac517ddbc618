// This part of WorldSource reads the objects that parameters, the file and the other robot state,
// and adds objects of any origin.

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/geometry/mesh_io.h"
#include "internal/robot/package_resolver.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/world_file.h"
#include "ros/common/frame_name.h"
#include "ros/input/world_source.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

constexpr std::chrono::milliseconds kRobotPeriod(500);

std::string frame_or_fixed(const std::string& frame) {
  const std::string name = without_slash(frame);
  return name.empty() ? kFixedFrame : name;
}

}  // namespace

/// Reads the objects of the parameters and of the file.
void WorldSource::read_configured() {
  const WorldConfig& world = config_.world;
  std::vector<WorldObject> objects;
  for (const WorldObjectConfig& config : world.objects) {
    WorldObject object = config.object;
    try {
      if (!config.mesh.empty()) {
        GeometryElement element;
        element.source = config.mesh;
        element.shape = load_mesh(resolve_uri(config.mesh, environment_package_finder()),
                                  config.scale, cancelled_);
        object.geometry = {std::move(element)};
      }
      objects.push_back(std::move(object));
    } catch (const ModelError& error) {
      note_fault(object_fault(object.name), "object '" + object.name + "': " + error.what());
    }
  }
  if (!config_.file.empty()) {
    SceneFile scene = read_scene_file(config_.file, frame_or_fixed(world.frame_id), world.limits);
    if (!scene.fault.empty()) note_fault(fault_of(Kind::kConfigured), scene.fault);
    for (WorldObject& object : scene.objects) {
      object.margin = world.margin;
      objects.push_back(std::move(object));
    }
  }
  for (const auto& contact : world.allowed_contacts) {
    const std::string& allowed = contact.second;
    const bool is_object = std::any_of(objects.begin(), objects.end(),
                                       [&](const auto& object) { return object.name == allowed; });
    if (!is_object && !world.has_topic) {
      ROS_WARN_STREAM("source '" << config_.name << "': allowed_contacts names '" << allowed
                                 << "', which is no object");
    }
  }
  for (const WorldObjectConfig& config : world.objects) configured_.insert(config.object.name);
  for (const WorldObject& object : objects) configured_.insert(object.name);
  stamp_ = ros::Time::now();
  add(Kind::kConfigured, objects);
  ROS_INFO_STREAM("source '" << config_.name << "': a known world of " << builder_.size()
                             << " objects");
}

/// Reads the other robot's description as soon as it is there.
void WorldSource::read_robot() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_reading_) return;
  next_reading_ = now + kRobotPeriod;
  std::vector<WorldObject> links;
  std::vector<WorldFault> faults;
  const std::string problem = robot_->read(cancelled_, &links, &faults);
  if (!problem.empty()) {
    if (faults_[fault_of(Kind::kRobot)] != problem) note_fault(fault_of(Kind::kRobot), problem);
    return show_faults();
  }
  faults_.erase(fault_of(Kind::kRobot));
  for (WorldObject& link : links) {
    link.margin = config_.world.margin;
    configured_.insert(link.name);
  }
  add(Kind::kRobot, links);
  for (const WorldFault& fault : faults) {
    note_fault(object_fault(fault.object), fault.text);
    configured_.insert(fault.object);
  }
  show_faults();
  is_robot_read_ = true;
  ROS_INFO_STREAM("source '" << config_.name << "': another robot of " << links.size()
                             << " links with geometry");
}

/// @param what  the key of a fault of all of them
void WorldSource::add(WorldFaultKind what, const std::vector<WorldObject>& objects) {
  std::vector<WorldObject> complete;
  std::set<std::string> names;
  for (const WorldObject& object : objects) {
    const bool is_twice = builder_.contains(object.name) || !names.insert(object.name).second;
    if (what != Kind::kMessage && is_twice) {
      note_fault(object_fault(object.name),
                 "object '" + printable(object.name) +
                     "' is stated twice, by parameters, the file or the other robot; "
                     "names must be unique in a source");
      continue;
    }
    complete.push_back(object);
    complete.back().frame = frame_or_fixed(object.frame);
    faults_.erase(object_fault(object.name));
    const std::vector<std::string> links = configured_contacts(object.name);
    std::vector<std::string>& allowed = complete.back().allowed_links;
    allowed.insert(allowed.end(), links.begin(), links.end());
  }
  const std::vector<WorldFault> faults = builder_.add(complete, cancelled_);
  for (const WorldFault& fault : faults) {
    note_fault(fault.object.empty() ? fault_of(what) : object_fault(fault.object), fault.text);
  }
  is_changed_ = true;
  show_faults();
}

/// The links that ~allowed_contacts names for an object.
std::vector<std::string> WorldSource::configured_contacts(const std::string& object) const {
  std::vector<std::string> links;
  for (const auto& [link, name] : config_.world.allowed_contacts) {
    if (name == object) links.push_back(link);
  }
  return links;
}

/// @param stated  by a message; may be empty
std::string WorldSource::frame_of(const std::string& stated) const {
  return frame_or_fixed(stated.empty() ? config_.world.frame_id : stated);
}

}  // namespace ist
