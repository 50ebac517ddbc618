#pragma once

#include <ist_proximity/IgnoreLinks.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "ros/common/lifetime.h"
#include "ros/model/model_loader.h"

namespace ist {

/// Answers ~ignore_links. Thread safe.
class IgnoreService {
 public:
  /// @param loader  outlives this
  IgnoreService(ros::NodeHandle private_nh, const ModelLoader& loader);

  /// The links that are left out now, by name.
  std::vector<std::string> names(const ros::Time& now) const;

 private:
  bool ignore(ist_proximity::IgnoreLinks::Request& request,
              ist_proximity::IgnoreLinks::Response& response);
  std::string fault_of(const ist_proximity::IgnoreLinks::Request& request) const;

  const ModelLoader& loader_;
  mutable std::mutex mutex_;  ///< guards the next one
  std::map<std::string, Lifetime> links_;
  ros::ServiceServer service_;
};

}  // namespace ist
