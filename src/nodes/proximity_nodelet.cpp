#include <nodelet/nodelet.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "ist_proximity/ros/proximity_server.h"

namespace ist {

/// The node's server inside a nodelet manager: clouds arrive without being copied.
class ProximityNodelet : public nodelet::Nodelet {
  void onInit() override {
    const ros::NodeHandle private_nh = getMTPrivateNodeHandle();
    try {
      server_ = std::make_unique<ProximityServer>(getMTNodeHandle(), private_nh,
                                                  read_parameters(private_nh));
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM("ist_proximity/Proximity cannot start:\n" << error.what());
      throw;
    }
  }

  std::unique_ptr<ProximityServer> server_;
};

}  // namespace ist

PLUGINLIB_EXPORT_CLASS(ist::ProximityNodelet, nodelet::Nodelet)
