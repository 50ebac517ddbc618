// The cost of a cycle of the node by its parts, in one process and without a ROS master: the link
// poses are given, the clouds are ingested as the node does it, the first answer with each is made
// beside the cycles, and everything is on that is on by default. Printed as a Markdown table; run
// it on an idle machine.
//
// Needs the test data for the Panda: IST_PROXIMITY_DATA, or ../shared/data.

#include <ist_proximity/ProximityArray.h>
#include <ros/serialization.h>

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/robot/link_poses.h"
#include "peers/scene.h"
#include "ros/common/stopwatch.h"
#include "ros/cycle/proximity_cycle.h"
#include "ros/output/message_pool.h"
#include "support.h"
#include "support/cycle_parts.h"
#include "support/data_dir.h"
#include "support/demo_arm.h"

namespace ist::benchmark {
namespace {

constexpr std::size_t kCyclesPerCloud = 33;
constexpr double kMaxError = 0.005;  // [m] the node's default

// A robot, its motion and what it sees.
struct Trial {
  std::string name;
  std::shared_ptr<const RobotModel> robot;
  std::vector<LinkGeometry> geometry;  // by link
  Frame frame;
  std::vector<Poses> motion;  // 1 ms apart
};

enum Part { kQuery, kRepulsion, kPenetration, kMessage, kReport, kSerialize, kCycle, kParts };

Trial demo_trial(const std::string& cache, std::size_t steps) {
  const RobotDescription demo = test::demo_robot();
  const Kinematics kinematics(demo);
  Trial arm{"demo arm", packed(demo, cache, kMaxError), {}, synthetic_frame(), {}};
  for (const LinkDescription& link : demo.links) arm.geometry.push_back(link.geometry);
  std::vector<double> q(kinematics.joints().size(), 0.0);
  for (std::size_t k = 0; k < steps; ++k) {
    const double t = 1e-3 * static_cast<double>(k);
    for (std::size_t j = 0; j < q.size(); ++j) q[j] = 0.4 * std::sin(t + static_cast<double>(j));
    arm.motion.push_back(link_poses(*arm.robot, kinematics, q).X_FL);
  }
  return arm;
}

std::vector<Trial> trials(const std::string& cache, bool quick) {
  std::vector<Trial> all = {demo_trial(cache, quick ? 200 : 2000)};
  const auto data = test::data_dir();
  if (!data) return all;
  const DataSet panda = kinect_data(*data, cache);
  for (const Scene& scene : panda.scenes) {
    all.push_back(
        {"Panda, " + scene.name, panda.robot.pack(kMaxError), {}, scene.frame, panda.motion});
    for (const TriangleMesh& mesh : panda.robot.meshes) {
      all.back().geometry.push_back({{mesh, Eigen::Isometry3d::Identity(), "mesh"}});
    }
  }
  return all;
}

std::shared_ptr<const ContactModel> contacts_of(const Trial& trial, const std::string& cache) {
  auto contacts = std::make_shared<ContactModel>();
  contacts->robot = trial.robot;
  for (std::size_t i = 0; i < trial.robot->links.size(); ++i) {
    contacts->links.push_back(build_contact_geometry(trial.geometry[i], 0, trial.robot->links[i],
                                                     ContactConfig(), cache));
  }
  return contacts;
}

// [us] By part: the times of all cycles.
using Times = std::array<std::vector<double>, kParts>;

class CycleBenchmark {
 public:
  CycleBenchmark(const Trial& trial, const std::string& cache) : trial_(trial) {
    auto poses = std::make_unique<test::StatedPoses>();
    poses_ = poses.get();
    poses_->set(trial.motion.front());
    cycle_ = std::make_unique<ProximityCycle>(test::ready_model(trial.robot), ServerConfig(),
                                              std::move(poses), CloudSelection::Reader::kOnly);
    auto source = std::make_unique<test::StatedSource>("camera");
    source_ = source.get();
    sources_.push_back(std::move(source));
    cycle_->set_warm_up(&warm_up_);
    live_.query.deadline = 0.0;
    live_.contacts = contacts_of(trial, cache);
  }

  void run() {
    IngestConfig config;
    config.search_distance = ServerConfig().query.max_distance;
    Ingest ingest(config);
    const std::vector<bool> known(trial_.robot->links.size(), true);
    std::vector<PosedSolid> solids;
    for (std::size_t k = 0; k < trial_.motion.size(); ++k) {
      const Poses& X_FL = trial_.motion[k];
      if (k % kCyclesPerCloud == 0) {
        solids = posed_solids(*trial_.robot, X_FL, known);
        ingest.run(trial_.frame.raw(), trial_.frame.X_FS, solids, now_.toSec(),
                   source_->cloud(now_));
        warm_up_.run(*source_, *source_->newest({}));
      }
      now_ += ros::Duration(0.001);
      poses_->set(X_FL);
      step();
    }
  }

  const Times& times() const { return times_; }
  std::size_t near() const { return near_; }

 private:
  void step() {
    const auto message = messages_.take();
    Stopwatch watch;
    cycle_->run(now_, sources_, live_, "", message.get());
    const double cycle_us = 1e6 * watch.lap();
    cycle_->report(*message, &report_);
    const double report_us = 1e6 * watch.lap();
    const ros::SerializedMessage bytes = ros::serialization::serializeMessage(*message);
    const double serialize_us = 1e6 * watch.lap();
    const std::array<double, kParts> parts = {1e6 * message->query_time,
                                              1e6 * message->repulsion_time,
                                              1e6 * message->penetration_time,
                                              1e6 * message->message_time,
                                              report_us,
                                              serialize_us,
                                              cycle_us + report_us + serialize_us};
    for (std::size_t i = 0; i < kParts; ++i) times_[i].push_back(parts[i]);
    for (const auto& link : message->links) {
      near_ += link.distance < live_.repulsion.influence_distance ? 1 : 0;
    }
  }

  const Trial& trial_;
  test::StatedPoses* poses_ = nullptr;
  test::StatedSource* source_ = nullptr;
  CloudSources sources_;
  SceneWarmUp warm_up_{sources_};
  std::unique_ptr<ProximityCycle> cycle_;
  LiveConfig live_;
  MessagePool<ist_proximity::ProximityArray> messages_;
  CycleReport report_;
  ros::Time now_{100.0};
  Times times_;
  std::size_t near_ = 0;  // links within the influence distance, over all cycles
};

std::string time(double us) { return text_of(us < 100.0 ? "%.1f µs" : "%.0f µs", us); }

std::string row(const Trial& trial, const CycleBenchmark& done) {
  const Times& times = done.times();
  const auto cycles = static_cast<double>(times[kCycle].size());
  std::string line = text_of("| %s | %.1f of %zu", trial.name.c_str(),
                             static_cast<double>(done.near()) / cycles, trial.robot->links.size());
  for (const std::vector<double>& part : times) {
    line += " | " + time(quantile(part, 0.5)) + " / " + time(quantile(part, 0.99));
  }
  return line + text_of(" | %.2f / %.2f |\n",
                        quantile(times[kCycle], 0.5) / quantile(times[kQuery], 0.5),
                        quantile(times[kCycle], 0.99) / quantile(times[kQuery], 0.99));
}

}  // namespace
}  // namespace ist::benchmark

int main(int argc, char** argv) {
  using namespace ist::benchmark;
  std::string cache;
  bool quick = false;
  CommandLine line("A cycle of the node by its parts.");
  line.add_option("cache", cache, "Folder that keeps packings")->required();
  line.add_flag("--quick", quick, "Fewer cycles");
  line.read(argc, argv);
  ros::Time::init();
  std::string table =
      "| scene | links within the influence distance | distances | repulsion | contact volumes | "
      "message | report | serialization | cycle | cycle / distances |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Trial& trial : trials(cache, quick)) {
    CycleBenchmark benchmark(trial, cache);
    benchmark.run();
    table += row(trial, benchmark);
  }
  return line.publish("benchmark cycle", table);
}
