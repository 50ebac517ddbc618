#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpc.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/contact/contact_wrench.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/input/noise_filter.h"
#include "ros/parameters/parameter_reader.h"

namespace ist {

/// What a source sends.
enum class SourceType { kCloud, kScan, kMap };

/// The message type, as rostopic writes it, and what one such message is called.
const char* message_type(SourceType type);
const char* noun(SourceType type);

/// One entry of ~sources.
struct SourceConfig {
  std::string name = "cloud";
  SourceType type = SourceType::kCloud;
  std::string topic = "cloud";  ///< as configured: relative to the node's namespace, remappable
  /// Of a map that is read from a file, never stale, in place of a topic: absolute path.
  std::string file;
  std::string frame_id = "map";  ///< of the file's map
  double timeout = 0.5;          ///< [s] older than this is STALE_CLOUD; > 0, may be inf
  std::string timeout_parameter = "cloud_timeout";
  bool required = true;  ///< false: its absence is reported in its own status only
  IngestConfig ingest;
  NoiseFilterConfig noise;  ///< of clouds
};

/// Where link poses come from.
enum class PoseSourceKind { kTf, kJointStates };

/// Link against link.
struct SelfCollisionConfig {
  bool enabled = false;
  double rate = 50.0;  ///< [Hz] of ~self_proximity; > 0
  std::vector<std::pair<std::string, std::string>>
      ignore;                          ///< pairs of links, besides adjacent ones
  bool ignore_contact_at_rest = true;  ///< and those in contact with all joints at zero
};

/// Everything a node can be told. Numbers that the core knows have their defaults in the core.
struct ServerConfig {
  std::string robot_description = "robot_description";  ///< name of the parameter with the URDF
  std::string fixed_frame;                              ///< empty: the URDF's root link
  PoseSourceKind pose_source = PoseSourceKind::kTf;
  double pose_timeout = 0.5;  ///< [s] a link whose pose is older is UNKNOWN; > 0
  double rate = 100.0;        ///< [Hz] of ~proximity with kTf; > 0
  GeometrySource geometry = GeometrySource::kCollision;
  RobotModelConfig model;
  QueryConfig query;
  RepulsionConfig repulsion;
  bool contacts_wanted = true;  ///< ~penetration/enabled
  ContactConfig contacts;
  PenetrationConfig penetration;
  SelfCollisionConfig self_collision;
  std::vector<SourceConfig> sources;
};

/// Parameters that are of the wrong type or out of range: one line each, with name, value, unit and
/// what is allowed.
class ParameterError : public std::runtime_error {
 public:
  explicit ParameterError(const std::string& message) : std::runtime_error(message) {}
};

/// Checks and reads what the parameter server holds in the node's private namespace.
/// @param tree      a struct, or an invalid value when nothing is set
/// @param warnings  one sentence per parameter that has no effect or was adapted
/// @throws ParameterError with every mistake
ServerConfig parse_parameters(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* warnings);

/// Reads the private namespace from the parameter server; warnings go to the log.
/// @throws ParameterError
ServerConfig read_parameters(const ros::NodeHandle& private_nh);

/// What may change while the node runs.
struct LiveConfig {
  QueryConfig query;  ///< but for max_distance
  RepulsionConfig repulsion;
  PenetrationConfig penetration;
  /// Not a parameter: what contact volumes are computed with, as far as it is there; may be null.
  std::shared_ptr<const ContactModel> contacts;
};

/// What the parameter server holds in the private namespace, in one call: a consistent view.
XmlRpc::XmlRpcValue fetch_parameters(const ros::NodeHandle& private_nh);

/// Reads ~query/*, ~repulsion/* and ~penetration/stiffness again.
/// @param tree          as fetch_parameters() returns it
/// @param max_distance  [m] as it was at the start. The influence distance ends there at the
///                      latest: beyond it nothing is measured, and the vector could not end in zero
/// @param tunables      if not null: each of them, with its range
/// @throws ParameterError
LiveConfig parse_live(const XmlRpc::XmlRpcValue& tree, double max_distance,
                      std::vector<Tunable>* tunables = nullptr);

}  // namespace ist
