// The cost of a camera as the node has it: a depth image of 640 x 480 points at 30 Hz, joint states
// at 1 kHz, and the node's defaults. One image and the 33 cycles until the next one, by part:
// ingest with self-filter, the first answer beside the cycles, distances, repulsion, which thins
// what it looks at, and penetration in contact. Beside it the same images and configurations with
// other libraries. As Markdown tables.
//
// One thread, processor time of that thread, without ROS. The frames of the test data
// (IST_PROXIMITY_DATA, or ../shared/data), or the synthetic one without them; the robot moves
// through them. scripts/benchmark calls it.

#include <array>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "internal/repulsion/coherent_queries.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/link_poses.h"
#include "peers/method.h"
#include "peers/scene.h"
#include "support.h"
#ifdef IST_BENCHMARK_CGAL
#include "peers/body_filter.h"
#endif

namespace {

using ist::benchmark::DataSet;
using ist::benchmark::Frame;
using ist::benchmark::mean;
using ist::benchmark::Poses;
using ist::benchmark::quantile;
using ist::benchmark::Scene;
using ist::benchmark::text_of;
using ist::benchmark::ThreadTimer;

constexpr std::size_t kCycles = 33;     // at 1 kHz, between two images at 30 Hz
constexpr double kPeriod = 1.0 / 30.0;  // [s] of the images
constexpr std::size_t kLag = 2;  // cycles from the poses of the first answer to the next cycle
constexpr double kWarmUpLimit = 0.005;  // [s] as in the node

// [us] By part and image: one image and its cycles.
enum Part { kIngest, kWarmUp, kQuery, kRepulsion, kPenetration, kFrame, kParts };
using Times = std::array<std::vector<double>, kParts>;

// What the node does with images and poses, with its defaults.
class Node {
 public:
  explicit Node(const DataSet& set, const std::string& cache)
      : model_(set.robot.pack(ist::PackingConfig().max_error)), known_(model_->links.size(), true) {
    for (std::size_t i = 0; i < model_->links.size(); ++i) {
      const ist::LinkGeometry geometry = {
          {set.robot.meshes[i], Eigen::Isometry3d::Identity(), "link"}};
      bodies_.push_back(ist::build_contact_geometry(geometry, 0, model_->links[i], {}, cache));
    }
    forget();
  }

  void forget() {
    ist::IngestConfig config;
    config.search_distance = ist::QueryConfig().max_distance;
    ingest_ = std::make_unique<ist::Ingest>(config);
    own_ = std::make_unique<ist::CoherentQueries>(model_, ist::QueryConfig());
    spare_ = std::make_unique<ist::CoherentQueries>(model_, ist::QueryConfig());
  }

  // @param begin  of the image, in the motion
  std::array<double, kParts> run(const Frame& frame, const std::vector<Poses>& motion,
                                 std::size_t begin) {
    std::array<double, kParts> us{};
    ThreadTimer timer;
    ingest(frame, motion[begin]);
    us[kIngest] = timer.lap();
    // The thread that reads the image makes the first answer with it.
    const Poses& before = motion[begin - std::min(begin, kLag)];
    spare_->warm_up(before, known_, {&snapshot_}, {}, {}, kWarmUpLimit);
    own_.swap(spare_);
    us[kWarmUp] = timer.lap();
    for (std::size_t k = begin; k < begin + kCycles; ++k) {
      timer.lap();
      own_->query().set_config({});
      own_->query().run(motion[k], known_, {&snapshot_}, &results_);
      us[kQuery] += timer.lap();
      for (std::size_t i = 0; i < results_.size(); ++i) {
        push_ = own_->repel(i, motion[k][i], {&snapshot_}, results_[i], {});
      }
      us[kRepulsion] += timer.lap();
      penetrate(motion[k]);
      us[kPenetration] += timer.lap();
    }
    us[kFrame] = std::accumulate(us.begin(), us.end(), 0.0);
    return us;
  }

 private:
  void ingest(const Frame& frame, const Poses& X_FL) {
    ist::RawCloud raw = frame.raw();
    raw.owner = std::shared_ptr<const void>(&frame, [](const void*) {});  // as a message
    stamp_ += kPeriod;
    ingest_->run(raw, frame.X_FS, ist::posed_solids(*model_, X_FL, known_), stamp_, &snapshot_);
  }
  void penetrate(const Poses& X_FL) {
    for (std::size_t i = 0; i < results_.size(); ++i) {
      if (results_[i].state != ist::LinkState::kContact) continue;
      volume_ = ist::contact_volume(model_->links[i], *bodies_[i], X_FL[i], {&snapshot_});
    }
  }

  std::shared_ptr<const ist::RobotModel> model_;
  std::vector<std::shared_ptr<const ist::ContactGeometry>> bodies_;
  std::vector<bool> known_;
  double stamp_ = 0.0;  // [s] of the last image
  std::unique_ptr<ist::Ingest> ingest_;
  ist::CloudSnapshot snapshot_;
  std::unique_ptr<ist::CoherentQueries> own_, spare_;
  std::vector<ist::LinkProximity> results_;
  ist::RepulsiveWrench push_;
  ist::ContactVolume volume_;
};

Times time_ours(const DataSet& set, const std::string& cache) {
  Times times;
  Node node(set, cache);
  for (const Scene& scene : set.scenes) {
    node.forget();
    for (std::size_t begin = 0; begin + kCycles <= set.motion.size(); begin += kCycles) {
      const auto us = node.run(scene.frame, set.motion, begin);
      for (int part = 0; part < kParts && begin > 0; ++part) times[part].push_back(us[part]);
    }
  }
  return times;
}

std::string row(const std::string& name, const Times& times, double ours) {
  std::string line = "| " + name;
  for (const Part part : {kIngest, kWarmUp, kQuery, kRepulsion, kPenetration}) {
    const std::vector<double>& us = times[part];
    const double typical = part < kRepulsion ? quantile(us, 0.5) : mean(us);
    line += us.empty() ? " | " : text_of(" | %.2f ms", 1e-3 * typical);
  }
  const double frame = quantile(times[kFrame], 0.5);
  return line + text_of(" | %.2f / %.2f ms | %.1f |\n", 1e-3 * frame,
                        1e-3 * quantile(times[kFrame], 0.99), frame / ours);
}

#ifdef IST_BENCHMARK_CGAL
// The same images and configurations: the robot's points are dropped point by point.
Times time_peer(const DataSet& set, const ist::benchmark::BodyFilter& filter,
                ist::benchmark::Method* method) {
  constexpr std::size_t kEvery = 6;  // images, for some take long
  Times times;
  Frame filtered;
  std::vector<ist::benchmark::Answer> answers(set.robot.meshes.size());
  for (const Scene& scene : set.scenes) {
    ThreadTimer timer;
    for (std::size_t begin = kCycles; begin + kCycles <= set.motion.size();
         begin += kEvery * kCycles) {
      timer.lap();
      filter.run(scene.frame, set.motion[begin], &filtered);
      method->ingest(filtered);
      times[kIngest].push_back(timer.lap());
      for (std::size_t k = begin; k < begin + kCycles; ++k) method->query(set.motion[k], &answers);
      times[kQuery].push_back(timer.lap());
      times[kFrame].push_back(times[kIngest].back() + times[kQuery].back());
    }
  }
  return times;
}

std::string peers(const DataSet& set, double ours) {
  const ist::benchmark::BodyFilter filter(set.robot, ist::IngestConfig().self_filter_padding);
  ist::benchmark::Methods methods;
#ifdef IST_BENCHMARK_EMBREE
  add_embree(set.robot, &methods);
#endif
#ifdef IST_BENCHMARK_NANOFLANN
  add_nanoflann(set.robot, &methods);
#endif
  std::string rows;
  for (const auto& method : methods) {
    rows += row(method->name + "; points in inflated hulls dropped",
                time_peer(set, filter, method.get()), ours);
  }
  return rows;
}
#endif

}  // namespace

int main(int argc, char** argv) {
  std::string cache;
  ist::benchmark::CommandLine line("The cost of a camera as the node has it.");
  line.add_option("cache", cache, "Folder that keeps packings")->required();
  line.read(argc, argv);
  const auto recorded = ist::test::data_dir();
  if (!recorded) std::fprintf(stderr, "synthetic scene: %s\n", ist::test::kNoData.c_str());
  const DataSet set = recorded ? ist::benchmark::kinect_data(*recorded, cache)
                               : ist::benchmark::synthetic_data(cache);
  const Times ours = time_ours(set, cache);
  std::string table =
      "| method | image | first answer, beside the cycles | 33 cycles: distances | repulsion | "
      "penetration | one 30 Hz frame, median / p99 | / ours |\n|---|---|---|---|---|---|---|---|\n";
  const double frame = quantile(ours[kFrame], 0.5);
  table += row("**ist_proximity**, the node's defaults", ours, frame);
#ifdef IST_BENCHMARK_CGAL
  table += peers(set, frame);
#endif
  return line.publish("benchmark camera", table);
}
