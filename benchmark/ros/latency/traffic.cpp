#include "ros/latency/traffic.h"

#include <sensor_msgs/JointState.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <chrono>
#include <cmath>
#include <cstring>

#include "support.h"

namespace ist::benchmark {
namespace {

constexpr char kCameraFrame[] = "latency_camera";
constexpr double kStateRate = 1000.0, kCloudRate = 30.0;  // [Hz]

/// Calls `send` at a rate [Hz] while `go_on` holds.
template <typename Send>
void repeat(double rate, const std::atomic<bool>& go_on, const Send& send) {
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / rate));
  for (auto next = Clock::now(); go_on; next = std::max(next + period, Clock::now() - period)) {
    std::this_thread::sleep_until(next);
    send();
  }
}

}  // namespace

sensor_msgs::PointCloud2Ptr make_cloud(const std::vector<Eigen::Vector3f>& points) {
  auto cloud = boost::make_shared<sensor_msgs::PointCloud2>();
  sensor_msgs::PointCloud2Modifier modifier(*cloud);
  modifier.setPointCloud2FieldsByString(1, "xyz");
  modifier.resize(points.size());
  cloud->header.frame_id = kCameraFrame;
  cloud->width = 640;
  cloud->height = static_cast<std::uint32_t>(points.size()) / cloud->width;
  cloud->row_step = cloud->width * cloud->point_step;
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::memcpy(&cloud->data[i * cloud->point_step], points[i].data(), sizeof points[i]);
  }
  return cloud;
}

Traffic::Traffic(const Kinematics& kinematics, const Eigen::Isometry3d& X_RS, const Source& source)
    : kinematics_(kinematics), source_(source) {
  tf2_msgs::TFMessage pose;
  pose.transforms.push_back(tf2::eigenToTransform(X_RS));
  pose.transforms[0].header.stamp = ros::Time::now();
  pose.transforms[0].header.frame_id = kinematics.bodies().front();
  pose.transforms[0].child_frame_id = kCameraFrame;
  static_tf_ = nh_.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
  static_tf_.publish(pose);
  states_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 10);
  clouds_ = nh_.advertise<sensor_msgs::PointCloud2>("cloud", 2);
  state_thread_ = std::thread([this] { repeat(kStateRate, go_on_, [this] { send_state(); }); });
  cloud_thread_ = std::thread([this] { repeat(kCloudRate, go_on_, [this] { send_cloud(); }); });
}

Traffic::~Traffic() {
  go_on_ = false;
  state_thread_.join();
  cloud_thread_.join();
}

void Traffic::send_state() {
  const auto message = boost::make_shared<sensor_msgs::JointState>();
  message->header.stamp = ros::Time::now();
  const std::vector<double> q = source_.positions(message->header.stamp);
  for (std::size_t j = 0; j < q.size(); ++j) {
    if (std::isnan(q[j])) continue;
    message->name.push_back(kinematics_.joints()[j].name);
    message->position.push_back(q[j]);
  }
  states_.publish(message);
}

void Traffic::send_cloud() {
  const sensor_msgs::PointCloud2Ptr message = source_.picture();
  message->header.stamp = ros::Time::now();
  source_.on_cloud(message->header.stamp);
  clouds_.publish(message);
}

}  // namespace ist::benchmark
