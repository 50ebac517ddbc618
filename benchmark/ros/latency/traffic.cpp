#include "ros/latency/traffic.h"

#include <sensor_msgs/JointState.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <vector>

#include "ros/common/thread_name.h"
#include "support.h"
#include "support/pcd.h"

namespace ist::benchmark {
namespace {

constexpr std::uint32_t kWidth = 640, kHeight = 480;
constexpr char kCameraFrame[] = "latency_camera";

std::vector<Eigen::Vector3f> wavy_wall() {
  std::vector<Eigen::Vector3f> points;
  for (std::uint32_t v = 0; v < kHeight; ++v) {
    for (std::uint32_t u = 0; u < kWidth; ++u) {
      const float y = (static_cast<float>(u) - 320.0F) * 0.004F;
      const float z = (240.0F - static_cast<float>(v)) * 0.004F;
      points.emplace_back(0.7F + 0.1F * std::sin(9.0F * y) * std::cos(7.0F * z), y, z + 0.5F);
    }
  }
  return points;
}

std::vector<Eigen::Vector3f> points_of(const std::string& pcd) {
  std::vector<Eigen::Vector3f> points;
  if (!pcd.empty()) points = test::read_pcd(pcd);
  return points.empty() ? wavy_wall() : points;
}

/// Joint positions: all free joints swing about the middle of their ranges, at about 1 rad/s.
std::vector<double> positions_at(const Kinematics& kinematics, double t) {
  std::vector<double> positions;
  for (std::size_t j = 0; j < kinematics.joints().size(); ++j) {
    const Kinematics::Joint& joint = kinematics.joints()[j];
    if (!joint.is_free()) continue;
    const bool limited = std::isfinite(joint.lower) && std::isfinite(joint.upper);
    const double middle = limited ? 0.5 * (joint.lower + joint.upper) : 0.0;
    const double swing = limited ? std::min(0.5, 0.4 * (joint.upper - joint.lower)) : 0.5;
    positions.push_back(middle + swing * std::sin(2.0 * t + static_cast<double>(j)));
  }
  return positions;
}

}  // namespace

sensor_msgs::PointCloud2 make_cloud(const std::vector<Eigen::Vector3f>& points) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = kCameraFrame;
  cloud.width = kWidth;
  cloud.height = static_cast<std::uint32_t>(points.size()) / kWidth;
  cloud.point_step = 16;
  cloud.row_step = cloud.point_step * cloud.width;
  for (std::uint32_t i = 0; i < 3; ++i) {
    sensor_msgs::PointField field;
    field.name = std::string(1, static_cast<char>('x' + i));
    field.offset = 4 * i;
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.data.resize(static_cast<std::size_t>(cloud.row_step) * cloud.height);
  for (std::size_t i = 0; i < static_cast<std::size_t>(cloud.width) * cloud.height; ++i) {
    std::memcpy(&cloud.data[16 * i], points[i].data(), 12);
  }
  return cloud;
}

tf2_msgs::TFMessage camera_pose(const std::string& root, const Eigen::Isometry3d& X_RS) {
  const Eigen::Quaterniond q(X_RS.linear());
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  auto& transform = message.transforms[0];
  transform.header.stamp = ros::Time::now();
  transform.header.frame_id = root;
  transform.child_frame_id = kCameraFrame;
  transform.transform.rotation.x = q.x();
  transform.transform.rotation.y = q.y();
  transform.transform.rotation.z = q.z();
  transform.transform.rotation.w = q.w();
  transform.transform.translation.x = X_RS(0, 3);
  transform.transform.translation.y = X_RS(1, 3);
  transform.transform.translation.z = X_RS(2, 3);
  return message;
}

Traffic::Traffic(const Kinematics& kinematics, const std::string& pcd, const std::string& camera,
                 OnSend on_state, OnSend on_cloud)
    : kinematics_(kinematics), on_state_(std::move(on_state)), on_cloud_(std::move(on_cloud)) {
  place_camera(camera);
  states_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 10);
  clouds_ = nh_.advertise<sensor_msgs::PointCloud2>("cloud", 2);
  state_thread_ = std::thread([this] {
    name_thread("states");
    repeat(kStateRate, go_on_, [this] { send_state(); });
  });
  cloud_thread_ = std::thread([this, content = make_cloud(points_of(pcd))] {
    name_thread("clouds");
    repeat(kCloudRate, go_on_, [&] { send_cloud(content); });
  });
}

Traffic::~Traffic() {
  go_on_ = false;
  state_thread_.join();
  cloud_thread_.join();
}

void Traffic::place_camera(const std::string& file) {
  Eigen::Matrix4d X_RS = Eigen::Matrix4d::Identity();
  if (!file.empty()) {
    std::ifstream numbers(file);
    for (int i = 0; i < 16; ++i) numbers >> X_RS(i / 4, i % 4);
  }
  static_tf_ = nh_.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
  static_tf_.publish(camera_pose(kinematics_.bodies().front(), Eigen::Isometry3d(X_RS)));
}

void Traffic::send_state() {
  const auto message = boost::make_shared<sensor_msgs::JointState>();
  message->header.stamp = ros::Time::now();
  for (const Kinematics::Joint& joint : kinematics_.joints()) {
    if (joint.is_free()) message->name.push_back(joint.name);
  }
  message->position = positions_at(kinematics_, message->header.stamp.toSec());
  on_state_(message->header.stamp);
  states_.publish(message);
}

void Traffic::send_cloud(const sensor_msgs::PointCloud2& content) {
  const auto message = boost::make_shared<sensor_msgs::PointCloud2>(content);
  message->header.stamp = ros::Time::now();
  on_cloud_(message->header.stamp);
  clouds_.publish(message);
}

}  // namespace ist::benchmark
