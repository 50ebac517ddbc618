#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpc.h>

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/proximity/speed_scale.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/parameters/source_config.h"
#include "ros/parameters/zone_config.h"

namespace ist {

/// The origin of link poses: tf, or the node's kinematics fed with joint states.
enum class PoseSourceKind { kTf, kJointStates };

/// Parameters of ~self_proximity, which measures link against link.
struct SelfCollisionConfig {
  static constexpr double kRate = 50.0;  ///< [Hz] of ~self_proximity
  bool enabled = false;
  /// Its links count in ~min_distance, ~speed_scale and ~joint_repulsion.
  bool in_minimum = false;
};

/// The links whose volumes are packed for `penetration`.
enum class ContactsWanted {
  kAuto,  ///< those that something has come within the influence distance of
  kAll,   ///< all, from the start
  kNone
};

/// What is done about space that no memory knows: nothing; it counts in `lower_bound`; it is
/// described for each link.
enum class UnknownSpace { kFree, kObstacle, kReport };

/// ~query/deadline below 0 is this share of the period, with the sign changed: by default a cycle
/// may take three quarters of the time until the next one, so that no scene makes answers late.
constexpr double kDefaultDeadline = -0.75;

/// [s] The deadline of a cycle; 0: none.
/// @param parameter  ~query/deadline
/// @param period     [s] from one cycle to the next
inline double deadline_of(double parameter, double period) {
  return parameter < 0.0 ? -parameter * period : parameter;
}

/// ~joint_deceleration: with how much [rad/s^2, m/s^2] joints brake at least; 0: not known.
struct JointDeceleration {
  double other = 0.0;                      ///< of joints that are not in by_joint
  std::map<std::string, double> by_joint;  ///< by name

  bool is_stated() const { return other > 0.0 || !by_joint.empty(); }
  /// By joint of the kinematics.
  std::vector<double> of(const Kinematics& kinematics) const;
};

/// Parameters of ~trajectory.
struct TrajectoryConfig {
  double tolerance = 0.1;       ///< [rad, m] how far joints may be from the trajectory; > 0
  double obstacle_speed = 0.0;  ///< [m/s] obstacles may come this fast; >= 0
  std::string cancel_topic;     ///< of an action; empty: nothing is cancelled
};

/// The parameters that each cycle takes anew: live ones, and max_distance, read at the start only.
struct LiveConfig {
  LiveConfig() { query.deadline = kDefaultDeadline; }

  QueryConfig query;  ///< its deadline is the parameter, see deadline_of()
  RepulsionConfig repulsion;
  SpeedScaleConfig speed_scale;
  /// The contact bodies that are packed so far; may be null. This is no parameter.
  std::shared_ptr<const ContactModel> contacts;
};

/// All parameters of the node. Numbers that the core uses have their defaults in the core.
struct ServerConfig : LiveConfig {
  std::string robot_description = "robot_description";  ///< name of the parameter with the URDF
  std::string fixed_frame;                              ///< empty: the URDF's root link
  PoseSourceKind pose_source = PoseSourceKind::kTf;
  double pose_timeout = 0.5;  ///< [s] a link whose pose is older is UNKNOWN; > 0
  double rate = 100.0;        ///< [Hz] of ~proximity with kTf; > 0
  GeometrySource geometry = GeometrySource::kCollision;
  RobotModelConfig model;
  /// Links whose points self-filters drop. Empty: all with geometry, or the monitored ones.
  std::vector<std::string> self_filter_links;
  bool self_filter_all = false;
  ContactsWanted contacts_wanted = ContactsWanted::kAuto;  ///< ~penetration/enabled
  SelfCollisionConfig self_collision;
  JointDeceleration deceleration;
  TrajectoryConfig trajectory;
  /// Links that do not count in ~min_distance, ~speed_scale and the summary of the diagnostics.
  std::vector<std::string> ignore_links;
  bool fixed_links_count = false;  ///< ~min_distance/fixed_links: links that cannot move count too
  bool speed_scale_enabled = true;
  std::vector<SourceConfig> sources;
  std::vector<ZoneConfig> zones;
  UnknownSpace unknown_space = UnknownSpace::kFree;  ///< others need a memory
};

/// Parameters of the wrong type or out of range. The message has one line for each, with its name,
/// value, unit and range.
class ParameterError : public std::runtime_error {
 public:
  explicit ParameterError(const std::string& message) : std::runtime_error(message) {}
};

/// The add-ons that the node is built with, by the names of their folders.
const std::vector<std::string>& built_add_ons();

/// Reads and checks the parameters of the node's private namespace.
/// @param tree      a struct, or an invalid value when nothing is set
/// @param warnings  one sentence per parameter that has no effect or was adapted
/// @throws ParameterError with every mistake
ServerConfig parse_parameters(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* warnings);

/// Reads the private namespace from the parameter server; warnings go to the log.
/// @throws ParameterError
ServerConfig read_parameters(const ros::NodeHandle& private_nh);

/// Fetches all parameters of the private namespace in one call, so that they belong together.
/// @returns an invalid value when none is set; empty when the parameter server does not answer
std::optional<XmlRpc::XmlRpcValue> fetch_parameters(const ros::NodeHandle& private_nh);

/// The live parameters of a tree, and how they were found.
struct LiveReading {
  ServerConfig config;
  std::set<std::string> found;      ///< names that the tree has
  std::vector<std::string> errors;  ///< one sentence for each that is wrong
};

/// Reads the live parameters again. What the tree lacks, or has wrong, keeps its value in `last`;
/// distances of the speed scale that do not go together leave all of its last values.
/// @param tree  as fetch_parameters() returns it
/// @param last  the last valid values. Its max_distance limits the influence distance: nothing
///              farther away is measured, and the vector could not end in zero. Only the links that
///              have a distance of their own in it keep having one
LiveReading parse_live(const XmlRpc::XmlRpcValue& tree, const ServerConfig& last);

}  // namespace ist
