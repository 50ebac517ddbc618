#pragma once

#include <ros/init.h>
#include <ros/publisher.h>
#include <std_msgs/Float64.h>

namespace ist {

/// Publishes unless the node ends. roscpp traps in debug builds when a publisher is used that it
/// could not advertise, which happens where the node is told to end while it waits for the master.
template <typename Message>
void publish_message(const ros::Publisher& publisher, const Message& message) {
  if (publisher && ros::ok()) publisher.publish(message);
}

inline void publish_number(double value, const ros::Publisher& publisher) {
  std_msgs::Float64 message;
  message.data = value;
  publish_message(publisher, message);
}

}  // namespace ist
