// How long an answer takes through ROS: joint states at 1 kHz and an organized 640x480 cloud at
// 30 Hz, publishers, server and a bare relay of the same messages in one process (as nodelets in
// one manager are), so that no message is copied and all share the same processors.
//
//   roscore & build/ros/benchmark/latency [--urdf FILE] [--pcd FILE --camera FILE] [--seconds 20]
//
// Without --pcd, the cloud is a wavy wall before the robot. Prints a table in Markdown.

#include <CLI/CLI.hpp>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>

#include <atomic>
#include <boost/make_shared.hpp>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <sstream>
#include <thread>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/package_resolver.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/ros/proximity_server.h"
#include "ist_proximity/ros/thread_name.h"
#include "support.h"
#include "support/pcd.h"
#include "support/temp_dir.h"

namespace ist::benchmark {
namespace {

using ist_proximity::ProximityArray;

constexpr std::uint32_t kWidth = 640, kHeight = 480;
constexpr double kStateRate = 1000.0, kCloudRate = 30.0;  // [Hz]

/// When messages were sent, by stamp, and how long their answers took.
class Stopwatch {
 public:
  void sent(const ros::Time& stamp) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (counting_) sent_[stamp.toNSec()] = Clock::now();
  }
  void answered(const ros::Time& stamp) {
    const Clock::time_point now = Clock::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = sent_.find(stamp.toNSec());
    if (found == sent_.end()) return;
    const std::chrono::duration<double, std::micro> took = now - found->second;
    took_.push_back(took.count());
    sent_.erase(found);  // the first answer counts
  }
  void start() {
    const std::lock_guard<std::mutex> lock(mutex_);
    counting_ = true;
  }
  void stop() {
    const std::lock_guard<std::mutex> lock(mutex_);
    counting_ = false;
  }
  double share_answered() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto all = static_cast<double>(took_.size() + sent_.size());
    return all > 0.0 ? static_cast<double>(took_.size()) / all : 0.0;
  }
  double median() { return quantile(took_, 0.5); }
  double p99() { return quantile(took_, 0.99); }

 private:
  std::mutex mutex_;
  bool counting_ = false;
  std::map<std::uint64_t, Clock::time_point> sent_;
  std::vector<double> took_;  ///< [us]
};

/// Subscribers and publishers with a thread of their own.
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

sensor_msgs::PointCloud2 make_cloud(const std::string& pcd) {
  std::vector<Eigen::Vector3f> points;
  if (!pcd.empty()) points = test::read_pcd(pcd);
  if (points.empty()) {
    for (std::uint32_t v = 0; v < kHeight; ++v) {
      for (std::uint32_t u = 0; u < kWidth; ++u) {
        const float y = (static_cast<float>(u) - 320.0F) * 0.004F;
        const float z = (240.0F - static_cast<float>(v)) * 0.004F;
        points.emplace_back(0.7F + 0.1F * std::sin(9.0F * y) * std::cos(7.0F * z), y, z + 0.5F);
      }
    }
  }
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = "latency_camera";
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

/// The camera, on the fixed frame.
void publish_camera(ros::NodeHandle* nh, const std::string& fixed_frame, const std::string& matrix,
                    ros::Publisher* publisher) {
  Eigen::Matrix4d X_FS = Eigen::Matrix4d::Identity();
  if (!matrix.empty()) {
    std::ifstream file(matrix);
    for (int i = 0; i < 16; ++i) file >> X_FS(i / 4, i % 4);
  }
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  auto& transform = message.transforms[0];
  transform.header.stamp = ros::Time::now();
  transform.header.frame_id = fixed_frame;
  transform.child_frame_id = "latency_camera";
  const Eigen::Quaterniond q(X_FS.topLeftCorner<3, 3>());
  transform.transform.rotation.x = q.x();
  transform.transform.rotation.y = q.y();
  transform.transform.rotation.z = q.z();
  transform.transform.rotation.w = q.w();
  transform.transform.translation.x = X_FS(0, 3);
  transform.transform.translation.y = X_FS(1, 3);
  transform.transform.translation.z = X_FS(2, 3);
  *publisher = nh->advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
  publisher->publish(message);
}

/// All free joints swing about the middle of their ranges, at about 1 rad/s.
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

/// [s] of processor time by thread name.
std::map<std::string, double> thread_times() {
  std::map<std::string, double> times;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream file(task.path() / "stat");
    std::string line;
    std::getline(file, line);
    const std::size_t open = line.find('('), close = line.rfind(')');
    if (close == std::string::npos) continue;
    std::istringstream rest(line.substr(close + 2));
    std::string skipped;
    for (int i = 0; i < 11; ++i) rest >> skipped;
    double user = 0.0, system = 0.0;
    rest >> user >> system;
    times[line.substr(open + 1, close - open - 1)] +=
        (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  }
  return times;
}

void print_row(const char* what, Stopwatch* answer, const char* other, Stopwatch* relay) {
  std::printf("| %s | %.2f %% | %.0f | %.0f | %s %.0f | %.0f | %.2f |\n", what,
              100.0 * answer->share_answered(), answer->median(), answer->p99(), other,
              relay->median(), relay->p99(), answer->p99() / relay->p99());
}

template <typename Send>
void repeat(double rate, const std::atomic<bool>& go_on, const Send& send) {
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / rate));
  for (auto next = Clock::now(); go_on; next = std::max(next + period, Clock::now() - period)) {
    std::this_thread::sleep_until(next);
    send();
  }
}

struct Options {
  std::string urdf = IST_PROXIMITY_SOURCE_DIR "/demo/demo_arm.urdf";
  std::string pcd, camera;
  std::string geometry = "collision";
  double seconds = 20.0;
};

void run(const Options& options) {
  std::stringstream urdf;
  urdf << std::ifstream(options.urdf).rdbuf();
  const GeometrySource geometry =
      options.geometry == "visual" ? GeometrySource::kVisual : GeometrySource::kCollision;
  const Kinematics kinematics(
      parse_urdf(urdf.str(), geometry, environment_package_finder()));
  const std::string root = kinematics.links().front();
  ros::NodeHandle nh;
  ros::NodeHandle private_nh("~");
  nh.setParam("robot_description", urdf.str());
  ros::Publisher static_tf;
  publish_camera(&nh, root, options.camera, &static_tf);

  Stopwatch state, state_relay, cloud, cloud_copy;
  std::atomic<std::uint8_t> status{ProximityArray::MODEL_ERROR};
  Part relay, copier, ears;
  auto relayed = relay.nh().advertise<sensor_msgs::JointState>("relayed", 10);
  auto on_state = relay.nh().subscribe<sensor_msgs::JointState>(
      "joint_states", 10,
      [&](const sensor_msgs::JointStateConstPtr& m) { relayed.publish(m); });
  auto copied = copier.nh().advertise<sensor_msgs::PointCloud2>("copied", 2);
  auto on_cloud = copier.nh().subscribe<sensor_msgs::PointCloud2>(
      "cloud", 2, [&](const sensor_msgs::PointCloud2ConstPtr& m) {
        copied.publish(boost::make_shared<sensor_msgs::PointCloud2>(*m));
      });
  auto on_relayed = ears.nh().subscribe<sensor_msgs::JointState>(
      "relayed", 100, [&](const sensor_msgs::JointStateConstPtr& m) {
        state_relay.answered(m->header.stamp);
      });
  auto on_copied = ears.nh().subscribe<sensor_msgs::PointCloud2>(
      "copied", 2, [&](const sensor_msgs::PointCloud2ConstPtr& m) {
        cloud_copy.answered(m->header.stamp);
      });
  auto on_answer = ears.nh().subscribe<ProximityArray>(
      private_nh.resolveName("proximity"), 100,
      [&](const ist_proximity::ProximityArrayConstPtr& m) {
        status = m->status;
        if (m->status != ProximityArray::OK) return;
        state.answered(m->header.stamp);
        cloud.answered(m->cloud_stamp);
      });
  for (Part* part : {&relay, &copier, &ears}) part->start();

  const test::TempDir cache;
  ServerConfig config = read_parameters(private_nh);
  config.pose_source = PoseSourceKind::kJointStates;
  config.geometry = geometry;
  config.model.cache_directory = cache.path();
  ProximityServer server(nh, private_nh, config);

  std::atomic<bool> go_on{true};
  auto states = nh.advertise<sensor_msgs::JointState>("joint_states", 10);
  std::thread state_thread([&] {
    name_thread("states");
    repeat(kStateRate, go_on, [&] {
      const auto message = boost::make_shared<sensor_msgs::JointState>();
      message->header.stamp = ros::Time::now();
      for (const Kinematics::Joint& joint : kinematics.joints()) {
        if (joint.is_free()) message->name.push_back(joint.name);
      }
      message->position = positions_at(kinematics, message->header.stamp.toSec());
      state.sent(message->header.stamp);
      state_relay.sent(message->header.stamp);
      states.publish(message);
    });
  });
  auto clouds = nh.advertise<sensor_msgs::PointCloud2>("cloud", 2);
  std::thread cloud_thread([&] {
    name_thread("clouds");
    const sensor_msgs::PointCloud2 content = make_cloud(options.pcd);
    repeat(kCloudRate, go_on, [&] {
      const auto message = boost::make_shared<sensor_msgs::PointCloud2>(content);
      message->header.stamp = ros::Time::now();
      cloud.sent(message->header.stamp);
      cloud_copy.sent(message->header.stamp);
      clouds.publish(message);
    });
  });

  while (ros::ok() && status != ProximityArray::OK) ros::WallDuration(0.1).sleep();
  ros::WallDuration(2.0).sleep();
  for (Stopwatch* one : {&state, &state_relay, &cloud, &cloud_copy}) one->start();
  auto before = thread_times();
  ros::WallDuration(options.seconds).sleep();
  auto after = thread_times();
  for (Stopwatch* one : {&state, &state_relay, &cloud, &cloud_copy}) one->stop();
  ros::WallDuration(0.5).sleep();  // the last answers
  go_on = false;
  state_thread.join();
  cloud_thread.join();
  for (Part* part : {&relay, &copier, &ears}) part->stop();

  std::printf("| from, to | answered | median us | p99 us | beside: median us | p99 us | ratio |\n"
              "| --- | --- | --- | --- | --- | --- | --- |\n");
  print_row("joint state -> message", &state, "relay", &state_relay);
  print_row("cloud -> first message with it", &cloud, "copy", &cloud_copy);
  std::printf("\n| thread | share of one processor |\n| --- | --- |\n");
  for (const auto& [name, time] : after) {
    const double share = (time - before[name]) / options.seconds;
    if (share >= 0.001) std::printf("| %s | %.1f %% |\n", name.c_str(), 100.0 * share);
  }
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  ros::init(argc, argv, "latency");
  ist::benchmark::Options options;
  CLI::App app("Latency through ROS, beside a bare relay. A roscore must be running.");
  app.add_option("--urdf", options.urdf, "Robot; default: the demo arm");
  app.add_option("--geometry", options.geometry, "collision or visual");
  app.add_option("--pcd", options.pcd, "An organized 640x480 cloud; default: a wavy wall");
  app.add_option("--camera", options.camera, "File with 4 x 4 numbers: sensor -> root link");
  app.add_option("--seconds", options.seconds, "How long to measure");
  CLI11_PARSE(app, argc, argv);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ist::benchmark::run(options);
}
