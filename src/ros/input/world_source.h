#pragma once

#include <ist_proximity/WorldObjects.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/proximity/planning_scene.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/known_world.h"
#include "ros/input/other_robot.h"
#include "ros/input/scene_request.h"
#include "ros/input/source.h"
#include "ros/input/world_faults.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// The frame of objects that stand still in the fixed frame, whatever that is.
constexpr const char* kFixedFrame = "(fixed frame)";

/// A known world: objects from parameters, from a MoveIt scene file and from a topic (WorldObjects
/// or moveit_msgs/PlanningScene), and the links of another robot. A thread of its own reads meshes
/// and builds hierarchies, so that no query waits for them.
///
/// Objects are placed when a query asks for them, at the poses of their frames at that time. Where
/// one of these is not known, or an object cannot be used, the source is not OK and says so.
class WorldSource : public Source {
 public:
  /// @param nh      in the namespace that the topic is relative to; its callback queue is for the
  ///                joint states of another robot
  /// @param buffer  outlives this
  /// @param private_nh  of ~world/NAME, the markers
  WorldSource(const SourceConfig& config, ros::NodeHandle nh, ros::NodeHandle private_nh,
              const TransformBuffer& buffer);
  ~WorldSource() override { stop(); }

 private:
  void run() override;
  void guard(WorldFaultKind what, const std::function<void()>& function);
  void read_configured();
  void read_robot();
  void subscribe(ros::NodeHandle* nh);
  void note_receipt(const ros::Time& stamp);
  void replace_from_topic(const std::function<void()>& change);
  void receive(const ist_proximity::WorldObjects& message);
  void apply(const ist_proximity::WorldObjects& message);
  template <typename Objects>
  void change_all(const Objects& objects);
  void change(const ist_proximity::WorldObject& message, std::vector<WorldObject>* added);
  void receive_scene(const ros::MessageEvent<const topic_tools::ShapeShifter>& event);
  bool is_other_publisher(const ros::MessageEvent<const topic_tools::ShapeShifter>& event);
  void use_scene(const std::function<PlanningScene()>& read);
  void apply_scene(const PlanningScene& scene);
  void show_doubts(std::vector<std::string> doubts);
  void note_publishers(std::uint32_t publishers);
  void lose_scene();
  void ask_for_scene();
  void receive_answer();
  void change(const SceneObject& object, std::vector<WorldObject>* added);
  void append(const SceneObject& object, std::vector<WorldObject>* added);
  void move(const SceneObject& object);
  void remove_from_scene(const std::string& name);
  void allow_collisions(const PlanningScene& scene);
  void use_octomap(const PlanningScene& scene);
  void attach_all(const PlanningScene& scene);
  void attach(const SceneAttachment& attachment);
  void detach(const SceneAttachment& attachment);
  WorldObject describe_attached(const SceneAttachment& attachment,
                                const std::optional<WorldObject>& in_world) const;
  std::vector<std::string> links_of_attached(const std::string& id) const;
  void remove_object(const std::string& name);
  void restate(const std::string& name, const std::string& frame);
  void restate_waiting();
  void remember_from_topic(const std::string& name);
  std::string frame_of(const std::string& stated) const;
  void add(WorldFaultKind what, const std::vector<WorldObject>& objects);
  void note_fault(const WorldFaultKey& key, const std::string& fault);
  void show_faults();
  std::vector<std::string> configured_contacts(const std::string& object) const;
  void take_target();
  void publish();
  void free_unused();
  void publish_markers();
  std::string place_frame(const std::string& fixed_frame, const std::string& frame,
                          const SnapshotRequest& request, Eigen::Isometry3d* X_FB,
                          Lag* lag) const override;
  bool is_in_tf(const std::string& frame) const override;

  ros::Publisher markers_;
  std::unique_ptr<OtherRobot> robot_;  ///< null: none

  // Used by the source's thread alone.
  WorldBuilder builder_;
  WorldFaults faults_;
  WorldFaultLog fault_log_;
  std::shared_ptr<const RobotSurfaces> surfaces_;  ///< of target_.model
  bool is_robot_read_ = true, is_changed_ = false;
  std::chrono::steady_clock::time_point next_reading_;  ///< of the other robot's description
  std::set<std::string> from_topic_;                    ///< names of objects
  std::set<std::string> configured_;  ///< names of parameters, the file and the other robot
  AllowedCollisions allowed_;         ///< of planning scenes
  bool has_full_scene_ = false;       ///< whether differences have something that they change
  AttachedObjects attached_;          ///< of planning scenes
  /// Objects by name, and the frames that they are to stand in as soon as tf knows where.
  std::map<std::string, std::string> to_restate_;
  std::shared_ptr<const BoxIndex> octomap_;  ///< of planning scenes; null: none
  std::string octomap_frame_;
  /// Worlds that queries may still have: a large one takes milliseconds to free.
  std::vector<std::shared_ptr<const KnownWorld>> made_;
  Eigen::Isometry3d X_BM_ = Eigen::Isometry3d::Identity();  ///< octomap -> octomap_frame_
  std::unique_ptr<SceneRequest> scene_request_;             ///< null: none is to be made
  std::chrono::steady_clock::time_point next_request_;
  /// The connections by which scenes have come, by their headers.
  std::set<boost::shared_ptr<ros::M_string>> connections_;
  std::uint32_t publishers_ = 0;    ///< at the last count
  bool is_publisher_gone_ = false;  ///< whether scenes had a publisher, and now have none
  ros::Time stamp_;
  const std::function<bool()> cancelled_ = [this] { return !running_.load(); };
};

/// @param objects  of a WorldObjects message or a scene
template <typename Objects>
void WorldSource::change_all(const Objects& objects) {
  std::vector<WorldObject> added;
  for (const auto& object : objects) {
    try {
      change(object, &added);
    } catch (const ModelError& error) {
      // An older description that the message holds must not end the fault of this one.
      add(WorldFaultKind::kMessage, std::exchange(added, {}));
      const bool is_clash = config_.world.is_planning_scene && configured_.count(object.id) > 0;
      note_fault({is_clash ? WorldFaultKind::kClash : WorldFaultKind::kObject, object.id},
                 "object '" + printable(object.id) + "': " + error.what());
    }
  }
  add(WorldFaultKind::kMessage, added);
}

}  // namespace ist
