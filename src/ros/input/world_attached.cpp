// The objects that planning scenes attach to links of the robot: the part of WorldSource that makes
// them move with their links.

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/common/frame_name.h"
#include "ros/input/world_source.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

std::string title(const SceneAttachment& attachment) {
  return "object '" + printable(attachment.object.id) + "', attached to link '" +
         printable(attachment.link) + "'";
}

}  // namespace

/// Applies what a scene says of attached objects, before what it says of its world's, as in MoveIt.
void WorldSource::attach_all(const PlanningScene& scene) {
  if (!scene.keeps_attached) {
    for (const std::string& id : attached_.names())
      remove_object(AttachedObjects::name_in_world(id));
    attached_.clear();
  }
  for (const SceneAttachment& attachment : scene.attachments) {
    try {
      if (attachment.object.operation == SceneObject::Operation::kRemove) {
        detach(attachment);
      } else {
        attach(attachment);
      }
    } catch (const ModelError& error) {
      note_fault(object_fault(AttachedObjects::name_in_world(attachment.object.id)),
                 title(attachment) + ": " + error.what());
    }
  }
}

/// Attaches an object. The object of the same name in the scene's world is there no more, unless
/// the attached one cannot be used.
void WorldSource::attach(const SceneAttachment& attachment) {
  const std::string &id = attachment.object.id, name = AttachedObjects::name_in_world(id);
  if (configured_.count(id) > 0 || (builder_.contains(name) && !attached_.contains(id))) {
    throw ModelError(
        "parameters, the file, the other robot or the scene's world have an object of "
        "that name as well; names must be unique in a source");
  }
  if (!attached_.attach(attachment)) throw ModelError("more objects are attached than max_objects");
  const std::optional<WorldObject> in_world =
      from_topic_.count(id) > 0 ? builder_.object(id) : std::nullopt;
  WorldObject object = describe_attached(attachment, in_world);
  // For a moment there would be one object too many.
  if (in_world) builder_.remove(id);
  add(Kind::kMessage, {object});
  const bool is_added =
      faults_.count(object_fault(name)) == 0 && faults_.count(fault_of(Kind::kMessage)) == 0;
  if (!is_added) {
    if (in_world) builder_.add({*in_world});
    return;
  }
  remove_object(id);
  restate(name, without_slash(attachment.link));
}

/// The attached object, in the frame that its pose is stated in.
WorldObject WorldSource::describe_attached(const SceneAttachment& attachment,
                                           const std::optional<WorldObject>& in_world) const {
  using Operation = SceneObject::Operation;
  const SceneObject& object = attachment.object;
  const std::string name = AttachedObjects::name_in_world(object.id);
  if (attachment.link.empty()) throw ModelError("no link is named");
  if (!object.fault.empty()) throw ModelError(object.fault);
  const bool grows = object.operation == Operation::kAppend && builder_.contains(name);
  if (grows || object.operation == Operation::kMove) {
    throw ModelError("it can neither be moved nor grow: send all of it with ADD");
  }
  WorldObject attached;
  if (!object.geometry.empty()) {
    attached = to_world_object(object, config_.world.frame_id);
    attached.frame = frame_of(attached.frame);
    attached.margin = config_.world.margin;
  } else if (in_world) {
    attached = *in_world;
  } else {
    throw ModelError("it has no shapes, and the scene's world has no object of this name");
  }
  attached.name = name;
  attached.allowed_links = links_of_attached(object.id);
  return attached;
}

/// The links that an attached object may touch, but for those of the scene's matrix.
std::vector<std::string> WorldSource::links_of_attached(const std::string& id) const {
  std::vector<std::string> links = attached_.touched_by(id);
  const std::vector<std::string> more = configured_contacts(id);
  links.insert(links.end(), more.begin(), more.end());
  return links;
}

/// Puts detached objects into the scene's world, where they are now.
void WorldSource::detach(const SceneAttachment& attachment) {
  for (const std::string& id : attached_.detach(attachment)) {
    const std::string name = AttachedObjects::name_in_world(id);
    std::optional<WorldObject> object = builder_.object(name);
    remove_object(name);
    // As in MoveIt, an object that the world has stays what it is.
    if (!object || builder_.contains(id)) continue;
    object->name = id;
    object->allowed_links.clear();
    remember_from_topic(id);
    add(Kind::kMessage, {*object});
    if (builder_.contains(id)) restate(id, frame_of(""));
  }
}

/// Removes an object that a scene has stated, and what is said of it.
void WorldSource::remove_object(const std::string& name) {
  is_changed_ = true;
  builder_.remove(name);
  from_topic_.erase(name);
  to_restate_.erase(name);
  faults_.erase(object_fault(name));
}

/// Makes an object stand in another frame from now on, where it is now. While the pose of the one
/// frame in the other is not known, the object stays in its frame, and that is a fault.
void WorldSource::restate(const std::string& name, const std::string& frame) {
  const std::optional<WorldObject> object = builder_.object(name);
  if (!object) return;
  const auto name_in_tf = [this](const std::string& one) {
    return one == kFixedFrame ? target_.fixed_frame : one;
  };
  const std::string from = name_in_tf(object->frame), to = name_in_tf(frame);
  Eigen::Isometry3d X_TB = Eigen::Isometry3d::Identity();
  std::string problem = "the robot's model is not ready yet";
  const bool is_known =
      !from.empty() && !to.empty() && ist::is_known(buffer_, to, from, ros::Time(), &problem);
  if (is_known) problem = look_up(buffer_, to, from, ros::Time(), &X_TB);
  if (problem.empty()) problem = builder_.move(name, frame, X_TB * object->X_BO);
  is_changed_ = true;
  if (problem.empty()) {
    to_restate_.erase(name);
    faults_.erase(object_fault(name));
    return show_faults();
  }
  const bool is_first = to_restate_.insert_or_assign(name, frame).second;
  if (!is_first) return;
  note_fault(object_fault(name), "object '" + printable(name) + "' moves with frame '" +
                                     printable(to) +
                                     "' from now on, but it is not known where: " + problem);
  show_faults();
}

/// Tries again to place the objects whose frames were not known.
void WorldSource::restate_waiting() {
  const std::map<std::string, std::string> waiting = to_restate_;
  for (const auto& [name, frame] : waiting) restate(name, frame);
}

}  // namespace ist
