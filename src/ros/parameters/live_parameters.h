#pragma once

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/node_handle.h>

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ros/parameters/parameters.h"

namespace ist {

/// Parameters that may change while the node runs: ~query/*, ~repulsion/* and
/// ~penetration/stiffness. They change on the parameter server, which is read again whenever the
/// owner asks, or through dynamic_reconfigure, in one group for each of the three names
/// (rqt_reconfigure; `rosrun dynamic_reconfigure dynparam set ~query ...`). A wrong value is
/// refused with a warning, and the last valid values stay in use.
///
/// This class speaks dynamic_reconfigure's messages without its generated server: a .cfg file would
/// state defaults and ranges a second time, and that server writes a whole group back at each
/// change, over a value that somebody else may just have set.
///
/// Thread safe.
class LiveParameters {
 public:
  /// @param config  as read at the start
  LiveParameters(const ros::NodeHandle& private_nh, const ServerConfig& config);

  LiveConfig get() const;

  /// Reads the parameter server again.
  void read_again();

 private:
  /// The topics and the service of one dynamic_reconfigure server.
  struct Group {
    std::string name;
    ros::Publisher descriptions, updates;
    ros::ServiceServer service;
    dynamic_reconfigure::Config published;
  };
  using Change = std::map<std::string, XmlRpc::XmlRpcValue>;  ///< new values by name below `~`

  void advertise(const std::string& name);
  bool set(Group* group, const dynamic_reconfigure::Reconfigure::Request& request,
           dynamic_reconfigure::Reconfigure::Response& response);
  void apply(const Change& change);
  void publish_updates();

  ros::NodeHandle private_nh_;
  const double max_distance_;
  std::mutex change_mutex_;  ///< held from reading the parameter server to the end of the change
  std::vector<std::unique_ptr<Group>> groups_;
  std::vector<Tunable> tunables_;
  mutable std::mutex live_mutex_;
  LiveConfig live_;
};

}  // namespace ist
