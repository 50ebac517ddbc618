#pragma once

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpc.h>

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "ros/parameters/parameters.h"

namespace ist {

/// Parameters that may change while the node runs: the live rows of the table. They change on the
/// parameter server, which is read again once a second, or through dynamic_reconfigure, in
/// groups_ (rqt_reconfigure; `rosrun dynamic_reconfigure dynparam set ~query ...`). Distances of
/// single links have no group.
///
/// Every value stays in use until a valid one replaces it, whatever happens to the parameter
/// server: no answer, a master that restarts, names that are deleted, values that are wrong.
/// problem() says so. A request through dynamic_reconfigure takes effect entirely or not at all;
/// one that names anything else than the group's parameters fails.
///
/// dynamic_reconfigure::Server takes requests that cannot be read, and first publishes values that
/// are not in use.
///
/// Thread safe.
class LiveParameters {
 public:
  /// @param config  as read at the start
  LiveParameters(const ros::NodeHandle& private_nh, const ServerConfig& config);

  LiveConfig get() const;

  /// Why values stay in use that the parameter server does not hold; empty when there are none.
  std::string problem() const;

  /// The parameters that were changed on the server and are read at the start only; empty: none.
  std::string without_effect() const;

 private:
  using Clock = std::chrono::steady_clock;
  using Values = std::map<std::string, XmlRpc::XmlRpcValue>;
  /// The topics and the service of one dynamic_reconfigure server.
  struct Group {
    const char* name;
    ros::Publisher descriptions = {}, updates = {};
    ros::ServiceServer service = {};
    dynamic_reconfigure::Config published = {};
  };

  void advertise(ServerConfig* defaults, Group* group);
  void read_again();
  bool read_server();
  bool set(Group* group, const dynamic_reconfigure::Config& wanted,
           dynamic_reconfigure::Config* answer);
  bool apply(const std::string& group, const Values& change);
  ServerConfig config() const;
  void take(const LiveReading& reading);
  void note_startup_changes(const XmlRpc::XmlRpcValue& tree);
  std::string lost_names(const std::set<std::string>& found) const;
  void set_problem(const std::string& problem);
  void log(const std::string& text);
  void publish_updates();

  ros::NodeHandle private_nh_;
  std::mutex change_mutex_;  ///< held from reading the parameter server to the end of the change
  Group groups_[4] = {{"query"}, {"repulsion"}, {"speed_scale"}, {"speed_scale/separation"}};
  std::set<std::string> configured_;  ///< live parameters that have been on the parameter server
  /// What is read at the start only, as it was then; empty until it is known.
  std::optional<Values> at_start_;
  std::string logged_;
  Clock::time_point logged_time_;

  mutable std::mutex live_mutex_;  ///< guards the members below
  ServerConfig live_;
  std::string problem_;
  std::string without_effect_;
  Clock::time_point asked_;  ///< when the server was asked that has not answered yet; else 0

  ros::SteadyTimer timer_;
};

}  // namespace ist
