#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <csignal>
#include <memory>

#include "ist_proximity/ros/velocity_filter_server.h"

namespace {

volatile std::sig_atomic_t told_to_end = 0;

void end(int) { told_to_end = 1; }

}  // namespace

int main(int argc, char** argv) {
  // Told to end, roscpp publishes nothing any more: the last velocity, 0, has to be sent before.
  ros::init(argc, argv, "filter", ros::init_options::NoSigintHandler);
  std::signal(SIGINT, end);
  std::signal(SIGTERM, end);
  ros::NodeHandle nh, private_nh("~");
  try {
    const auto server = std::make_unique<ist::VelocityFilterServer>(nh, private_nh);
    while (ros::ok() && told_to_end == 0) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
    }
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM("velocity_filter_node cannot start:\n" << error.what());
    return 1;
  }
  ros::shutdown();
  return 0;
}
