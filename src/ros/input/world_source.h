#pragma once

#include <ist_proximity/WorldObjects.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>

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
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/robot/robot_description.h"
#include "ros/input/source.h"
#include "ros/input/world_faults.h"
#include "ros/parameters/source_config.h"
#include "ros/poses/joint_state_listener.h"

namespace ist {

/// A known world: objects from parameters, from a MoveIt scene file and from a topic
/// (WorldObjects), and the links of another robot. A thread of its own reads meshes and builds
/// hierarchies, so that no query waits for them.
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
              TransformBuffer* buffer);
  ~WorldSource() override { stop(); }

 private:
  void run() override;
  void guard(WorldFaultKind what, const std::function<void()>& function);
  void read_configured();
  void read_robot();
  std::string read_description(RobotDescription* description);
  void note_receipt(const ros::Time& stamp);
  void replace_from_topic(const std::function<void()>& change);
  void receive(const ist_proximity::WorldObjects& message);
  void apply(const ist_proximity::WorldObjects& message);
  void change_all(const std::vector<ist_proximity::WorldObject>& objects);
  void change(const ist_proximity::WorldObject& message, std::vector<WorldObject>* added);
  void append(const ist_proximity::WorldObject& message, std::vector<WorldObject>* added);
  void take_from_mirror(const ist_proximity::WorldObjects& message);
  void use_octomap(const ist_proximity::WorldOctomap& message);
  void note_silence();
  void remember_from_topic(const std::string& name);
  std::string frame_of(const std::string& stated) const;
  void add(WorldFaultKind what, const std::vector<WorldObject>& objects);
  void note_fault(const WorldFaultKey& key, const std::string& fault);
  void forget_faults(const std::string& name);
  void show_faults();
  void take_target();
  void publish();
  void publish_markers();

  const ros::NodeHandle nh_;
  ros::Publisher markers_;
  TransformBuffer& robot_buffer_;
  const std::string robot_prefix_;  ///< of the frames of the other robot's links in the buffer
  std::unique_ptr<JointStateListener> robot_joints_;  ///< null: its poses come from tf, or none

  // Used by the source's thread alone.
  WorldBuilder builder_;
  WorldFaults faults_;
  std::string incomplete_;  ///< what they say of the world
  WorldFaultLog fault_log_;
  std::shared_ptr<const RobotSurfaces> surfaces_;  ///< of target_.model
  bool is_robot_read_ = true, is_changed_ = false;
  std::chrono::steady_clock::time_point next_reading_;  ///< of the other robot's description
  std::set<std::string> from_topic_;                    ///< names of objects
  std::set<std::string> configured_;  ///< names of parameters, the file and the other robot
  bool is_mirror_ = false;            ///< whether the topic's sender mirrors a scene of its own
  bool is_silent_ = false;            ///< whether that sender is
  std::chrono::steady_clock::time_point mirrored_at_;  ///< receipt of its last message
  bool has_whole_scene_ = false;                       ///< whether all of that scene has come
  std::string doubt_;                                  ///< the mirror's
  std::shared_ptr<const BoxIndex> octomap_;            ///< of a mirror; null: none
  std::string octomap_frame_;
  /// Worlds that queries may still have: a large one takes milliseconds to free.
  std::vector<std::shared_ptr<const KnownWorld>> made_;
  Eigen::Isometry3d X_BM_ = Eigen::Isometry3d::Identity();  ///< octomap -> octomap_frame_
  ros::Time stamp_;
  const std::function<bool()> cancelled_ = [this] { return !running_.load(); };
};

}  // namespace ist
