// Latency of answers through ROS: joint states at 1 kHz and an organized 640x480 cloud at 30 Hz,
// compared with a bare relay of the same messages in the same run.
//
//   roscore & build/ros/benchmark/latency [--tcp] [--urdf FILE] [--pcd FILE --camera FILE]
//
// Publishers, server and relay are in one process, as nodelets in one manager are, so that no
// message is copied. With --tcp, the node and a node that only receives are processes of their own.
// Prints rows of tables in Markdown; with --update-doc FILE they are put there too.

#include <ist_proximity/ProximityArray.h>
#include <ros/ros.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>

#include "document.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/ros/proximity_server.h"
#include "ros/latency/part.h"
#include "ros/latency/process.h"
#include "ros/latency/stopwatch.h"
#include "ros/latency/traffic.h"
#include "support/temp_dir.h"

namespace ist::benchmark {
namespace {

using ist_proximity::ProximityArray;

struct Options {
  std::string urdf = IST_PROXIMITY_SOURCE_DIR "/demo/demo_arm.urdf";
  std::string geometry = "collision";
  std::string pcd, camera;
  std::string document, run, name = "demo arm";
  double seconds = 20.0;
  bool tcp = false;
};

// An answer is OK, or DEGRADED: the deadline left bounds or repulsion less exact than asked for.
struct Stopwatches {
  Stopwatch state, relayed_state, cloud, seen_cloud;
  Stopwatch ok_state, ok_cloud;  // the same until an answer that is OK

  void count(bool counting) {
    for (Stopwatch* one : {&state, &relayed_state, &cloud, &seen_cloud, &ok_state, &ok_cloud}) {
      one->count(counting);
    }
  }
};

/// Subscribes to all answers in a thread of its own.
class Ears {
 public:
  Ears(const std::string& proximity, Stopwatches* watches) {
    const auto hints = ros::TransportHints().tcpNoDelay();
    on_relayed_ = part_.nh().subscribe<sensor_msgs::JointState>(
        "relayed", 100,
        [=](const sensor_msgs::JointStateConstPtr& m) {
          watches->relayed_state.answered(m->header.stamp);
        },
        ros::VoidConstPtr(), hints);
    on_seen_ = part_.nh().subscribe<std_msgs::Header>(
        "seen", 100,
        [=](const std_msgs::HeaderConstPtr& m) { watches->seen_cloud.answered(m->stamp); },
        ros::VoidConstPtr(), hints);
    on_answer_ = part_.nh().subscribe<ProximityArray>(
        proximity, 100,
        [=](const ist_proximity::ProximityArrayConstPtr& m) {
          is_ok_ = m->status == ProximityArray::OK;
          if (!is_ok_ && m->status != ProximityArray::DEGRADED) return;
          watches->state.answered(m->header.stamp);
          watches->cloud.answered(m->cloud_stamp);
          if (!is_ok_) return;
          watches->ok_state.answered(m->header.stamp);
          watches->ok_cloud.answered(m->cloud_stamp);
        },
        ros::VoidConstPtr(), hints);
    part_.start();
  }
  ~Ears() { part_.stop(); }
  bool is_ok() const { return is_ok_; }

 private:
  Part part_;
  std::atomic<bool> is_ok_{false};
  ros::Subscriber on_relayed_, on_seen_, on_answer_;
};

std::string row(const Options& options, const char* what, Stopwatch* answer, Stopwatch* ok,
                Stopwatch* relay) {
  std::array<char, 256> text{};
  std::snprintf(text.data(), text.size(),
                "| %s | %s | %.2f %% | %.2f %% | %.2f / %.2f | %.2f / %.2f | %.2f |\n",
                options.name.c_str(), what, 100.0 * answer->share_answered(),
                100.0 * ok->share_answered(), answer->took(0.5), answer->took(0.99),
                relay->took(0.5), relay->took(0.99), answer->took(0.99) / relay->took(0.99));
  return text.data();
}

std::string latency_table(const Options& options, Stopwatches* watches) {
  return row(options, "joint state, answer", &watches->state, &watches->ok_state,
             &watches->relayed_state) +
         row(options, "cloud, first answer with it", &watches->cloud, &watches->ok_cloud,
             &watches->seen_cloud);
}

/// Writes this robot's rows to the document, after those of other robots.
bool replace_rows(const Options& options, const std::string& table, const std::string& rows) {
  const std::string document = test::read_text(options.document);
  const auto [first, last] = test::table_place(document, table);
  std::istringstream lines(document.substr(first, last - first));
  std::string kept;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("| " + options.name + " |", 0) != 0) kept += line + "\n";
  }
  return write_table(options.document, table, kept + rows);
}

/// Sets the node's parameters in the namespace `name`.
void set_parameters(const Options& options, const std::string& name, const std::string& cache) {
  ros::param::set(name + "/pose_source", "joint_states");
  ros::param::set(name + "/geometry", options.geometry);
  ros::param::set(name + "/cache_directory", cache);
}

bool run(const Options& options) {
  const std::string urdf = test::read_text(options.urdf);
  const GeometrySource geometry =
      options.geometry == "visual" ? GeometrySource::kVisual : GeometrySource::kCollision;
  const Kinematics kinematics(parse_urdf(urdf, geometry, environment_package_finder()));
  const test::TempDir cache;
  ros::param::set("robot_description", urdf);
  set_parameters(options, "latency_node", cache.path());

  Stopwatches watches;
  const Ears ears("latency_node/proximity", &watches);
  std::unique_ptr<ProximityServer> server;
  std::unique_ptr<Relay> relay;
  std::unique_ptr<Process> node, receiver;
  if (options.tcp) {
    node = std::make_unique<Process>(
        std::vector<std::string>{IST_PROXIMITY_NODE, "__name:=latency_node"});
    receiver = std::make_unique<Process>(std::vector<std::string>{
        std::filesystem::read_symlink("/proc/self/exe"), "--receive", "__name:=latency_receiver"});
  } else {
    const ros::NodeHandle nh, private_nh("latency_node");
    server = std::make_unique<ProximityServer>(nh, private_nh);
    relay = std::make_unique<Relay>(true);
  }
  const Traffic traffic(
      kinematics, options.pcd, options.camera,
      [&](const ros::Time& stamp) {
        watches.state.sent(stamp);
        watches.ok_state.sent(stamp);
        watches.relayed_state.sent(stamp);
      },
      [&](const ros::Time& stamp) {
        watches.cloud.sent(stamp);
        watches.ok_cloud.sent(stamp);
        watches.seen_cloud.sent(stamp);
      });

  while (ros::ok() && !ears.is_ok()) wait(0.1);
  settle(options.tcp ? node->pid() : getpid());
  watches.count(true);
  wait(options.seconds);
  watches.count(false);
  wait(0.5);  // for the last answers
  if (!ros::ok()) return false;

  const std::string latencies = latency_table(options, &watches);
  std::printf("%s", latencies.c_str());
  if (options.document.empty()) return true;
  return replace_rows(options, options.tcp ? "tcp" : "nodelets", latencies) &&
         (options.run.empty() || write_table(options.document, "ros run", options.run + ".\n"));
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  ros::init(argc, argv, "latency");
  ist::benchmark::Options options;
  bool receives = false;
  CLI::App app("Latency through ROS, beside a bare relay. A roscore must be running.");
  app.add_option("--urdf", options.urdf, "Robot; default: the demo arm");
  app.add_option("--geometry", options.geometry, "collision or visual");
  app.add_option("--pcd", options.pcd, "An organized 640x480 cloud; default: a wavy wall");
  app.add_option("--camera", options.camera, "File with 4 x 4 numbers: sensor -> root link");
  app.add_option("--seconds", options.seconds, "How long to measure");
  app.add_option("--name", options.name, "The robot's, in the tables");
  app.add_option("--update-doc", options.document, "Document to put the tables into");
  app.add_option("--run", options.run, "Commit, date and machine, for the document");
  app.add_flag("--tcp", options.tcp, "Node and receiver as processes of their own");
  app.add_flag("--receive", receives, "Be that receiver");
  CLI11_PARSE(app, argc, argv);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  if (receives) {
    const ist::benchmark::Relay relay(false);
    ros::waitForShutdown();
    return 0;
  }
  return ist::benchmark::run(options) ? 0 : 1;
}
