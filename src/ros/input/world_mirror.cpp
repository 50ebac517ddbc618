// This part of WorldSource keeps to a sender that mirrors a scene of its own, such as MoveIt's.

#include <chrono>
#include <string>
#include <utility>

#include "ist_proximity/geometry/error.h"
#include "ros/common/frame_name.h"
#include "ros/input/world_conversion.h"
#include "ros/input/world_source.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

// A mirror says something every second.
constexpr std::chrono::seconds kSilence(5);

}  // namespace

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
  std::string fault;
  if (data.size > 0) {
    try {
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
  octomap_frame_ = frame_of(message.header.frame_id);
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

}  // namespace ist
