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

/// What may change while the node runs: ~query/*, ~repulsion/* and ~penetration/stiffness. Two ways
/// lead here: the parameter server, read again whenever the owner asks, and dynamic_reconfigure, in
/// one group for each of the three names (rqt_reconfigure; `rosrun dynamic_reconfigure dynparam set
/// ~query ...`). What is wrong is refused with a warning, and the last valid values go on.
///
/// Speaks dynamic_reconfigure's messages without its generated server: a .cfg file would state
/// defaults and ranges a second time, and that server writes a whole group back at each change,
/// over what somebody else may just have set.
///
/// Thread safe.
class LiveParameters {
 public:
  /// @param config  as read at the start
  LiveParameters(const ros::NodeHandle& private_nh, const ServerConfig& config);

  LiveConfig get() const;

  /// Asks the parameter server.
  void read_again();

 private:
  /// One of dynamic_reconfigure's servers.
  struct Group {
    std::string name;
    ros::Publisher descriptions, updates;
    ros::ServiceServer service;
    dynamic_reconfigure::Config shown;
  };
  using Change = std::map<std::string, XmlRpc::XmlRpcValue>;  ///< by name below `~`

  void advertise(const std::string& name);
  bool set(Group* group, const dynamic_reconfigure::Reconfigure::Request& request,
           dynamic_reconfigure::Reconfigure::Response& response);
  void take(const Change& change);
  void show();

  ros::NodeHandle private_nh_;
  const double max_distance_;
  std::mutex change_mutex_;  ///< from asking the parameter server to the end of the change
  std::vector<std::unique_ptr<Group>> groups_;
  std::vector<Tunable> tunables_;
  mutable std::mutex live_mutex_;
  LiveConfig live_;
};

}  // namespace ist
