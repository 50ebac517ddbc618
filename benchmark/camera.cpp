// The cost of a camera as the node has it: a depth image of 640 x 480 points at 30 Hz, joint states
// at 1 kHz, and the node's defaults. One image and the 33 cycles until the next one, by part:
// ingest with self-filter, the first answer beside the cycles, distances, repulsion, which thins
// what it looks at, and penetration in contact. Beside it the same images and configurations with
// other libraries. As Markdown tables.
//
// One thread, processor time of that thread, without ROS. The frames of the test data
// (IST_PROXIMITY_DATA, or ../shared/data), or the synthetic one without them; the robot moves
// through them. Usage: camera CACHE_FOLDER [--ours]; scripts/benchmark calls it.
// --ours: no other libraries.

#include <array>
#include <cstdio>
#include <cstring>
#include <memory>
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
#include "support/data_dir.h"
#ifdef IST_BENCHMARK_CGAL
#include "peers/body_filter.h"
#endif

namespace {

using ist::CloudSnapshot;
using ist::LinkProximity;
using ist::LinkState;
using ist::benchmark::DataSet;
using ist::benchmark::Frame;
using ist::benchmark::mean;
using ist::benchmark::quantile;
using ist::benchmark::Scene;
using ist::benchmark::ThreadTimer;
using Poses = std::vector<Eigen::Isometry3d>;

constexpr std::size_t kCycles = 33;     // at 1 kHz, between two images at 30 Hz
constexpr double kPeriod = 1.0 / 30.0;  // [s] of the images
constexpr std::size_t kLag = 2;  // cycles from the poses of the first answer to the next cycle
constexpr double kWarmUpLimit = 0.005;   // [s] as in the node
constexpr std::size_t kFewSpheres = 59;  // as many as a common hand-made set for this arm

// The robot as the node has it.
struct Robot {
  Robot(const DataSet& set, const std::string& cache)
      : model(set.robot.pack(ist::PackingConfig().max_error)), known(model->links.size(), true) {
    for (std::size_t i = 0; i < model->links.size(); ++i) {
      const ist::LinkGeometry geometry = {
          {set.robot.meshes[i], Eigen::Isometry3d::Identity(), "link"}};
      bodies.push_back(ist::build_contact_geometry(geometry, 0, model->links[i], {}, cache));
    }
  }
  std::shared_ptr<const ist::RobotModel> model;
  std::vector<std::shared_ptr<const ist::ContactGeometry>> bodies;
  std::vector<bool> known;
};

ist::IngestConfig as_in_the_node() {
  ist::IngestConfig config;
  config.search_distance = ist::QueryConfig().max_distance;
  return config;
}

// What the node does with images and poses, with its defaults.
class Node {
 public:
  explicit Node(const Robot& robot)
      : robot_(robot),
        ingest_(as_in_the_node()),
        own_(std::make_unique<ist::CoherentQueries>(robot.model, ist::QueryConfig())),
        spare_(std::make_unique<ist::CoherentQueries>(robot.model, ist::QueryConfig())) {}

  void ingest(const Frame& frame, const Poses& X_FL) {
    ist::RawCloud raw = frame.raw();
    raw.owner = std::shared_ptr<const void>(&frame, [](const void*) {});  // as a message
    stamp_ += kPeriod;
    ingest_.run(raw, frame.X_FS, ist::posed_solids(*robot_.model, X_FL, robot_.known), stamp_,
                &snapshot_);
  }
  // The thread that reads the image makes the first answer with it.
  void warm_up(const Poses& X_FL) {
    spare_->warm_up(X_FL, robot_.known, {&snapshot_}, {}, {}, kWarmUpLimit);
    own_.swap(spare_);
  }
  void query(const Poses& X_FL) {
    own_->query().set_config({});
    own_->query().run(X_FL, robot_.known, {&snapshot_}, &results_);
  }
  void repel(const Poses& X_FL) {
    for (std::size_t i = 0; i < results_.size(); ++i) {
      push_ = own_->repel(i, X_FL[i], {&snapshot_}, results_[i], {});
    }
  }
  void penetrate(const Poses& X_FL) {
    for (std::size_t i = 0; i < results_.size(); ++i) {
      if (results_[i].state != LinkState::kContact) continue;
      volume_ =
          ist::contact_volume(robot_.model->links[i], *robot_.bodies[i], X_FL[i], {&snapshot_});
    }
  }

 private:
  const Robot& robot_;
  double stamp_ = 0.0;  // [s] of the last image
  ist::Ingest ingest_;
  CloudSnapshot snapshot_;
  std::unique_ptr<ist::CoherentQueries> own_, spare_;
  std::vector<LinkProximity> results_;
  ist::RepulsiveWrench push_;
  ist::ContactVolume volume_;
};

// [us] One image and its cycles, by image.
struct Times {
  std::vector<double> ingest, warm_up, query, repulsion, penetration, frame;
};

Times time_ours(const DataSet& set, const Robot& robot) {
  Times times;
  for (const Scene& scene : set.scenes) {
    Node node(robot);
    ThreadTimer timer;
    for (std::size_t begin = 0; begin + kCycles <= set.motion.size(); begin += kCycles) {
      timer.lap();
      node.ingest(scene.frame, set.motion[begin]);
      std::array<double, 4> us = {timer.lap(), 0.0, 0.0, 0.0};
      if (begin > 0) node.warm_up(set.motion[begin - kLag]);
      const double warm_up = timer.lap();
      for (std::size_t k = begin; k < begin + kCycles; ++k) {
        const Poses& X_FL = set.motion[k];
        timer.lap();
        node.query(X_FL);
        us[1] += timer.lap();
        node.repel(X_FL);
        us[2] += timer.lap();
        node.penetrate(X_FL);
        us[3] += timer.lap();
      }
      if (begin == 0) continue;  // the first one allocates
      times.ingest.push_back(us[0]);
      times.warm_up.push_back(warm_up);
      times.query.push_back(us[1]);
      times.repulsion.push_back(us[2]);
      times.penetration.push_back(us[3]);
      times.frame.push_back(us[0] + warm_up + us[1] + us[2] + us[3]);
    }
  }
  return times;
}

void print(const char* name, const Times& times, double ours) {
  const double frame = quantile(times.frame, 0.5);
  std::printf("| %s | %.2f ms", name, 1e-3 * quantile(times.ingest, 0.5));
  if (times.warm_up.empty()) {
    std::printf(" | ");
  } else {
    std::printf(" | %.2f ms", 1e-3 * quantile(times.warm_up, 0.5));
  }
  std::printf(" | %.2f ms", 1e-3 * quantile(times.query, 0.5));
  for (const auto* part : {&times.repulsion, &times.penetration}) {
    if (part->empty()) {
      std::printf(" | ");
    } else {
      std::printf(" | %.2f ms", 1e-3 * mean(*part));
    }
  }
  std::printf(" | %.2f / %.2f ms | %.1f |\n", 1e-3 * frame, 1e-3 * quantile(times.frame, 0.99),
              frame / ours);
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
      times.ingest.push_back(timer.lap());
      for (std::size_t k = begin; k < begin + kCycles; ++k) method->query(set.motion[k], &answers);
      times.query.push_back(timer.lap());
      times.frame.push_back(times.ingest.back() + times.query.back());
    }
  }
  return times;
}

void print_peers(const DataSet& set, double ours) {
  const ist::benchmark::BodyFilter filter(set.robot, ist::IngestConfig().self_filter_padding);
  ist::benchmark::Methods methods;
#ifdef IST_BENCHMARK_EMBREE
  add_embree(set.robot, &methods);
#endif
#ifdef IST_BENCHMARK_NANOFLANN
  add_nanoflann(few_spheres(set.robot, kFewSpheres), &methods);
#endif
  for (const auto& method : methods) {
    const std::string name = method->name + "; points in inflated hulls dropped";
    print(name.c_str(), time_peer(set, filter, method.get()), ours);
  }
}
#endif

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "Usage: camera CACHE_FOLDER [--ours]\n");
    return 2;
  }
  const auto data = ist::test::data_dir();
  const DataSet set =
      data ? ist::benchmark::kinect_data(*data, argv[1]) : ist::benchmark::synthetic_data(argv[1]);
  const Robot robot(set, argv[1]);
  std::printf(
      "# camera\n| method | image | first answer, beside the cycles | 33 cycles: distances | "
      "repulsion | penetration | one 30 Hz frame, median / p99 | / ours |\n"
      "|---|---|---|---|---|---|---|---|\n");
  const Times ours = time_ours(set, robot);
  const double frame = quantile(ours.frame, 0.5);
  print("**ist_proximity**, the node's defaults", ours, frame);
#ifdef IST_BENCHMARK_CGAL
  if (argc == 2) print_peers(set, frame);
#endif
  return 0;
}
