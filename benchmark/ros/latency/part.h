#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>

#include <boost/make_shared.hpp>

namespace ist::benchmark {

/// Subscribers and publishers with their own thread.
class Part {
 public:
  Part() { nh_.setCallbackQueue(&queue_); }
  ros::NodeHandle& nh() { return nh_; }
  void start() { spinner_.start(); }
  void stop() { spinner_.stop(); }

 private:
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::AsyncSpinner spinner_{1, &queue_};
};

/// The least that any node does with the same messages. Joint states are published unchanged on
/// `relayed`. Clouds are received, or also copied, and their header is published on `seen`.
class Relay {
 public:
  explicit Relay(bool copies_clouds) {
    relayed_ = states_.nh().advertise<sensor_msgs::JointState>("relayed", 100);
    seen_ = clouds_.nh().advertise<std_msgs::Header>("seen", 100);
    on_state_ = states_.nh().subscribe<sensor_msgs::JointState>(
        "joint_states", 100,
        [this](const sensor_msgs::JointStateConstPtr& m) { relayed_.publish(m); },
        ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
    on_cloud_ = clouds_.nh().subscribe<sensor_msgs::PointCloud2>(
        "cloud", 2, [this, copies_clouds](const sensor_msgs::PointCloud2ConstPtr& m) {
          if (copies_clouds) copy_ = boost::make_shared<sensor_msgs::PointCloud2>(*m);
          seen_.publish(boost::make_shared<std_msgs::Header>(m->header));
        });
    states_.start();
    clouds_.start();
  }
  ~Relay() {
    states_.stop();
    clouds_.stop();
  }

 private:
  Part states_, clouds_;
  ros::Publisher relayed_, seen_;
  ros::Subscriber on_state_, on_cloud_;
  sensor_msgs::PointCloud2Ptr copy_;
};

}  // namespace ist::benchmark
