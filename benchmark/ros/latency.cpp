// Latency of answers through ROS: joint states at 1 kHz and an organized 640x480 cloud at 30 Hz,
// compared with a bare relay of the same messages in the same run. A roscore must be running.
//
// Publishers, server and relay are in one process, as nodelets in one manager are, so that no
// message is copied. With --tcp, the node and a node that only receives are processes of their own.

#include <ist_proximity/ProximityArray.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/ros/proximity_server.h"
#include "ros/latency/part.h"
#include "ros/latency/traffic.h"
#include "support.h"
#include "support/pcd.h"
#include "support/temp_dir.h"

namespace ist::benchmark {
namespace {

using ist_proximity::ProximityArray;

/// Measures the time from sending a message to its answers, by stamp: those of a relay, any
/// answers, and those that are OK. Others are DEGRADED: the deadline left bounds or repulsion less
/// exact than asked for. The first answer of a kind counts. Thread safe.
class Stopwatch {
 public:
  enum Kind { kRelay, kAny, kOk, kKinds };

  void sent(const ros::Time& stamp) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!counting_) return;
    ++count_;
    for (auto& kind : sent_) kind[stamp.toNSec()] = Clock::now();
  }
  void answered(Kind kind, const ros::Time& stamp) {
    const Clock::time_point now = Clock::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = sent_[kind].find(stamp.toNSec());
    if (found == sent_[kind].end()) return;
    const std::chrono::duration<double, std::milli> took = now - found->second;
    ms_[kind].push_back(took.count());
    sent_[kind].erase(found);
  }
  void count(bool counting) {
    const std::lock_guard<std::mutex> lock(mutex_);
    counting_ = counting;
  }

  std::string row(const std::string& robot, const char* what) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto share = [&](Kind kind) {
      return 100.0 * static_cast<double>(ms_[kind].size()) / std::max(1.0, count_);
    };
    const double p99 = quantile(ms_[kAny], 0.99), relay = quantile(ms_[kRelay], 0.99);
    return text_of("| %s | %s | %.2f %% | %.2f %% | %.2f / %.2f | %.2f / %.2f | %.2f |\n",
                   robot.c_str(), what, share(kAny), share(kOk), quantile(ms_[kAny], 0.5), p99,
                   quantile(ms_[kRelay], 0.5), relay, p99 / relay);
  }

 private:
  std::mutex mutex_;
  bool counting_ = false;
  double count_ = 0.0;
  std::array<std::map<std::uint64_t, Clock::time_point>, kKinds> sent_;
  std::array<std::vector<double>, kKinds> ms_;
};

/// The least that any node does with the same messages. Joint states are published unchanged on
/// `relayed`. Clouds are received, or also copied, and their header is published on `seen`.
class Relay {
 public:
  explicit Relay(bool copies_clouds) {
    relayed_ = states_.nh().advertise<sensor_msgs::JointState>("relayed", 100);
    seen_ = clouds_.nh().advertise<std_msgs::Header>("seen", 100);
    on_state_ = states_.nh().subscribe<sensor_msgs::JointState>(
        "joint_states", 100, [this](const auto& message) { relayed_.publish(message); }, {},
        ros::TransportHints().tcpNoDelay());
    on_cloud_ = clouds_.nh().subscribe<sensor_msgs::PointCloud2>(
        "cloud", 2, [this, copies_clouds](const sensor_msgs::PointCloud2ConstPtr& message) {
          if (copies_clouds) copy_ = boost::make_shared<sensor_msgs::PointCloud2>(*message);
          seen_.publish(boost::make_shared<std_msgs::Header>(message->header));
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

/// Subscribes to all answers in a thread of its own.
class Ears {
 public:
  Ears(Stopwatch* states, Stopwatch* clouds) {
    const auto hints = ros::TransportHints().tcpNoDelay();
    on_relayed_ = part_.nh().subscribe<sensor_msgs::JointState>(
        "relayed", 100,
        [=](const auto& m) { states->answered(Stopwatch::kRelay, m->header.stamp); }, {}, hints);
    on_seen_ = part_.nh().subscribe<std_msgs::Header>(
        "seen", 100, [=](const auto& m) { clouds->answered(Stopwatch::kRelay, m->stamp); }, {},
        hints);
    on_answer_ = part_.nh().subscribe<ProximityArray>(
        "latency_node/proximity", 100,
        [=](const auto& m) {
          is_ok_ = m->status == ProximityArray::OK;
          if (!is_ok_ && m->status != ProximityArray::DEGRADED) return;
          for (const auto kind : {Stopwatch::kAny, Stopwatch::kOk}) {
            if (kind == Stopwatch::kOk && !is_ok_) continue;
            states->answered(kind, m->header.stamp);
            clouds->answered(kind, m->cloud_stamp);
          }
        },
        {}, hints);
    part_.start();
  }
  ~Ears() { part_.stop(); }
  bool is_ok() const { return is_ok_; }

 private:
  Part part_;
  std::atomic<bool> is_ok_{false};
  ros::Subscriber on_relayed_, on_seen_, on_answer_;
};

/// A robot and what its camera sees.
struct Scene {
  std::string name, urdf, geometry;
  std::vector<Eigen::Vector3f> points;
  Eigen::Isometry3d X_RS = Eigen::Isometry3d::Identity();
};

/// Before a wavy wall.
Scene demo_scene() {
  Scene scene{
      "demo arm", test::read_text(IST_PROXIMITY_SOURCE_DIR "/demo/demo_arm.urdf"), "collision", {}};
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const float y = 0.004F * static_cast<float>(u - 320),
                  z = 0.004F * static_cast<float>(240 - v);
      const float x = 0.7F + 0.1F * std::sin(9.0F * y) * std::cos(7.0F * z);
      scene.points.emplace_back(x, y, z + 0.5F);
    }
  }
  return scene;
}

/// A Kinect frame.
Scene panda_scene(const std::filesystem::path& data) {
  Scene scene{"Panda", test::read_text(test::franka_package(data) + "/robots/panda.urdf"), "visual",
              test::read_pcd((data / "clouds/mosd0.pcd").string())};
  std::ifstream numbers(data / "clouds/T_base_cam.txt");
  for (int i = 0; i < 16; ++i) numbers >> scene.X_RS.matrix()(i / 4, i % 4);
  return scene;
}

/// Free joints swing about the middle of their ranges, at about 1 rad/s.
std::vector<double> positions_at(const Kinematics& kinematics, double t) {
  std::vector<double> positions;
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    const bool limited = std::isfinite(joint.lower) && std::isfinite(joint.upper);
    const double middle = limited ? 0.5 * (joint.lower + joint.upper) : 0.0;
    const double swing = limited ? std::min(0.5, 0.4 * (joint.upper - joint.lower)) : 0.5;
    const double phase = 2.0 * t + static_cast<double>(positions.size());
    positions.push_back(joint.is_free() ? middle + swing * std::sin(phase) : std::nan(""));
  }
  return positions;
}

/// The rows of a robot.
std::string measure(const Scene& scene, bool tcp, double seconds) {
  const GeometrySource source =
      scene.geometry == "visual" ? GeometrySource::kVisual : GeometrySource::kCollision;
  const Kinematics kinematics(parse_urdf(scene.urdf, source, environment_package_finder()));
  const test::TempDir cache;
  ros::param::set("robot_description", scene.urdf);
  ros::param::set("latency_node/pose_source", "joint_states");
  ros::param::set("latency_node/geometry", scene.geometry);
  ros::param::set("latency_node/cache_directory", cache.path());
  Stopwatch states, clouds;
  const Ears ears(&states, &clouds);
  std::unique_ptr<ProximityServer> server;
  std::unique_ptr<Relay> relay;
  std::unique_ptr<Process> node, receiver;
  if (tcp) {
    using Words = std::vector<std::string>;
    node = std::make_unique<Process>(Words{IST_PROXIMITY_NODE, "__name:=latency_node"});
    receiver = std::make_unique<Process>(Words{std::filesystem::read_symlink("/proc/self/exe"),
                                               "--receive", "__name:=latency_receiver"});
  } else {
    server = std::make_unique<ProximityServer>(ros::NodeHandle(), ros::NodeHandle("latency_node"));
    relay = std::make_unique<Relay>(true);
  }
  const auto content = make_cloud(scene.points);
  const Traffic traffic(kinematics, scene.X_RS,
                        {[&](const ros::Time& stamp) {
                           const std::vector<double> q = positions_at(kinematics, stamp.toSec());
                           states.sent(stamp);
                           return q;
                         },
                         [&] { return boost::make_shared<sensor_msgs::PointCloud2>(*content); },
                         [&](const ros::Time& stamp) { clouds.sent(stamp); }});
  while (ros::ok() && !ears.is_ok()) wait(0.1);
  wait(kPackingTime);
  for (Stopwatch* one : {&states, &clouds}) one->count(true);
  wait(seconds);
  for (Stopwatch* one : {&states, &clouds}) one->count(false);
  wait(0.5);  // for the last answers
  return states.row(scene.name, "joint state, answer") +
         clouds.row(scene.name, "cloud, first answer with it");
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  using namespace ist::benchmark;
  ros::init(argc, argv, "latency");
  bool tcp = false, receives = false;
  double seconds = 20.0;
  CommandLine line("Latency through ROS, beside a bare relay. A roscore must be running.");
  line.add_option("--seconds", seconds, "How long to measure each robot");
  line.add_flag("--tcp", tcp, "Node and receiver as processes of their own");
  line.add_flag("--receive", receives, "Be that receiver");
  line.read(argc, argv);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  if (receives) {
    const Relay relay(false);
    ros::waitForShutdown();
    return 0;
  }
  std::string table =
      "| robot | from, to | answered | OK | median / p99 [ms] | relay, median / p99 [ms] | p99 / "
      "relay's |\n|---|---|---|---|---|---|---|\n" +
      measure(demo_scene(), tcp, seconds);
  if (const auto data = ist::test::data_dir()) table += measure(panda_scene(*data), tcp, seconds);
  return ros::ok() ? line.publish(tcp ? "tcp" : "nodelets", table) : 1;
}
