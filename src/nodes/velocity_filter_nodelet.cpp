#include <nodelet/nodelet.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "ist_proximity/ros/velocity_filter_server.h"

namespace ist {

/// Runs the filter of velocities inside a nodelet manager, beside the proximity nodelet.
class VelocityFilterNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      server_ = std::make_unique<VelocityFilterServer>(getNodeHandle(), getPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM("ist_proximity/VelocityFilter cannot start:\n" << error.what());
      throw;
    }
  }

  std::unique_ptr<VelocityFilterServer> server_;
};

}  // namespace ist

PLUGINLIB_EXPORT_CLASS(ist::VelocityFilterNodelet, nodelet::Nodelet)
