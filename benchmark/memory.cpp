// What remembering costs: the time of a cloud of 640 x 480 points beside liboctomap's insertion of
// the same clouds in the same run (octomap_server's: insertPointCloud with a largest range, a ray
// for each point), the query with and without what is remembered, and memory over time. The
// simulated arm moves among obstacles in front of a depth camera.
//
// Usage: memory [seconds of simulation] [minutes of clouds for memory over time]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "internal/cloud/memory_scan.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "scene.h"
#include "simulation.h"
#include "support.h"
#include "support/demo_arm.h"

#ifdef IST_PROXIMITY_HAS_OCTOMAP
#include <octomap/octomap.h>
#endif

namespace {

using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

constexpr double kResolution = 0.02;  // [m]
constexpr double kMaxRange = 3.0;     // [m]
constexpr int kPeerEvery = 10;        // liboctomap takes one cloud of so many
constexpr std::size_t kKept = 30;     // clouds for memory over time

struct Times {
  std::vector<double> ingest, scan, insert, insert_each, boxes;  // [us] of a cloud
  std::vector<double> octomap, octomap_discrete;                 // [us] of the same
  std::vector<double> query, query_with;                         // [us]
};

ist::MemoryConfig memory_config(bool discretize) {
  ist::MemoryConfig config;
  config.resolution = kResolution;
  config.max_range = kMaxRange;
  config.discretize = discretize;
  return config;
}

#ifdef IST_PROXIMITY_HAS_OCTOMAP
// Inserts the obstacles of a cloud, and the points beyond the largest range, which clear only. Rays
// that end on the robot are left out: octomap_server has no such thing.
double insert_octomap(const ist::MemoryScan& scan, bool discretize, octomap::OcTree* tree) {
  octomap::Pointcloud cloud;
  cloud.reserve(scan.hits.size());
  for (const Eigen::Vector3f& p : scan.hits) cloud.push_back(p.x(), p.y(), p.z());
  for (const Eigen::Vector3f& p : scan.free_ends) {
    const Eigen::Vector3f ray = p - scan.origin;
    if (ray.norm() < 0.999 * kMaxRange) continue;
    const Eigen::Vector3f beyond = scan.origin + 1.01F * ray;
    cloud.push_back(beyond.x(), beyond.y(), beyond.z());
  }
  ThreadTimer timer;
  tree->insertPointCloud(cloud, {scan.origin.x(), scan.origin.y(), scan.origin.z()}, kMaxRange,
                         false, discretize);
  return timer.lap();
}
#endif

std::size_t resident_bytes() {
  std::size_t pages = 0, ignored = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%zu %zu", &ignored, &pages) != 2) pages = 0;
    std::fclose(file);
  }
  return 4096 * pages;
}

void print_row(const char* name, const std::vector<double>& us) {
  std::printf("| %s | %.2f ms | %.2f ms |\n", name, 1e-3 * quantile(us, 0.5),
              1e-3 * quantile(us, 0.99));
}

void print(const Times& t) {
  std::printf("| a cloud of 640 x 480 points | median | 99th percentile |\n|---|---|---|\n");
  print_row("ingest, without memory", t.ingest);
  print_row("points by obstacle and robot", t.scan);
  print_row("insertion", t.insert);
  print_row("insertion, a ray for each point", t.insert_each);
  print_row("boxes of what is hidden, and their index", t.boxes);
  print_row("liboctomap, as octomap_server", t.octomap);
  print_row("liboctomap, discretized", t.octomap_discrete);
  print_row("query of all links", t.query);
  print_row("query of all links, with memory", t.query_with);
  const double ours = quantile(t.scan, 0.5) + quantile(t.insert, 0.5) + quantile(t.boxes, 0.5);
  std::printf("\n%.0f clouds a second on one core; liboctomap takes %.1f times as long\n",
              1e6 / ours, quantile(t.octomap, 0.5) / ours);
  std::printf("ray for ray: discretized %.1f times, each point %.1f times as long as ours\n",
              quantile(t.octomap_discrete, 0.5) / quantile(t.insert, 0.5),
              quantile(t.octomap, 0.5) / quantile(t.insert_each, 0.5));
  std::printf("query with memory, 99th percentile: %.2f times that of without\n",
              quantile(t.query_with, 0.99) / quantile(t.query, 0.99));
}

// Sends the same clouds again and again, 30 a second of their stamps.
void watch_memory(std::vector<ist::MemoryScan> scans, double minutes) {
  ist::MemoryMap map(memory_config(true));
  ist::VoxelBoxes boxes;
  std::printf("\n| minute | voxels in memory | occupied | process |\n|---|---|---|---|\n");
  const auto clouds = static_cast<std::size_t>(60.0 * 30.0 * minutes);
  for (std::size_t i = 0; i < clouds; ++i) {
    ist::MemoryScan& scan = scans[i % scans.size()];
    scan.stamp = static_cast<double>(i) / 30.0;
    map.insert(scan);
    map.hidden_boxes(&boxes);
    ist::BoxIndex index;
    index.build(boxes);
    if ((i + 1) % 1800 != 0) continue;
    const ist::MemoryCounts counts = map.counts();
    std::printf("| %zu | %zu | %zu | %.1f MB |\n", (i + 1) / 1800, counts.nodes, counts.occupied,
                1e-6 * static_cast<double>(resident_bytes()));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 4.0;
  const double minutes = argc > 2 ? std::atof(argv[2]) : 0.0;
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<ist::sim::DepthCameraConfig> cameras = ist::sim::demo_cameras();
  cameras.resize(1);
  cameras[0].width = 640;
  cameras[0].height = 480;
  cameras[0].focal_length *= 4.0;
  ist::sim::Simulation world(robot, ist::sim::demo_arm(), ist::sim::demo_obstacles(), cameras, 1);
  Eigen::VectorXd q =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(world.arm().config().joints.size()));
  world.arm().reset(q);

  ist::IngestConfig ingest_config;
  ingest_config.max_range = kMaxRange;
  ingest_config.self_filter_padding = 0.03;
  ist::Ingest ingest(ingest_config);
  ist::MemoryMap map(memory_config(true)), each(memory_config(false));
#ifdef IST_PROXIMITY_HAS_OCTOMAP
  octomap::OcTree tree(kResolution), discrete_tree(kResolution);
#endif
  ist::CloudSnapshot cloud, memory;
  ist::MemoryScan scan;
  ist::VoxelBoxes boxes;
  ist::ProximityQuery query(model, {}), query_with(model, {});
  std::vector<ist::LinkProximity> results;
  std::vector<ist::MemoryScan> kept;
  ist::sim::Picture picture;
  Times times;
  int frames = 0;
  for (int step = 0; world.time() < seconds; ++step) {
    for (ist::sim::Picture& newest : world.take_pictures()) {
      picture = std::move(newest);
      const auto X_FL = world.link_poses(picture.stamp);
      const auto solids = posed_solids(*model, X_FL, std::vector<bool>(X_FL.size(), true));
      const Eigen::Isometry3d& X_FS = world.cameras()[0].config().X_FC;
      ThreadTimer timer;
      ingest.run(picture.raw(), X_FS, solids, picture.stamp, &cloud);
      times.ingest.push_back(timer.lap());
      read_memory_scan(picture.raw(), cloud, X_FS, ingest_config.min_range, kMaxRange, &scan);
      times.scan.push_back(timer.lap());
      map.insert(scan);
      times.insert.push_back(timer.lap());
      map.hidden_boxes(&boxes);
      auto index = std::make_shared<ist::BoxIndex>();
      index->build(boxes);
      memory.boxes = index;
      times.boxes.push_back(timer.lap());
      if (kept.size() < kKept) kept.push_back(scan);
      if (frames++ % kPeerEvery != 0) continue;
      timer.lap();
      each.insert(scan);
      times.insert_each.push_back(timer.lap());
#ifdef IST_PROXIMITY_HAS_OCTOMAP
      times.octomap.push_back(insert_octomap(scan, false, &tree));
      times.octomap_discrete.push_back(insert_octomap(scan, true, &discrete_tree));
#endif
    }
    if (frames > 0 && step % 2 == 0) {
      const auto X_FL = world.link_poses();
      const std::vector<bool> known(X_FL.size(), true);
      ThreadTimer timer;
      query.run(X_FL, known, {&cloud}, &results);
      times.query.push_back(timer.lap());
      query_with.run(X_FL, known, {&cloud, &memory}, &results);
      times.query_with.push_back(timer.lap());
    }
    Eigen::VectorXd command(q.size());
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      command[i] = 0.6 * std::sin(world.time() * (0.9 + 0.3 * static_cast<double>(i)));
    }
    world.step(command);
  }
  print(times);
  const ist::MemoryCounts counts = map.counts();
  std::printf("last cloud: %zu obstacle points, %zu other rays; ", scan.hits.size(),
              scan.free_ends.size());
  std::printf("%zu voxels known, %zu occupied, %zu in memory, %zu boxes hidden\n", counts.known,
              counts.occupied, counts.nodes, boxes.size());
  if (minutes > 0.0) watch_memory(std::move(kept), minutes);
  return 0;
}
