// The simulated demo arm and its cameras, with the interface of a real robot: joint states, clouds,
// and joint velocities as commands. It publishes the clock unless ~clock is false.
//
//   joint_states                published, sensor_msgs/JointState, 200 Hz
//   CAMERA/points               published, sensor_msgs/PointCloud2, `front` and `back`
//   /clock                      published, with ~clock
//   obstacles                   published, visualization_msgs/MarkerArray, their true poses
//   ~distance                   published, std_msgs/Float64 [m], the smallest true distance
//   joint_velocity_controller/command
//                               subscribed, std_msgs/Float64MultiArray [rad/s], by ~joints;
//                               commands older than ~command_timeout count as zero
//   ~cameras                    service, std_srvs/SetBool: false stops the cameras

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/SetBool.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "scene.h"
#include "simulation.h"

namespace ist::sim {
namespace {

constexpr std::int64_t kJointPeriod = 5;    // [steps]
constexpr std::int64_t kMarkerPeriod = 40;  // [steps]
constexpr int kMostSteps = 40;              // per timer event; more are dropped
constexpr double kMostLag = 0.1;            // [s] behind the wall clock, without ~clock

std::string frame_of(const DepthCamera& camera) { return camera.config().name + "_optical_frame"; }

sensor_msgs::PointCloud2 to_message(const Picture& picture) {
  sensor_msgs::PointCloud2 message;
  message.width = static_cast<std::uint32_t>(picture.width);
  message.height = static_cast<std::uint32_t>(picture.height);
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(4 * message.fields.size());
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    message.fields.push_back(field);
  }
  message.point_step = sizeof(Eigen::Vector3f);
  message.row_step = message.width * message.point_step;
  message.data.resize(message.row_step * message.height);
  const void* points = picture.points.data();
  std::memcpy(message.data.data(), points, message.data.size());
  return message;
}

visualization_msgs::Marker to_marker(const Obstacle& obstacle, double time) {
  visualization_msgs::Marker marker;
  marker.ns = obstacle.name;
  marker.pose = tf2::toMsg(obstacle.pose(time));
  Eigen::Vector3d size;
  if (const auto* sphere = std::get_if<Sphere>(&obstacle.shape)) {
    marker.type = visualization_msgs::Marker::SPHERE;
    size.setConstant(2.0 * sphere->radius);
  } else {
    marker.type = visualization_msgs::Marker::CUBE;
    size = std::get<Box>(obstacle.shape).size;
  }
  marker.scale.x = size.x();
  marker.scale.y = size.y();
  marker.scale.z = size.z();
  marker.color.r = 0.85F;
  marker.color.g = marker.color.b = obstacle.is_fixed() ? 0.8F : 0.25F;
  marker.color.a = obstacle.is_fixed() ? 0.25F : 0.8F;
  return marker;
}

}  // namespace

class SimulatorNode {
 public:
  SimulatorNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
      : own_clock_(private_nh.param("clock", true)),
        speed_(private_nh.param("speed", 1.0)),
        command_timeout_(private_nh.param("command_timeout", 0.1)) {
    std::string urdf;
    if (!nh.getParam("robot_description", urdf)) {
      throw std::runtime_error("the parameter robot_description is not set.");
    }
    if (!(speed_ > 0.0)) throw std::runtime_error("~speed must be more than 0.");
    const RobotDescription robot =
        parse_urdf(urdf, GeometrySource::kCollision, environment_package_finder());
    root_ = robot.root_link;
    const int seed = private_nh.param("seed", 1);
    std::vector<DepthCameraConfig> cameras = demo_cameras();
    for (DepthCameraConfig& camera : cameras) {
      camera.noise = private_nh.param("noise", camera.noise);
      camera.latency = private_nh.param("latency", camera.latency);
      camera.flying_pixels = private_nh.param("flying_pixels", camera.flying_pixels);
      camera.period = 1.0 / private_nh.param("camera_rate", 15.0);
    }
    world_ = std::make_unique<Simulation>(robot, demo_arm(), demo_obstacles(), cameras,
                                          static_cast<std::uint64_t>(seed));
    world_->arm().reset(start_position(private_nh));
    // The clock starts above 0, which means "no time yet".
    start_ = own_clock_ ? ros::Time(1000.0) : ros::Time::now();

    joints_ = nh.advertise<sensor_msgs::JointState>("joint_states", 100);
    obstacles_ = nh.advertise<visualization_msgs::MarkerArray>("obstacles", 10);
    distance_ = private_nh.advertise<std_msgs::Float64>("distance", 100);
    if (own_clock_) clock_ = nh.advertise<rosgraph_msgs::Clock>("/clock", 100);
    for (const DepthCamera& camera : world_->cameras()) {
      clouds_.push_back(
          nh.advertise<sensor_msgs::PointCloud2>(camera.config().name + "/points", 5));
    }
    command_subscriber_ =
        nh.subscribe("joint_velocity_controller/command", 1, &SimulatorNode::on_command, this,
                     ros::TransportHints().tcpNoDelay());
    service_ = private_nh.advertiseService("cameras", &SimulatorNode::on_cameras, this);
    publish_frames();
    // The timer runs on wall time, because this node publishes the ROS time.
    last_ = ros::WallTime::now();
    timer_ = nh.createWallTimer(ros::WallDuration(0.004), &SimulatorNode::on_timer, this);
  }

 private:
  Eigen::VectorXd start_position(const ros::NodeHandle& private_nh) const {
    const std::vector<double> q =
        private_nh.param("start", std::vector<double>{0.9, 0.5, 1.1, 0.0, 0.3, 0.0});
    if (q.size() != world_->arm().joints().size()) {
      throw std::runtime_error("~start needs a position for each of the arm's six joints.");
    }
    return Eigen::Map<const Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(q.size()));
  }

  void publish_frames() {
    std::vector<geometry_msgs::TransformStamped> transforms;
    for (const DepthCamera& camera : world_->cameras()) {
      geometry_msgs::TransformStamped transform = tf2::eigenToTransform(camera.config().X_FC);
      transform.header.stamp = start_;
      transform.header.frame_id = root_;
      transform.child_frame_id = frame_of(camera);
      transforms.push_back(transform);
    }
    broadcaster_.sendTransform(transforms);
  }

  void on_command(const std_msgs::Float64MultiArray& message) {
    const auto size = static_cast<std::size_t>(world_->arm().positions().size());
    command_.resize(0);
    if (message.data.size() != size) {
      ROS_WARN_THROTTLE(1.0, "a command holds %zu velocities, not %zu: the arm stops.",
                        message.data.size(), size);
      return;
    }
    const Eigen::Map<const Eigen::VectorXd> command(message.data.data(),
                                                    static_cast<Eigen::Index>(size));
    if (!command.allFinite()) {
      ROS_WARN_THROTTLE(1.0, "a command holds a NaN or infinite number: the arm stops.");
      return;
    }
    command_ = command;
    command_time_ = world_->time();
  }

  bool on_cameras(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
    world_->set_cameras_alive(request.data != 0);
    response.success = 1;
    return true;
  }

  void on_timer(const ros::WallTimerEvent& /*event*/) {
    const ros::WallTime now = ros::WallTime::now();
    due_ += speed_ * (now - last_).toSec() / Simulation::kStep;
    last_ = now;
    if (own_clock_) {
      due_ = std::min(due_, static_cast<double>(kMostSteps));
    } else {
      // The wall clock does not wait: simulation steps that are overdue for too long are skipped.
      due_ = (ros::Time::now() - start_).toSec() / Simulation::kStep - world_->time() * 1e3;
      if (due_ * Simulation::kStep > kMostLag) {
        start_ += ros::Duration(due_ * Simulation::kStep);
        due_ = 1.0;
      }
    }
    for (; due_ >= 1.0; due_ -= 1.0) step();
  }

  void step() {
    const bool is_fresh =
        command_.size() != 0 && world_->time() - command_time_ <= command_timeout_;
    world_->step(is_fresh ? command_ : Eigen::VectorXd::Zero(world_->arm().positions().size()));
    const std::int64_t count = std::llround(world_->time() / Simulation::kStep);
    const ros::Time stamp = start_ + ros::Duration(world_->time());
    if (count % kJointPeriod == 0) {
      if (own_clock_) {
        rosgraph_msgs::Clock clock;
        clock.clock = stamp;
        clock_.publish(clock);
      }
      publish_joints(stamp);
    }
    for (const Picture& picture : world_->take_pictures()) {
      sensor_msgs::PointCloud2 message = to_message(picture);
      message.header.stamp = start_ + ros::Duration(picture.stamp);
      message.header.frame_id = frame_of(world_->cameras()[picture.camera]);
      clouds_[picture.camera].publish(message);
    }
    if (count % kMarkerPeriod == 0) publish_truth(stamp);
  }

  void publish_joints(const ros::Time& stamp) {
    const Arm& arm = world_->arm();
    const std::vector<double> all = arm.all_positions(arm.positions());
    sensor_msgs::JointState message;
    message.header.stamp = stamp;
    for (std::size_t j = 0; j < all.size(); ++j) {
      if (std::isnan(all[j])) continue;
      message.name.push_back(arm.kinematics().joints()[j].name);
      message.position.push_back(all[j]);
      const auto found = std::find(arm.joints().begin(), arm.joints().end(), j);
      message.velocity.push_back(
          found == arm.joints().end() ? 0.0 : arm.velocities()[found - arm.joints().begin()]);
    }
    joints_.publish(message);
  }

  void publish_truth(const ros::Time& stamp) {
    visualization_msgs::MarkerArray array;
    for (const Obstacle& obstacle : world_->obstacles()) {
      array.markers.push_back(to_marker(obstacle, world_->time()));
      array.markers.back().header.stamp = stamp;
      array.markers.back().header.frame_id = root_;
    }
    obstacles_.publish(array);
    std_msgs::Float64 distance;
    distance.data = world_->nearest(10.0).distance;
    distance_.publish(distance);
  }

  bool own_clock_;
  double speed_, command_timeout_;
  std::string root_;
  std::unique_ptr<Simulation> world_;
  ros::Time start_;
  ros::WallTime last_;
  double due_ = 0.0;  // [steps]
  Eigen::VectorXd command_;
  double command_time_ = 0.0;  // [s] of the simulation
  ros::Publisher joints_, obstacles_, distance_, clock_;
  std::vector<ros::Publisher> clouds_;
  ros::Subscriber command_subscriber_;
  ros::ServiceServer service_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  ros::WallTimer timer_;
};

}  // namespace ist::sim

int main(int argc, char** argv) {
  ros::init(argc, argv, "simulator");
  try {
    const ist::sim::SimulatorNode node(ros::NodeHandle(), ros::NodeHandle("~"));
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM("simulator_node cannot start:\n" << error.what());
    return 1;
  }
  return 0;
}
