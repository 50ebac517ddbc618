#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpc.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// One entry of ~sources.
struct SourceConfig {
  std::string name = "cloud";
  std::string topic = "cloud";  ///< as configured: relative to the node's namespace, remappable
  double timeout = 0.5;         ///< [s] older than this is STALE_CLOUD; > 0, may be inf
  bool required = true;         ///< false: its absence is reported in its own status only
  IngestConfig ingest;
};

/// Everything a node can be told. Numbers that the core knows have their defaults in the core.
struct ServerConfig {
  std::string robot_description = "robot_description";  ///< name of the parameter with the URDF
  std::string fixed_frame;                              ///< empty: the URDF's root link
  double pose_timeout = 0.5;  ///< [s] a link whose pose is older is UNKNOWN; > 0
  double rate = 100.0;        ///< [Hz] of ~proximity; > 0
  GeometrySource geometry = GeometrySource::kCollision;
  RobotModelConfig model;
  QueryConfig query;
  RepulsionConfig repulsion;
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

/// Reads ~repulsion/* again: these may change while the node runs.
/// @param max_distance  [m] the influence distance ends there at the latest: beyond it nothing is
///                      measured, and the vector could not end in zero
/// @throws ParameterError
RepulsionConfig read_repulsion(const ros::NodeHandle& private_nh, double max_distance);

}  // namespace ist
