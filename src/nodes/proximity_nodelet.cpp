#include <nodelet/nodelet.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "ist_proximity/ros/proximity_server.h"

namespace ist {

/// Runs the server inside a nodelet manager, so that clouds arrive without being copied.
class ProximityNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      server_ = std::make_unique<ProximityServer>(getMTNodeHandle(), getMTPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM("ist_proximity/Proximity cannot start:\n" << error.what());
      throw;
    }
  }

  std::unique_ptr<ProximityServer> server_;
};

}  // namespace ist

PLUGINLIB_EXPORT_CLASS(ist::ProximityNodelet, nodelet::Nodelet)
