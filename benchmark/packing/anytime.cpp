// Anytime models over their first minute: the first answer after the URDF, then spheres, memory and
// the time of a query while packing goes on in a thread of low priority. The same motion is then
// run again with the last model and without packing, because the times of queries follow the motion
// more than anything else.

#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <memory>
#include <mutex>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "internal/robot/anytime_model.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "packing/options.h"
#include "peers/scene.h"
#include "support.h"
#include "support/long_chain.h"
#include "support/whole_cloud.h"

namespace ist::benchmark {
namespace {

constexpr const char* kRobots[] = {"Panda", "demo arm", "40 links"};
constexpr double kSeconds[] = {0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0};
constexpr int kThreads = 2;
constexpr double kMaxError = 0.002;  // [m]
constexpr std::chrono::milliseconds kPeriod(1);

std::string read(const std::filesystem::path& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// The URDF of a robot; empty without the data that it needs.
std::string urdf_of(const std::string& robot, const Options& options) {
  const std::string source = IST_PROXIMITY_SOURCE_DIR;
  if (robot == "demo arm") return read(source + "/demo/demo_arm.urdf");
  if (robot == "40 links") return test::long_chain_urdf(40);
  return options.data.empty() ? ""
                              : read(options.data / "robots/franka_description/robots/panda.urdf");
}

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// [MB] Resident memory of this process.
double resident() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return 1e-3 * std::stod(line.substr(6));
  }
  return 0.0;
}

// The newest model, handed from the packing thread to the queries.
class NewestModel {
 public:
  void set(AnytimeModel::Ptr model) {
    const std::lock_guard<std::mutex> lock(mutex_);
    model_ = std::move(model);
  }
  AnytimeModel::Ptr get() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return model_;
  }

 private:
  mutable std::mutex mutex_;
  AnytimeModel::Ptr model_;
};

// Refines the links in turn until all are final.
void refine(NewestModel* newest, const std::atomic<bool>& stop) {
  (void)setpriority(PRIO_PROCESS, 0, 10);  // of this thread
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [&] { return stop.load(); };
  for (bool is_final = false; !is_final && !stop;) {
    is_final = true;
    for (std::size_t i = 0; i < newest->get()->robot()->links.size() && !stop; ++i) {
      const AnytimeModel::Ptr model = newest->get();
      if (model->robot()->links[i].is_final) continue;
      is_final = false;
      if (AnytimeModel::Ptr next = model->refined(i, callbacks)) newest->set(std::move(next));
    }
  }
}

struct MovingRobot {
  std::shared_ptr<const RobotDescription> description;
  std::unique_ptr<Kinematics> kinematics;
  double amplitude = 0.8;  // [rad, m]

  std::vector<Eigen::Isometry3d> poses(const RobotModel& robot, double time) const {
    const Eigen::Isometry3d X_FR(Eigen::Translation3d(-0.8, 0.0, -0.2));  // next to the table
    std::vector<double> q;
    for (std::size_t j = 0; j < kinematics->joints().size(); ++j) {
      const auto& joint = kinematics->joints()[j];
      const double low = std::max(joint.lower, -M_PI), high = std::min(joint.upper, M_PI);
      const double s =
          std::sin(time * (0.5 + 0.1 * static_cast<double>(j % 5)) + static_cast<double>(j));
      q.push_back(low < high ? 0.5 * (low + high) + 0.5 * amplitude * (high - low) * s : 0.0);
    }
    return link_poses(robot, *kinematics, q, X_FR).X_FL;
  }
};

// What is measured up to one moment.
struct Stage {
  double second = 0.0;
  std::shared_ptr<const RobotModel> model;
  double resident = 0.0;   // [MB]
  std::vector<double> us;  // of the queries since the stage before
};

// Queries at 1 kHz along the motion, with the newest model.
std::vector<Stage> run_stages(const MovingRobot& robot, const CloudSnapshot& cloud,
                              const NewestModel& newest) {
  std::vector<Stage> stages;
  std::shared_ptr<const RobotModel> model = newest.get()->robot();
  ProximityQuery query(model, {});
  const std::vector<bool> known(model->links.size(), true);
  std::vector<LinkProximity> results;
  std::vector<double> us;
  const auto begin = Clock::now();
  for (std::size_t cycle = 0; stages.size() < std::size(kSeconds); ++cycle) {
    std::this_thread::sleep_until(begin + cycle * kPeriod);
    const double time = 1e-3 * static_cast<double>(cycle), second = kSeconds[stages.size()];
    const auto poses = robot.poses(*model, time);
    const auto newer = newest.get()->robot();
    ThreadTimer timer;
    if (newer != model) query.set_model(newer);
    query.run(poses, known, {&cloud}, &results);
    us.push_back(timer.lap());
    model = newer;
    constexpr double kFirst = 0.2;  // [s] of queries that the first row is about
    if (time < second + (stages.empty() ? kFirst : 0.0)) continue;
    stages.push_back({second, model, resident(), us});
    us.clear();
  }
  return stages;
}

void add_row(const std::string& robot, const Stage& stage, const Stage& later, double first_wall,
             double first_processor, Table* table) {
  const RobotModel& model = *stage.model;
  const double second = stage.second;
  std::size_t spheres = 0, final = 0;
  double gap = 0.0;
  for (const LinkModel& link : model.links) {
    spheres += link.packing.spheres.size();
    gap = std::max(gap, link.packing.certificate.max_gap);
    final += link.is_final ? 1 : 0;
  }
  table->add({robot, text("%g", second),
              second == 0.0 ? text("%.2f", first_wall) + " / " + text("%.2f", first_processor) : "",
              std::to_string(final) + " of " + std::to_string(model.links.size()),
              std::to_string(spheres), text("%.1f", 1e3 * gap), text("%.0f", stage.resident),
              text("%.0f", quantile(stage.us, 0.5)), text("%.0f", quantile(stage.us, 0.99)),
              text("%.0f", quantile(later.us, 0.5)), text("%.0f", quantile(later.us, 0.99)),
              text("%.2f", quantile(stage.us, 0.99) / quantile(later.us, 0.99))});
}

void measure_robot(const std::string& name, const std::string& urdf, const Options& options,
                   Table* table) {
  const std::string source = IST_PROXIMITY_SOURCE_DIR;
  const auto start = Clock::now();
  const double processor = processor_seconds();
  MovingRobot robot;
  robot.description = std::make_shared<const RobotDescription>(
      parse_urdf(urdf, name == "Panda" ? GeometrySource::kVisual : GeometrySource::kCollision,
                 [&](const std::string& package) {
                   return package == "franka_description"
                              ? (options.data / "robots/franka_description").string()
                              : source;
                 }));
  RobotModelConfig config;
  config.packing.max_error = kMaxError;
  config.threads = kThreads;
  NewestModel newest;
  newest.set(AnytimeModel::build(robot.description, config, AnytimeModel::Stage::kFirst));
  const double first_wall = 1e-6 * microseconds_since(start);
  const double first_processor = processor_seconds() - processor;
  robot.kinematics = std::make_unique<Kinematics>(*robot.description);

  CloudSnapshot cloud;
  const Frame frame = synthetic_frame(640, 480);
  Ingest(test::whole_cloud(false)).run(frame.raw(), frame.X_FS, {}, 0.0, &cloud);
  std::atomic<bool> stop{false};
  std::thread packing(refine, &newest, std::cref(stop));
  const std::vector<Stage> packing_stages = run_stages(robot, cloud, newest);
  stop = true;
  packing.join();
  const std::vector<Stage> later = run_stages(robot, cloud, newest);
  for (std::size_t i = 0; i < later.size(); ++i) {
    add_row(name, packing_stages[i], later[i], first_wall, first_processor, table);
  }
}

}  // namespace

Table anytime_table() {
  Table table(
      "anytime",
      {"robot", "after [s]", "first model, clock / processor [s]", "links final", "spheres",
       "largest gap [mm]", "resident memory [MB]", "query, median [us]", "99th percentile [us]",
       "the same motion afterwards, median [us]", "99th percentile [us]", "ratio of these"},
      2);
  for (const char* robot : kRobots) {
    for (const double second : kSeconds) table.place({robot, text("%g", second)});
  }
  return table;
}

bool measure_anytime(const Options& options, Table* table) {
  for (const std::string robot : kRobots) {
    const std::string urdf = urdf_of(robot, options);
    if (urdf.empty()) {
      std::fprintf(stderr, "%s: the test data is not there\n", robot.c_str());
    } else {
      measure_robot(robot, urdf, options, table);
    }
  }
  return true;
}

}  // namespace ist::benchmark
