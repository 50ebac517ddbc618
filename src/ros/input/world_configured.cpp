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
#include "ros/input/world_conversion.h"
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
      note_fault(shape_fault(object.name), "object '" + object.name + "': " + error.what());
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

/// Makes the links of the other robot objects, whose frames move with it, as soon as its
/// description is there. Their poses come from tf, or from its joint states by the node's own
/// kinematics, which puts them into the buffer under names that no frame of tf has.
void WorldSource::read_robot() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_reading_) return;
  next_reading_ = now + kRobotPeriod;
  RobotDescription description;
  const std::string problem = read_description(&description);
  if (!problem.empty()) {
    if (faults_[fault_of(Kind::kRobot)] != problem) note_fault(fault_of(Kind::kRobot), problem);
    return show_faults();
  }
  faults_.erase(fault_of(Kind::kRobot));
  std::vector<WorldObject> links;
  for (LinkDescription& link : description.links) {
    WorldObject object;
    object.name = config_.world.robot.tf_prefix + link.name;
    object.frame = robot_prefix_ + link.name;
    object.geometry = std::move(link.geometry);
    object.margin = config_.world.margin;
    configured_.insert(object.name);
    if (link.error.empty()) {
      links.push_back(std::move(object));
    } else {
      note_fault(shape_fault(object.name), "the other robot's " + link.error);
    }
  }
  add(Kind::kRobot, links);
  is_robot_read_ = true;
  ROS_INFO_STREAM("source '" << config_.name << "': another robot of " << links.size()
                             << " links with geometry");
}

/// Reads the other robot's description from the parameter server, and places it in tf.
/// @returns empty, or why it cannot be read yet
std::string WorldSource::read_description(RobotDescription* description) {
  const OtherRobotConfig& robot = config_.world.robot;
  std::string key, urdf;
  if (!nh_.searchParam(robot.description, key) || !nh_.getParam(key, urdf)) {
    return "waiting for the parameter '" + robot.description + "' with the other robot's URDF";
  }
  std::shared_ptr<const Kinematics> kinematics;
  try {
    *description = parse_urdf(
        urdf, GeometrySource::kCollision, environment_package_finder(),
        [this](const std::string& /*link*/, const std::string& /*mesh*/) { return !cancelled_(); });
    kinematics = std::make_shared<const Kinematics>(*description);
  } catch (const ModelError& error) {
    return "the other robot's URDF in '" + key + "' cannot be used: " + error.what();
  }
  if (!robot_joints_) return "";
  const std::string base = without_slash(config_.world.frame_id);
  const std::string& root = description->root_link;
  geometry_msgs::TransformStamped placed;
  placed.header.frame_id = base.empty() ? robot.tf_prefix + root : base;
  placed.child_frame_id = robot_prefix_ + root;
  placed.transform.rotation.w = 1.0;
  std::string fault = robot_buffer_.add(placed, robot_prefix_, true, ros::Time());
  if (fault.empty()) robot_joints_->set_kinematics(kinematics);
  return fault;
}

/// @param what  the key of a fault of all of them
void WorldSource::add(WorldFaultKind what, const std::vector<WorldObject>& objects) {
  std::vector<WorldObject> complete;
  std::set<std::string> names;
  for (const WorldObject& object : objects) {
    const bool is_twice = builder_.contains(object.name) || !names.insert(object.name).second;
    if (what != Kind::kMessage && is_twice) {
      note_fault(shape_fault(object.name),
                 "object '" + printable(object.name) +
                     "' is stated twice, by parameters, the file or the other robot; "
                     "names must be unique in a source");
      continue;
    }
    complete.push_back(object);
    complete.back().frame = frame_or_fixed(object.frame);
    forget_faults(object.name);
    for (const auto& [link, name] : config_.world.allowed_contacts) {
      if (name == object.name) complete.back().allowed_links.push_back(link);
    }
  }
  const std::vector<WorldFault> faults = builder_.add(complete, cancelled_);
  for (const WorldFault& fault : faults) {
    note_fault(fault.object.empty() ? fault_of(what) : shape_fault(fault.object), fault.text);
  }
  is_changed_ = true;
  show_faults();
}

/// @param stated  by a message; may be empty
/// @throws ModelError
std::string WorldSource::frame_of(const std::string& stated) const {
  return frame_or_fixed(object_frame(stated, config_.world.frame_id));
}

}  // namespace ist
