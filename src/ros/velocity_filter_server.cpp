#include "ist_proximity/ros/velocity_filter_server.h"

#include "ros/filter/command_filter.h"

namespace ist {

VelocityFilterServer::VelocityFilterServer(const ros::NodeHandle& nh,
                                           const ros::NodeHandle& private_nh)
    : filter_(std::make_unique<CommandFilter>(nh, private_nh)) {}
VelocityFilterServer::~VelocityFilterServer() = default;

}  // namespace ist
