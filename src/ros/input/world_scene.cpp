// The planning scenes of a known world: the part of WorldSource that reads and applies them.

#include <ros/console.h>
#include <ros/serialization.h>

#include <algorithm>
#include <chrono>
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

// Connections that are told apart. After more of them a full scene is asked for without need.
constexpr std::size_t kMaxConnections = 64;
// Requests begin no closer than this. Messages wait while a request is pending, so that the pause
// after it is twice as long as it took.
constexpr std::chrono::seconds kBetweenRequests(2);

std::string too_large(std::size_t size) {
  return "a planning scene has " + std::to_string(size) + " bytes; allowed are " +
         std::to_string(kMaxSceneSize);
}

// Reads a message of any type.
PlanningScene read_message(const topic_tools::ShapeShifter& message, const WorldLimits& limits,
                           const OctreeLimits& octomap) {
  PlanningScene scene;
  const bool is_scene = message.getDataType() == kPlanningSceneType;
  const std::optional<SceneLayout> layout = scene_layout(message.getMD5Sum());
  if (!is_scene || !layout) {
    scene.fault = "a " + printable(message.getDataType()) + " with md5sum " +
                  printable(message.getMD5Sum()) + " comes in; read are " + kPlanningSceneType +
                  " of Indigo to Melodic and of Noetic";
  } else if (message.size() > kMaxSceneSize) {
    scene.fault = too_large(message.size());
  } else {
    scene = read_planning_scene(bytes_of(message), *layout, limits, octomap);
  }
  return scene;
}

}  // namespace

void WorldSource::receive_scene(const ros::MessageEvent<const topic_tools::ShapeShifter>& event) {
  if (!running_) return;  // up to a thousand wait
  const bool is_other = is_other_publisher(event);
  use_scene([&] {
    PlanningScene scene = read_message(*event.getConstMessage(), config_.world.limits, config_.map);
    if (is_other && scene.is_diff) lose_scene();
    return scene;
  });
}

/// Whether a message comes by another connection than those of before. Its publisher may have begun
/// anew, or messages may have been lost in between.
bool WorldSource::is_other_publisher(
    const ros::MessageEvent<const topic_tools::ShapeShifter>& event) {
  const bool was_gone = std::exchange(is_publisher_gone_, false);
  const bool is_first = connections_.empty();
  const bool is_new = connections_.insert(event.getConnectionHeaderPtr()).second;
  if (connections_.size() > kMaxConnections) connections_.erase(connections_.begin());
  return (is_new && !is_first) || was_gone;
}

/// Applies a scene that has come by the topic or from the service.
void WorldSource::use_scene(const std::function<PlanningScene()>& read) {
  has_received_ = true;
  begin_work();
  guard(Kind::kMessage, [&] { apply_scene(read()); });
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
  end_work();
  note_receipt(ros::Time());
}

void WorldSource::apply_scene(const PlanningScene& scene) {
  if (!scene.fault.empty()) return note_fault(fault_of(Kind::kMessage), scene.fault);
  if (scene.is_diff) {
    attach_all(scene);
    change_all(scene.objects);
  } else {
    replace_from_topic([&] {
      remove_from_scene("");
      attach_all(scene);
      change_all(scene.objects);
    });
  }
  show_doubts(scene.notes);
  if (faults_.count(fault_of(Kind::kMessage)) > 0 && !scene.is_diff) return;
  if (!scene.is_diff) {
    has_full_scene_ = true;
    faults_.erase(fault_of(Kind::kScene));
  }
  use_octomap(scene);
  allow_collisions(scene);
}

/// Says what of the scene is not measured, or not used.
void WorldSource::show_doubts(std::vector<std::string> doubts) {
  const std::string unmeasured = attached_.sentence();
  if (!unmeasured.empty()) doubts.insert(doubts.begin(), unmeasured);
  const std::string doubt = join(doubts, "; ");
  if (!doubt.empty()) ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': " << doubt);
  update([&](SourceReport* report) { report->doubt = doubt; });
}

/// Takes the octomap of a scene in place of the one before. One that cannot be used is told, and
/// the one before stays until then.
void WorldSource::use_octomap(const PlanningScene& scene) {
  if (!scene.sets_octomap) return;
  const SceneOctomap& octomap = scene.octomap;
  if (!octomap.fault.empty()) {
    return note_fault(fault_of(Kind::kOctomap),
                      "the octomap of its planning scene cannot be used: " + octomap.fault);
  }
  std::shared_ptr<BoxIndex> index;
  if (!octomap.tree.occupied.empty()) {
    index = std::make_shared<BoxIndex>();
    index->build(octomap.tree.occupied);
  }
  octomap_ = std::move(index);
  octomap_frame_ = frame_of(octomap.frame);
  X_BM_ = octomap.X_BM;
  faults_.erase(fault_of(Kind::kOctomap));
  is_changed_ = true;
}

/// Notes that the publisher of scenes has ended: the next one need not have the same objects.
void WorldSource::note_publishers(std::uint32_t publishers) {
  if (publishers == 0 && publishers_ > 0) is_publisher_gone_ = true;
  publishers_ = publishers;
  if (publishers > 0 && is_publisher_gone_) {
    connections_.clear();  // the next one is not another one again
    lose_scene();
  }
  ask_for_scene();
}

/// Another publisher has begun: the objects of the last one stay until a full scene comes.
void WorldSource::lose_scene() {
  is_publisher_gone_ = false;
  if (config_.world.starts_empty || !has_full_scene_) return;
  has_full_scene_ = false;
  next_request_ = {};
  note_fault(fault_of(Kind::kScene),
             "the planning scene has another publisher than before, whose objects are not known: "
             "a full scene (is_diff false) is needed now");
  show_faults();
}

/// Asks for a full scene when there is a publisher: what it sends from now on will come as well.
void WorldSource::ask_for_scene() {
  if (!scene_request_ || has_full_scene_ || publishers_ == 0 || scene_request_->is_pending()) {
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  if (now < next_request_) return;
  next_request_ = now + kBetweenRequests;
  scene_request_->start();
}

void WorldSource::receive_answer() {
  SceneRequest::Answer answer;
  if (!scene_request_->take(&answer)) return;
  const auto now = std::chrono::steady_clock::now();
  const auto asked = next_request_ - kBetweenRequests;
  next_request_ = std::max(next_request_, now + 2 * (now - asked));
  if (!answer.fault.empty()) {
    ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': the full planning scene was "
                                              << "asked for, but " << answer.fault);
    return;
  }
  use_scene([&] {
    PlanningScene scene;
    if (answer.bytes.size() > kMaxSceneSize) {
      scene.fault = too_large(answer.bytes.size());
    } else {
      scene = read_planning_scene(answer.bytes, answer.layout, config_.world.limits, config_.map);
    }
    if (scene.fault.empty() && scene.is_diff)
      scene.fault = "a difference (is_diff) is no full scene";
    if (!scene.fault.empty()) scene.fault = scene_request_->service() + " answers: " + scene.fault;
    return scene;
  });
  if (has_full_scene_) {
    ROS_INFO_STREAM("source '" << config_.name << "': the full planning scene has come from "
                               << scene_request_->service());
  }
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
  to_restate_.erase(object.id);
  faults_.erase(object_fault(object.id));
}

/// @param name  empty: all objects that scenes have added
void WorldSource::remove_from_scene(const std::string& name) {
  is_changed_ = true;
  const std::set<std::string> names =
      name.empty() ? std::exchange(from_topic_, {}) : std::set<std::string>{name};
  for (const std::string& one : names) {
    faults_.erase({Kind::kClash, one});
    if (configured_.count(one) == 0) remove_object(one);  // else it is not the scene's
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
  const auto allow = [&](const std::string& id, const std::string& name,
                         std::vector<std::string> links) {
    const std::vector<std::string> more =
        allowed_.allowed_with(id, [this](const std::string& other) {
          return builder_.contains(other) || attached_.contains(other);
        });
    pairs += more.size();
    if (pairs <= kMaxAllowedPairs) links.insert(links.end(), more.begin(), more.end());
    builder_.set_allowed_links(name, std::move(links));
  };
  for (const std::string& name : from_topic_) allow(name, name, configured_contacts(name));
  for (const std::string& id : attached_.names()) {
    allow(id, AttachedObjects::name_in_world(id), links_of_attached(id));
  }
  is_changed_ = true;
  if (pairs <= kMaxAllowedPairs) return;
  ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name
                                            << "': the allowed collision matrix has " << pairs
                                            << " pairs of objects and links; the first "
                                            << kMaxAllowedPairs << " are used");
}

}  // namespace ist
