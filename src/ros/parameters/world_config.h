#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/proximity/known_world.h"

namespace ist {

/// The value of ~sources/NAME/type for a known world.
constexpr const char* kWorldType = "world";

/// The other message type that a known world may have.
constexpr const char* kPlanningSceneType = "moveit_msgs/PlanningScene";

/// An object of ~sources/NAME/objects.
struct WorldObjectConfig {
  WorldObject object;  ///< without geometry where `mesh` is set
  std::string mesh;    ///< URI of a mesh file, which the source's thread reads
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
};

/// Another robot as an obstacle.
struct OtherRobotConfig {
  std::string description;   ///< name of the parameter with its URDF; empty: none
  std::string tf_prefix;     ///< its links' frames in tf are this and the link's name
  std::string joint_states;  ///< topic; empty: the poses of its links come from tf
};

/// The parameters of a source of type `world`.
struct WorldConfig {
  std::string frame_id;  ///< of objects that state none; empty: the fixed frame
  std::vector<WorldObjectConfig> objects;
  OtherRobotConfig robot;
  bool has_topic = false;          ///< whether its topic is subscribed to
  bool is_planning_scene = false;  ///< whether that is a moveit_msgs/PlanningScene
  /// Service that is asked for the full scene while none has come; empty: none.
  std::string scene_service = "get_planning_scene";
  /// Whether planning scenes that are differences begin with an empty world.
  bool starts_empty = false;
  /// Whether pairs of the allowed collision matrix of planning scenes may touch.
  bool use_allowed_collisions = true;
  WorldLimits limits;
  double margin = 0.0;                         ///< [m] of objects that state none
  std::map<std::string, double> link_margins;  ///< [m] by name of a link
  /// Pairs of a link and an object that may touch.
  std::vector<std::pair<std::string, std::string>> allowed_contacts;
};

}  // namespace ist
