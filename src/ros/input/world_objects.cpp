// This part of WorldSource applies WorldObjects messages, also of a sender that mirrors a scene of
// its own, such as MoveIt's.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/input/world_conversion.h"
#include "ros/input/world_source.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

// A mirror says something every second.
constexpr std::chrono::seconds kSilence(5);

}  // namespace

void WorldSource::receive(const ist_proximity::WorldObjects& message) {
  if (!running_) return;  // up to a thousand wait
  is_changed_ |= !std::exchange(has_received_, true);
  begin_work();
  is_mirror_ = message.mirror;
  guard(Kind::kMessage, [&] { apply(message); });
  if (is_mirror_) guard(Kind::kMessage, [&] { take_from_mirror(message); });
  end_work();
  note_receipt(message.header.stamp);
}

/// @param stamp  of the message; zero: it states none
void WorldSource::note_receipt(const ros::Time& stamp) {
  const ros::Time now = ros::Time::now();
  stamp_ = stamp.isZero() ? now : std::min(stamp, now);
  if (std::isfinite(config_.timeout)) is_changed_ = true;  // the snapshot is as old as this one
  update([&](SourceReport* report) {
    ++report->messages;
    report->newest = stamp_.toSec();
  });
}

void WorldSource::apply(const ist_proximity::WorldObjects& message) {
  const std::size_t limit = config_.world.limits.max_objects;
  if (message.objects.size() > limit) {
    note_fault(fault_of(Kind::kMessage),
               "a message holds " + std::to_string(message.objects.size()) +
                   " objects; allowed are " + std::to_string(limit) +
                   ": it is not used, send all objects anew (replace_all)");
    return show_faults();
  }
  if (!message.replace_all) return change_all(message.objects);
  faults_.erase(fault_of(Kind::kMessage));
  replace_from_topic([&] { change_all(message.objects); });
}

/// Removes the objects of the topic and adds others. Where these exceed a limit, all stays as it
/// was.
void WorldSource::replace_from_topic(const std::function<void()>& change) {
  WorldBuilder builder = builder_;
  std::set<std::string> from_topic = from_topic_;
  WorldFaults faults = faults_;
  for (const std::string& name : from_topic_) {
    builder_.remove(name);
    forget_faults(name);
  }
  from_topic_.clear();
  faults_.erase(fault_of(Kind::kMany));
  faults_.erase(faults_.lower_bound(fault_of(Kind::kClash)),
                faults_.lower_bound(fault_of(Kind::kShape)));
  is_changed_ = true;
  change();
  const auto refused = faults_.find(fault_of(Kind::kMessage));
  if (refused == faults_.end()) return;
  // A limit is exceeded: the objects of before stay.
  faults[fault_of(Kind::kMessage)] = refused->second;
  builder_ = std::move(builder);
  from_topic_ = std::move(from_topic);
  faults_ = std::move(faults);
  show_faults();
}

void WorldSource::change_all(const std::vector<ist_proximity::WorldObject>& objects) {
  std::vector<WorldObject> added;
  for (const ist_proximity::WorldObject& object : objects) {
    try {
      change(object, &added);
    } catch (const ModelError& error) {
      // An older description that the message holds must not end the fault of this one.
      add(Kind::kMessage, std::exchange(added, {}));
      const bool is_clash = is_mirror_ && configured_.count(object.id) > 0;
      // A shape that could not be used stays unknown where the older one is moved.
      const bool is_move = object.operation == ist_proximity::WorldObject::MOVE;
      note_fault({is_clash  ? Kind::kClash
                  : is_move ? Kind::kObject
                            : Kind::kShape,
                  object.id},
                 "object '" + printable(object.id) + "': " + error.what());
    }
  }
  if (added.empty()) return show_faults();
  add(Kind::kMessage, added);
}

/// Applies what a message says of one object; objects to add are collected, because many are built
/// faster together.
void WorldSource::change(const ist_proximity::WorldObject& message,
                         std::vector<WorldObject>* added) {
  using Message = ist_proximity::WorldObject;
  if (is_mirror_ && configured_.count(message.id) > 0 && message.operation != Message::REMOVE) {
    throw ModelError(
        "it comes on the topic, and parameters, the file or the other robot state it as well; "
        "names must be unique in a source");
  }
  if (message.operation == Message::APPEND) return append(message, added);
  if (message.operation == Message::ADD) {
    remember_from_topic(message.id);
    added->push_back(to_world_object(message, config_.world, cancelled_));
    return;
  }
  if (!added->empty()) {  // in the order of the message
    add(Kind::kMessage, *added);
    added->clear();
  }
  is_changed_ = true;
  if (message.operation == Message::REMOVE) {
    faults_.erase({Kind::kClash, message.id});
    // A mirror means its own object, of which there is none.
    if (is_mirror_ && configured_.count(message.id) > 0) return;
    builder_.remove(message.id);
    from_topic_.erase(message.id);
    forget_faults(message.id);
  } else if (message.operation == Message::MOVE) {
    const std::string fault =
        builder_.move(message.id, frame_of(message.header.frame_id), to_object_pose(message.pose));
    if (!fault.empty()) throw ModelError(fault);
    faults_.erase(object_fault(message.id));
  } else {
    throw ModelError("operation is " + std::to_string(message.operation) +
                     "; allowed is 0 (ADD), 1 (REMOVE), 2 (MOVE), 3 (APPEND)");
  }
}

void WorldSource::forget_faults(const std::string& name) {
  faults_.erase(shape_fault(name));
  faults_.erase(object_fault(name));
}

/// Gives the object that the message adds just before another shape.
void WorldSource::append(const ist_proximity::WorldObject& message,
                         std::vector<WorldObject>* added) {
  WorldObject more = to_world_object(message, config_.world, cancelled_);
  if (added->empty() || added->back().name != message.id || added->back().frame != more.frame) {
    throw ModelError("a shape is appended to no object that its message adds just before");
  }
  WorldObject& object = added->back();
  GeometryElement& element = more.geometry.front();
  element.X_LE = object.X_BO.inverse() * more.X_BO * element.X_LE;
  object.geometry.push_back(std::move(element));
}

/// Notes that an object is removed when those of the topic are replaced. One that parameters, the
/// file or the other robot state as well stays, because nobody would send it again.
void WorldSource::remember_from_topic(const std::string& name) {
  // Names of objects that were never built are limited, too.
  const std::size_t most = 2 * config_.world.limits.max_objects;
  if (configured_.count(name) == 0 && from_topic_.size() < most) from_topic_.insert(name);
}

/// Notes what a message that was applied or refused says of the scene as a whole.
void WorldSource::take_from_mirror(const ist_proximity::WorldObjects& message) {
  mirrored_at_ = std::chrono::steady_clock::now();
  const WorldFaultKey scene = fault_of(Kind::kScene);
  const auto refused = faults_.find(fault_of(Kind::kMessage));
  if (refused != faults_.end()) {
    // It may have changed anything: the scene is not known any more.
    has_whole_scene_ = false;
    faults_[scene] = refused->second + "; a full scene (replace_all) is needed now";
    faults_.erase(refused);
    return show_faults();
  }
  has_whole_scene_ |= message.replace_all;
  if (!message.incomplete.empty()) {
    note_fault(scene, message.incomplete);
  } else if (has_whole_scene_) {
    faults_.erase(scene);
  } else if (faults_.count(scene) == 0) {
    note_fault(scene, "a full scene (replace_all) is needed before what changes it");
  }
  for (const ist_proximity::WorldOctomap& octomap : message.octomap) use_octomap(octomap);
  if (message.doubt != std::exchange(doubt_, message.doubt)) {
    update([&](SourceReport* report) { report->doubt = doubt_; });
    if (!doubt_.empty()) {
      ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': " << doubt_);
    }
  }
  show_faults();
}

/// Takes an octomap in place of the one before. One that cannot be used is told, and the one before
/// stays until then.
void WorldSource::use_octomap(const ist_proximity::WorldOctomap& message) {
  OctreeData data;
  data.id = message.id;
  data.is_binary = message.binary != 0;
  data.resolution = message.resolution;
  data.data = message.data.data();
  data.size = message.data.size();
  Octree tree;
  Eigen::Isometry3d X_BM = Eigen::Isometry3d::Identity();
  std::string fault, frame;
  if (data.size > 0) {
    try {
      frame = frame_of(message.header.frame_id);
      X_BM = to_object_pose(message.origin);
      fault = read_octree(data, &tree, config_.map);
    } catch (const ModelError& error) {
      fault = std::string("its origin: ") + error.what();
    }
  }
  if (!fault.empty()) {
    return note_fault(fault_of(Kind::kOctomap), "its octomap cannot be used: " + fault);
  }
  std::shared_ptr<BoxIndex> index;
  if (!tree.occupied.empty()) {
    index = std::make_shared<BoxIndex>();
    index->build(tree.occupied);
  }
  octomap_ = std::move(index);
  octomap_frame_ = frame;
  X_BM_ = X_BM;
  faults_.erase(fault_of(Kind::kOctomap));
  is_changed_ = true;
}

/// Says that the sender is silent, which repeats itself otherwise: what it has told is held as it
/// was.
void WorldSource::note_silence() {
  const bool is_silent = std::chrono::steady_clock::now() - mirrored_at_ > kSilence;
  if (is_silent == std::exchange(is_silent_, is_silent)) return;
  update([&](SourceReport* report) {
    report->doubt_of_sender =
        is_silent ? "nothing comes on " + report->topic +
                        " any more (planning_scene_bridge): its objects are held as they were"
                  : "";
  });
}

}  // namespace ist
