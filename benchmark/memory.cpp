// What remembering costs: the time of a cloud of 640 x 480 points beside liboctomap's insertion of
// the same clouds in the same run (octomap_server's: insertPointCloud with a largest range, a ray
// for each point), and the query with and without what is remembered. The simulated arm moves among
// obstacles in front of a depth camera.
//
// Usage: memory [seconds of simulation] [document]

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "document.h"
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

#include <memory>
#include <sstream>

#include "ist_proximity/octomap.h"
#endif

namespace {

using ist::benchmark::quantile;
using ist::benchmark::ThreadTimer;

constexpr double kResolution = 0.02;  // [m]
constexpr double kMaxRange = 3.0;     // [m]
constexpr int kPeerEvery = 10;        // liboctomap takes one cloud of so many

struct Times {
  std::vector<double> ingest, scan, insert, boxes;  // [us] of a cloud
  std::vector<double> octomap, octomap_discrete;    // [us] of the same
  std::vector<double> message, octomap_message;     // [us] of the map as a message
  std::vector<double> query, query_with;            // [us]
};

ist::MemoryConfig memory_config() {
  ist::MemoryConfig config;
  config.resolution = kResolution;
  config.max_range = kMaxRange;
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

// Writes the map as octomap's message by way of a tree: what it holds has to get there first.
double write_octomap(const ist::MemoryMap& map, const octomap::OcTree& known, std::size_t* size) {
  std::stringstream stream;
  ThreadTimer timer;
  octomap::OcTree tree(kResolution);
  for (auto leaf = known.begin_leafs(); leaf != known.end_leafs(); ++leaf) {
    const octomap::point3d p = leaf.getCoordinate();
    tree.setNodeValue(leaf.getKey(), map.log_odds({p.x(), p.y(), p.z()}), true);
  }
  tree.updateInnerOccupancy();
  tree.toMaxLikelihood();
  tree.prune();
  tree.writeBinaryData(stream);
  const double us = timer.lap();
  *size = stream.str().size();
  return us;
}

// The voxels that the map knows, each a leaf.
std::unique_ptr<octomap::OcTree> known_voxels(const ist::MemoryMap& map) {
  auto tree = ist::to_octree(map);
  tree->expand();
  return tree;
}
#endif

std::string line(const char* format, double a, double b) {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), format, a, b);
  return text.data();
}

std::string row(const char* name, const std::vector<double>& us) {
  return std::string("| ") + name +
         line(" | %.2f ms | %.2f ms |\n", 1e-3 * quantile(us, 0.5), 1e-3 * quantile(us, 0.99));
}

std::string table(const Times& t) {
  std::string text = "| a cloud of 640 x 480 points | median | 99th percentile |\n|---|---|---|\n";
  text += row("ingest, without memory", t.ingest);
  text += row("memory: points by obstacle and robot", t.scan);
  text += row("memory: insertion", t.insert);
  text += row("memory: boxes of what is hidden, and their index", t.boxes);
  text += row("liboctomap, as octomap_server", t.octomap);
  text += row("liboctomap, discretized", t.octomap_discrete);
  text += row("memory: as octomap's message", t.message);
  text += row("liboctomap: the same, by way of its tree", t.octomap_message);
  text += row("query of all links, without memory", t.query);
  text += row("query of all links, with memory", t.query_with);
  const double ours = quantile(t.scan, 0.5) + quantile(t.insert, 0.5) + quantile(t.boxes, 0.5);
  const double peer = quantile(t.octomap, 0.5), discrete = quantile(t.octomap_discrete, 0.5);
  text += line("\nClouds a second on one core: %.1f. liboctomap: %.2f as octomap_server inserts, ",
               1e6 / ours, 1e6 / peer);
  text += line("%.2f discretized;\nit takes %.1f ", 1e6 / discrete, peer / ours);
  text += line(
      "and %.1f times as long. With memory the query's 99th percentile is %.2f times that\n"
      "without.\n",
      discrete / ours, quantile(t.query_with, 0.99) / quantile(t.query, 0.99));
  return text;
}

// A room about the demonstration, so that every pixel has a depth.
std::vector<ist::sim::Obstacle> walls() {
  std::vector<ist::sim::Obstacle> all;
  for (const Eigen::Vector3d& middle : {Eigen::Vector3d(2.5, 0, 0), Eigen::Vector3d(-2.5, 0, 0),
                                        Eigen::Vector3d(0, 2.5, 0), Eigen::Vector3d(0, -2.5, 0)}) {
    ist::sim::Obstacle wall;
    wall.name = "wall";
    wall.shape = ist::Box{{middle.x() != 0 ? 0.1 : 5.0, middle.y() != 0 ? 0.1 : 5.0, 5.0}};
    wall.from = middle;
    all.push_back(wall);
  }
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 4.0;
  const ist::RobotDescription robot = ist::test::demo_robot();
  const auto model = ist::build_robot_model(robot, {});
  std::vector<ist::sim::DepthCameraConfig> cameras = ist::sim::demo_cameras();
  cameras.resize(1);
  cameras[0].width = 640;
  cameras[0].height = 480;
  cameras[0].focal_length *= 4.0;
  cameras[0].max_depth = 4.5;
  std::vector<ist::sim::Obstacle> obstacles = walls();
  for (const ist::sim::Obstacle& one : ist::sim::demo_obstacles()) obstacles.push_back(one);
  ist::sim::Simulation world(robot, ist::sim::demo_arm(), obstacles, cameras, 1);
  Eigen::VectorXd q =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(world.arm().config().joints.size()));
  world.arm().reset(q);

  ist::IngestConfig ingest_config;
  ingest_config.max_range = kMaxRange;
  ingest_config.self_filter_padding = 0.03;
  ist::Ingest ingest(ingest_config);
  ist::MemoryMap map(memory_config());
#ifdef IST_PROXIMITY_HAS_OCTOMAP
  octomap::OcTree tree(kResolution), discrete_tree(kResolution);
#endif
  std::size_t message_size = 0, octomap_message_size = 0;  // [bytes]
  ist::CloudSnapshot cloud, memory;
  ist::MemoryScan scan;
  ist::VoxelBoxes boxes;
  ist::ProximityQuery query(model, {}), query_with(model, {});
  std::vector<ist::LinkProximity> results;
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
      if (frames++ % kPeerEvery != 0) continue;
#ifdef IST_PROXIMITY_HAS_OCTOMAP
      times.octomap.push_back(insert_octomap(scan, false, &tree));
      times.octomap_discrete.push_back(insert_octomap(scan, true, &discrete_tree));
      const auto voxels = known_voxels(map);
      timer.lap();
      message_size = map.octree_bytes().size();
      times.message.push_back(timer.lap());
      times.octomap_message.push_back(write_octomap(map, *voxels, &octomap_message_size));
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
  const std::string text = table(times);
  std::printf("%s", text.c_str());
  const ist::MemoryCounts counts = map.counts();
  std::printf("last cloud: %zu obstacle points, %zu other rays; ", scan.hits.size(),
              scan.free_ends.size());
  std::printf("%zu voxels known, %zu occupied, %zu in memory, %zu boxes hidden\n", counts.known,
              counts.occupied, counts.nodes, boxes.size());
  std::printf("message: %zu bytes, liboctomap's: %zu\n", message_size, octomap_message_size);
  if (argc <= 2) return 0;
  return ist::benchmark::write_table(argv[2], "memory cost", text) ? 0 : 1;
}
