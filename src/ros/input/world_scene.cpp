// The planning scenes of a known world: the part of WorldSource that reads and applies them.

#include <ros/console.h>
#include <ros/serialization.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/common/text.h"
#include "ros/input/world_source.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

// The bytes of a message: as many as a file of a scene may have.
constexpr std::uint32_t kMaxSceneSize = kMaxMeshFileSize;
// Pairs of an object and a name that may touch it. They take 5 MB.
constexpr std::size_t kMaxAllowedPairs = 100000;

std::vector<std::uint8_t> bytes_of(const topic_tools::ShapeShifter& message) {
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream out(bytes.data(), message.size());
  message.write(out);
  return bytes;
}

// Reads a message of any type.
PlanningScene read_message(const topic_tools::ShapeShifter& message, const WorldLimits& limits) {
  PlanningScene scene;
  const bool is_scene = message.getDataType() == kPlanningSceneType;
  const std::optional<SceneLayout> layout = scene_layout(message.getMD5Sum());
  if (!is_scene || !layout) {
    scene.fault = "a " + printable(message.getDataType()) + " with md5sum " +
                  printable(message.getMD5Sum()) + " comes in; read are " + kPlanningSceneType +
                  " of Indigo to Melodic and of Noetic";
  } else if (message.size() > kMaxSceneSize) {
    scene.fault = "a planning scene has " + std::to_string(message.size()) +
                  " bytes; allowed are " + std::to_string(kMaxSceneSize);
  } else {
    scene = read_planning_scene(bytes_of(message), *layout, limits);
  }
  return scene;
}

}  // namespace

void WorldSource::receive_scene(const topic_tools::ShapeShifter::ConstPtr& message) {
  has_received_ = true;
  state_.begin_work();
  guard(Kind::kMessage, [&] { apply_scene(*message); });
  // A message that is not used may have changed anything: the scene is not known any more.
  const auto lost = faults_.find(fault_of(Kind::kMessage));
  if (lost != faults_.end()) {
    has_full_scene_ = false;
    faults_[fault_of(Kind::kScene)] = lost->second + "; a full scene (is_diff false) is needed now";
    faults_.erase(lost);
  } else if (!has_full_scene_ && faults_.count(fault_of(Kind::kScene)) == 0) {
    note_fault(fault_of(Kind::kScene),
               "only differences (is_diff) have come, and not what they change: a full scene is "
               "needed, or starts_empty");
  }
  show_faults();
  state_.end_work();
  note_receipt(ros::Time());
}

void WorldSource::apply_scene(const topic_tools::ShapeShifter& message) {
  const PlanningScene scene = read_message(message, config_.world.limits);
  const std::string doubt = join(scene.notes, "; ");
  if (!doubt.empty()) ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': " << doubt);
  state_.update([&](SourceReport* report) { report->doubt = doubt; });
  if (!scene.fault.empty()) return note_fault(fault_of(Kind::kMessage), scene.fault);
  if (scene.is_diff) {
    change_all(scene);
  } else {
    replace_from_topic([&] {
      remove_from_scene("");
      change_all(scene);
    });
    if (faults_.count(fault_of(Kind::kMessage)) > 0) return;
    has_full_scene_ = true;
    faults_.erase(fault_of(Kind::kScene));
  }
  allow_collisions(scene);
}

void WorldSource::change_all(const PlanningScene& scene) {
  std::vector<WorldObject> added;
  for (const SceneObject& object : scene.objects) {
    try {
      change(object, &added);
    } catch (const ModelError& error) {
      // An older description that the message holds must not end the fault of this one.
      add(Kind::kMessage, std::exchange(added, {}));
      const bool is_clash = configured_.count(object.id) > 0;
      note_fault({is_clash ? Kind::kClash : Kind::kObject, object.id},
                 "object '" + printable(object.id) + "': " + error.what());
    }
  }
  add(Kind::kMessage, added);
}

/// Applies what a scene says of one object; objects to add are collected, because many are built
/// faster together.
void WorldSource::change(const SceneObject& object, std::vector<WorldObject>* added) {
  using Operation = SceneObject::Operation;
  const bool is_appended =
      object.operation == Operation::kAppend && !added->empty() && added->back().name == object.id;
  if (object.operation != Operation::kAdd && !is_appended && !added->empty()) {
    add(Kind::kMessage, *added);  // in the order of the message
    added->clear();
  }
  if (object.operation == Operation::kRemove) return remove_from_scene(object.id);
  if (configured_.count(object.id) > 0) {
    throw ModelError(
        "it is in the planning scene, and parameters, the file or the other robot state it as "
        "well; names must be unique in a source");
  }
  remember_from_topic(object.id);
  if (!object.fault.empty()) throw ModelError(object.fault);
  if (object.operation == Operation::kMove) return move(object);
  if (object.operation == Operation::kAppend) return append(object, added);
  added->push_back(to_world_object(object, config_.world.frame_id));
  added->back().margin = config_.world.margin;
}

void WorldSource::append(const SceneObject& object, std::vector<WorldObject>* added) {
  SceneObject placed = object;
  placed.frame = frame_of(object.frame);
  std::optional<WorldObject> known;
  if (!added->empty()) {
    known = std::move(added->back());  // the object of this name
    added->pop_back();
    known->frame = frame_of(known->frame);
  } else {
    known = builder_.object(object.id);
  }
  std::string fault;
  if (known) {
    fault = append_shapes(placed, "", &*known);
    known->allowed_links.clear();  // these are added anew
  } else {
    known = to_world_object(placed, "");
    known->margin = config_.world.margin;
  }
  added->push_back(*std::move(known));
  if (!fault.empty()) throw ModelError(fault);
}

void WorldSource::move(const SceneObject& object) {
  is_changed_ = true;
  Eigen::Isometry3d X_BO = object.X_BP;
  if (!object.X_PS.empty() || object.layout == SceneLayout::kShapePoses) {
    const std::optional<WorldObject> known = builder_.object(object.id);
    const std::string fault = known ? moved_pose(object, *known, &X_BO) : "";
    if (!fault.empty()) throw ModelError(fault);
  }
  const std::string fault = builder_.move(object.id, frame_of(object.frame), X_BO);
  if (!fault.empty()) throw ModelError(fault);
  faults_.erase(object_fault(object.id));
}

/// @param name  empty: all objects that scenes have added
void WorldSource::remove_from_scene(const std::string& name) {
  is_changed_ = true;
  const std::set<std::string> names =
      name.empty() ? std::exchange(from_topic_, {}) : std::set<std::string>{name};
  for (const std::string& one : names) {
    faults_.erase({Kind::kClash, one});
    if (configured_.count(one) > 0) continue;  // it is not the scene's
    builder_.remove(one);
    from_topic_.erase(one);
    faults_.erase(object_fault(one));
  }
  if (!name.empty()) return;
  faults_.erase(fault_of(Kind::kMany));
  faults_.erase(faults_.lower_bound(fault_of(Kind::kClash)),
                faults_.lower_bound(fault_of(Kind::kObject)));
}

/// Lets links touch the objects of scenes as their matrix says.
void WorldSource::allow_collisions(const PlanningScene& scene) {
  if (!config_.world.use_allowed_collisions) return;
  if (!scene.is_diff || scene.has_matrix) allowed_ = scene.allowed;
  std::size_t pairs = 0;
  for (const std::string& name : from_topic_) {
    std::vector<std::string> links = configured_contacts(name);
    const std::vector<std::string> more = allowed_.allowed_with(
        name, [this](const std::string& other) { return builder_.contains(other); });
    pairs += more.size();
    if (pairs <= kMaxAllowedPairs) links.insert(links.end(), more.begin(), more.end());
    builder_.set_allowed_links(name, std::move(links));
  }
  is_changed_ = true;
  if (pairs <= kMaxAllowedPairs) return;
  ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name
                                            << "': the allowed collision matrix has " << pairs
                                            << " pairs of objects and links; the first "
                                            << kMaxAllowedPairs << " are used");
}

}  // namespace ist
