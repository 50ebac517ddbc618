// Anytime models over their first minute: the first answer after the URDF, then spheres, memory and
// the time of a query while packing goes on in a thread of low priority. The same motion is then
// run twice more without packing, because the times of queries follow the motion more than anything
// else: with the same models at the same times, which shows what packing beside it costs, and with
// the last model, which shows what coarse packings cost.

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
#include <tuple>
#include <vector>

#include "internal/robot/anytime_model.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/link_poses.h"
#include "packing/options.h"
#include "peers/scene.h"
#include "ros/model/link_usage.h"
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

// The newest model, handed from the packing thread to the queries, and what these need.
class NewestModel {
 public:
  explicit NewestModel(AnytimeModel::Ptr first)
      : model_(std::move(first)), usage(model_->robot()->links.size()) {}
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

 public:
  LinkUsage usage;
};

// The link whose next step is the most urgent, of these one that something is near, and of these
// the one whose queries measured most points exactly since the last call; -1: all are complete.
int link_to_refine(NewestModel* newest) {
  const AnytimeModel::Ptr model = newest->get();
  int chosen = -1;
  using LinkStep = AnytimeModel::LinkStep;
  std::tuple<int, bool, double> most(-static_cast<int>(LinkStep::kNone), false, -1.0);
  for (std::size_t i = 0; i < newest->usage.size(); ++i) {
    const LinkUsage::Need need = newest->usage.take(i);
    const LinkStep step = AnytimeModel::next_step(model->robot()->links[i]);
    const std::tuple<int, bool, double> rank(-static_cast<int>(step), need.is_near, need.exact);
    if (step == LinkStep::kNone || rank <= most) continue;
    most = rank;
    chosen = static_cast<int>(i);
  }
  return chosen;
}

// Refines the links in the node's order until all are final.
void refine(NewestModel* newest, const std::atomic<bool>& stop) {
  (void)setpriority(PRIO_PROCESS, 0, 10);  // of this thread
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [&] { return stop.load(); };
  while (!stop) {
    const int link = link_to_refine(newest);
    if (link < 0) return;
    const AnytimeModel::Ptr next =
        newest->get()->advanced(static_cast<std::size_t>(link), callbacks);
    if (next) newest->set(next);
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

// A model, and the first cycle that had it.
struct ModelOfCycle {
  std::size_t first_cycle = 0;
  std::shared_ptr<const RobotModel> model;
};

// Queries at 1 kHz along the motion.
// @param model_at  the model of a cycle
// @param usage     notes what queries need; may be null
template <typename ModelAt>
std::vector<Stage> run_stages(const MovingRobot& robot, const CloudSnapshot& cloud,
                              const ModelAt& model_at, LinkUsage* usage) {
  std::vector<Stage> stages;
  std::shared_ptr<const RobotModel> model = model_at(0);
  ProximityQuery query(model, {});
  const std::vector<bool> known(model->links.size(), true);
  std::vector<LinkProximity> results;
  std::vector<double> us;
  const auto begin = Clock::now();
  for (std::size_t cycle = 0; stages.size() < std::size(kSeconds); ++cycle) {
    std::this_thread::sleep_until(begin + cycle * kPeriod);
    const double time = 1e-3 * static_cast<double>(cycle), second = kSeconds[stages.size()];
    const auto poses = robot.poses(*model, time);
    const std::shared_ptr<const RobotModel> newer = model_at(cycle);
    ThreadTimer timer;
    if (newer != model) query.set_model(newer);
    query.run(poses, known, {&cloud}, &results);
    us.push_back(timer.lap());
    model = newer;
    for (std::size_t i = 0; usage != nullptr && i < results.size(); ++i) {
      const bool is_near = results[i].state >= LinkState::kNear &&
                           results[i].distance < RepulsionConfig().influence_distance;
      usage->note_query(i, query.link_statistics()[i], is_near);
    }
    constexpr double kFirst = 0.2;  // [s] of queries that the first row is about
    if (time < second + (stages.empty() ? kFirst : 0.0)) continue;
    stages.push_back({second, model, resident(), us});
    us.clear();
  }
  return stages;
}

void add_row(const std::string& robot, const Stage& stage, const Stage& replayed,
             const Stage& later, double first_wall, double first_processor, Table* table) {
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
              text("%.0f", quantile(replayed.us, 0.99)), text("%.0f", quantile(later.us, 0.5)),
              text("%.0f", quantile(later.us, 0.99)),
              text("%.2f", quantile(stage.us, 0.99) / quantile(replayed.us, 0.99)),
              text("%.2f", quantile(replayed.us, 0.99) / quantile(later.us, 0.99))});
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
  NewestModel newest(AnytimeModel::build(robot.description, config, AnytimeModel::Stage::kFirst));
  const double first_wall = 1e-6 * microseconds_since(start);
  const double first_processor = processor_seconds() - processor;
  robot.kinematics = std::make_unique<Kinematics>(*robot.description);

  CloudSnapshot cloud;
  const Frame frame = synthetic_frame(640, 480);
  Ingest(test::whole_cloud(false)).run(frame.raw(), frame.X_FS, {}, 0.0, &cloud);
  std::atomic<bool> stop{false};
  std::thread packing(refine, &newest, std::cref(stop));
  std::vector<ModelOfCycle> models;
  const auto newest_model = [&](std::size_t cycle) {
    const auto model = newest.get()->robot();
    if (models.empty() || models.back().model != model) models.push_back({cycle, model});
    return model;
  };
  const std::vector<Stage> stages = run_stages(robot, cloud, newest_model, &newest.usage);
  stop = true;
  packing.join();
  std::size_t place = 0;
  const auto same_model = [&](std::size_t cycle) {
    if (cycle == 0) place = 0;
    while (place + 1 < models.size() && models[place + 1].first_cycle <= cycle) ++place;
    return models[place].model;
  };
  const std::vector<Stage> replayed = run_stages(robot, cloud, same_model, nullptr);
  const auto last_model = [&](std::size_t /*cycle*/) { return newest.get()->robot(); };
  const std::vector<Stage> later = run_stages(robot, cloud, last_model, nullptr);
  for (std::size_t i = 0; i < later.size(); ++i) {
    add_row(name, stages[i], replayed[i], later[i], first_wall, first_processor, table);
  }
}

}  // namespace

Table anytime_table() {
  Table table(
      "anytime",
      {"robot", "after [s]", "first model, clock / processor [s]", "links final", "spheres",
       "largest gap [mm]", "resident memory [MB]", "query, median [us]", "99th percentile [us]",
       "the same models without packing, 99th percentile [us]", "the last model, median [us]",
       "99th percentile [us]", "with packing / without, 99th", "these models / the last, 99th"},
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
