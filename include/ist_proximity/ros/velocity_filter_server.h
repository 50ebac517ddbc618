#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace ist {

class CommandFilter;

/// Stands between a controller's commands and the robot: each command on ~command comes out on
/// ~safe_command as the nearest velocity that the proximity node's bounds prove not to touch, or as
/// 0, and ~filter_state says why (doc/control.md). Everything runs in the thread of the node
/// handles' callback queue.
class VelocityFilterServer {
 public:
  /// @throws std::invalid_argument with a sentence for each parameter that cannot be used
  VelocityFilterServer(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  /// Gives 0 once more.
  ~VelocityFilterServer();
  VelocityFilterServer(const VelocityFilterServer&) = delete;
  VelocityFilterServer& operator=(const VelocityFilterServer&) = delete;

 private:
  std::unique_ptr<CommandFilter> filter_;
};

}  // namespace ist
