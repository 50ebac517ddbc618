#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace ist {

/// The whole of ist_proximity as the node and the nodelet run it: it subscribes to clouds and joint
/// states, measures in threads of its own and publishes the results (doc/parameters.md lists
/// topics, services and parameters). Services that change the model are answered from the callback
/// queue of `private_nh`, which the caller spins.
class ProximityServer {
 public:
  /// Reads the parameters and starts all threads; nothing is waited for.
  /// @param nh          namespace that topics like `cloud` are relative to
  /// @param private_nh  `~`: the namespace of parameters and results
  /// @throws std::runtime_error when parameters are wrong: one line each, with name, value, unit
  /// and
  ///         range
  ProximityServer(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  /// Stops all threads; packing is cut short.
  ~ProximityServer();
  ProximityServer(const ProximityServer&) = delete;
  ProximityServer& operator=(const ProximityServer&) = delete;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
