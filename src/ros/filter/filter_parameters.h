#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <string>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"

namespace ist {

/// The parameters of a velocity filter, read at its start (doc/control.md).
struct FilterConfig {
  RowConfig rows;
  /// "trajectory_msgs/JointTrajectory", "std_msgs/Float64MultiArray", "sensor_msgs/JointState",
  /// "geometry_msgs/TwistStamped" or "geometry_msgs/Twist".
  std::string command_type = "trajectory_msgs/JointTrajectory";
  /// Joints of a Float64MultiArray, in order, or those that realise a twist; empty: all that have a
  /// position of their own.
  std::vector<std::string> joints;
  std::string tool;             ///< link that a twist moves; empty: the frame of one with a stamp
  bool self_proximity = false;  ///< the node's ~self_proximity bounds velocities, too
  double self_stop_distance = 0.01;  ///< [m] nearer than this, no links approach each other
  double command_timeout = 0.1;      ///< [s]
  double proximity_timeout = 0.2;    ///< [s] oldest answer that still counts
  double joint_timeout = 0.1;        ///< [s] oldest joint state that still counts
};

/// Reads what is below the private namespace.
/// @param tree    as the parameter server holds it
/// @param errors    one sentence for each parameter that cannot be used; empty: all can
/// @param warnings  one sentence for each parameter that nothing reads
FilterConfig read_filter_config(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* errors,
                                std::vector<std::string>* warnings);

}  // namespace ist
