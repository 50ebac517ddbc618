#pragma once

#include <actionlib_msgs/GoalID.h>
#include <ist_proximity/ProximityArray.h>
#include <ist_proximity/TrajectoryClearance.h>
#include <ros/ros.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <vector>

#include "depth_camera.h"
#include "internal/geometry/numbers.h"
#include "random_trajectory.h"
#include "ray_shape.h"
#include "ros/latency/part.h"
#include "ros/latency/traffic.h"

namespace ist::benchmark {

constexpr double kRadius = 0.1;  // [m] of a ball

inline sim::DepthCameraConfig camera_config() {
  sim::DepthCameraConfig config;
  config.X_FC = sim::looking_at(Eigen::Vector3d(2.0, 0.0, 0.5), Eigen::Vector3d(0.0, 0.0, 0.5));
  config.width = 640;
  config.height = 480;
  config.focal_length = 400.0;
  config.max_depth = 5.0;
  config.noise = 0.0;
  return config;
}

/// The robot, which follows its trajectory, the camera, and what the node says. Thread safe.
class World {
 public:
  explicit World(const Arm& arm) : arm_(arm) {
    ros::NodeHandle& nh = part_.nh();
    trajectories_ = nh.advertise<trajectory_msgs::JointTrajectory>("reaction_node/trajectory", 10);
    const auto hints = ros::TransportHints().tcpNoDelay();
    on_answer_ = nh.subscribe<ist_proximity::ProximityArray>(
        "reaction_node/proximity", 10, [this](const auto& message) { hear(*message); }, {}, hints);
    on_clearance_ = nh.subscribe<Clearance>(
        "reaction_node/trajectory_clearance", 100, [this](const auto& message) { hear(*message); },
        {}, hints);
    on_cancel_ = nh.subscribe<actionlib_msgs::GoalID>(
        "arm/cancel", 100, [this](const auto&) { hear_cancel(); }, {}, hints);
    pieces_ = straight_pieces(random_trajectory(arm, &random_));
    part_.start();
    traffic_.emplace(*arm.kinematics, camera_.config().X_FC,
                     Traffic::Source{[this](const ros::Time& stamp) { return positions(stamp); },
                                     [this] { return picture(); },
                                     [this](const ros::Time& stamp) { send_ball(stamp); }});
  }
  ~World() {
    traffic_.reset();
    part_.stop();
  }

  bool is_ok() const { return is_ok_; }
  bool is_clear() const { return is_clear_; }
  bool sees(const Eigen::Vector3d& p_F) const { return camera_.has_in_view(p_F); }

  /// The robot goes to the trajectory's begin, and sends it.
  void begin(const JointTrajectory& path, const StraightPieces& pieces) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      pieces_ = pieces;
      start_ = ros::Time::now() + ros::Duration(0.3);
    }
    wait(0.1);
    trajectories_.publish(message_of(path));
  }
  /// [s] of the trajectory
  double time() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return (ros::Time::now() - start_).toSec();
  }
  void end() {
    trajectories_.publish(trajectory_msgs::JointTrajectory());
    const std::lock_guard<std::mutex> lock(mutex_);
    ball_.reset();
    is_clear_ = false;
  }
  void put_ball(const Eigen::Vector3d& center) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ball_ = center;
    ball_stamp_ = ros::Time();
    reaction_.reset();
    is_due_ = is_unknown_ = false;
  }
  /// [ms] From the first cloud with the ball until the goal was cancelled; none yet.
  std::optional<double> reaction() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return reaction_;
  }
  /// Whether a contact was told with the ball that was too near to wait with braking, and nothing
  /// else to cancel for.
  bool is_due() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return is_due_ && !is_unknown_;
  }

 private:
  using Clearance = ist_proximity::TrajectoryClearance;

  trajectory_msgs::JointTrajectory message_of(const JointTrajectory& path) {
    trajectory_msgs::JointTrajectory message;
    message.header.stamp = start_;
    message.points.resize(path.times.size());
    for (std::size_t j = 0; j < arm_.kinematics->joints().size(); ++j) {
      if (std::isnan(path.positions.front()[j])) continue;
      message.joint_names.push_back(arm_.kinematics->joints()[j].name);
      for (std::size_t k = 0; k < path.times.size(); ++k) {
        message.points[k].time_from_start = ros::Duration(path.times[k]);
        message.points[k].positions.push_back(path.positions[k][j]);
        message.points[k].velocities.push_back(path.velocities[k][j]);
      }
    }
    return message;
  }

  std::vector<double> positions(const ros::Time& stamp) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return ist::positions_at(pieces_, (stamp - start_).toSec());
  }

  sensor_msgs::PointCloud2Ptr picture() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      seen_ball_ = ball_;
    }
    std::vector<sim::Body> bodies;
    if (seen_ball_) {
      bodies.push_back({&ball_shape_, Eigen::Isometry3d(Eigen::Translation3d(*seen_ball_))});
    }
    return make_cloud(camera_.picture(bodies, &noise_));
  }
  void send_ball(const ros::Time& stamp) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (seen_ball_ && ball_stamp_.isZero()) ball_stamp_ = stamp;
  }

  void hear(const ist_proximity::ProximityArray& message) {
    is_ok_ = message.status == ist_proximity::ProximityArray::OK;
  }
  void hear(const Clearance& message) {
    is_clear_ = message.state == Clearance::CLEAR;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!ball_) return;
    is_unknown_ = is_unknown_ || message.state == Clearance::UNKNOWN;
    const bool is_contact = message.state == Clearance::CONTACT;
    is_due_ = is_due_ || (is_contact && message.brake <= message.header.stamp);
  }
  void hear_cancel() {
    const ros::Time now = ros::Time::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!ball_ || reaction_) return;
    // A cancel that nothing in the clouds asked for is no reaction.
    reaction_ = ball_stamp_.isZero() ? -kInfinity : 1e3 * (now - ball_stamp_).toSec();
  }

  const Arm& arm_;
  Random random_;
  // The camera sees a wall behind the robot, and a ball where there is one.
  const sim::RayShape ball_shape_{Shape(Sphere{kRadius})}, wall_{Shape(Box{{0.1, 8.0, 8.0}})};
  const sim::DepthCamera camera_{
      camera_config(), {{&wall_, Eigen::Isometry3d(Eigen::Translation3d(-1.5, 0.0, 0.5))}}};
  sim::Rng noise_;
  std::optional<Eigen::Vector3d> seen_ball_;  // [m] in the newest image
  Part part_;
  ros::Publisher trajectories_;
  ros::Subscriber on_answer_, on_clearance_, on_cancel_;
  std::atomic<bool> is_ok_{false}, is_clear_{false};

  std::mutex mutex_;
  StraightPieces pieces_;
  ros::Time start_;                      // of the trajectory
  std::optional<Eigen::Vector3d> ball_;  // [m]
  ros::Time ball_stamp_;                 // of the first cloud with it; zero: none yet
  std::optional<double> reaction_;
  bool is_due_ = false, is_unknown_ = false;

  std::optional<Traffic> traffic_;
};

}  // namespace ist::benchmark
