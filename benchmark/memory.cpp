// What remembering costs: the time of a cloud of 640 x 480 points beside liboctomap's insertion of
// the same clouds in the same run (octomap_server's: insertPointCloud with a largest range, a ray
// for each point), and the query with and without what is remembered. The simulated arm moves among
// obstacles in front of a depth camera.

#include <octomap/octomap.h>

#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "internal/cloud/memory_scan.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/octomap.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "scene.h"
#include "simulation.h"
#include "support.h"
#include "support/demo_arm.h"

namespace {

using ist::benchmark::quantile;
using ist::benchmark::text_of;
using ist::benchmark::ThreadTimer;

constexpr double kResolution = 0.02;    // [m]
constexpr double kMaxRange = 3.0;       // [m]
constexpr std::size_t kPeerEvery = 10;  // liboctomap takes one cloud of so many
using Poses = std::vector<Eigen::Isometry3d>;

struct Times {
  std::vector<double> ingest, scan, insert, boxes;  // [us] of a cloud
  std::vector<double> octomap, octomap_discrete;    // [us] of the same
  std::vector<double> message, octomap_message;     // [us] of the map as a message
  std::vector<double> query, query_with;            // [us]
};

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
double write_octomap(const ist::MemoryMap& map, const octomap::OcTree& known) {
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
  return timer.lap();
}

// The voxels that the map knows, each a leaf.
std::unique_ptr<octomap::OcTree> known_voxels(const ist::MemoryMap& map) {
  auto tree = ist::to_octree(map);
  tree->expand();
  return tree;
}

std::string row(const char* name, const std::vector<double>& us) {
  return text_of("| %s | %.2f ms | %.2f ms |\n", name, 1e-3 * quantile(us, 0.5),
                 1e-3 * quantile(us, 0.99));
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
  return text +
         text_of(
             "\nClouds a second on one core: %.1f. liboctomap: %.2f as octomap_server inserts, "
             "%.2f discretized;\nit takes %.1f and %.1f times as long. With memory the query's "
             "99th percentile is %.2f times that\nwithout.\n",
             1e6 / ours, 1e6 / peer, 1e6 / discrete, peer / ours, discrete / ours,
             quantile(t.query_with, 0.99) / quantile(t.query, 0.99));
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

// The demonstration, with walls and one camera of 640 x 480 pixels.
ist::sim::Simulation make_world(const ist::RobotDescription& robot) {
  ist::sim::DepthCameraConfig camera = ist::sim::demo_cameras().front();
  camera.width = 640;
  camera.height = 480;
  camera.focal_length *= 4.0;
  camera.max_depth = 4.5;
  std::vector<ist::sim::Obstacle> obstacles = walls();
  for (const ist::sim::Obstacle& one : ist::sim::demo_obstacles()) obstacles.push_back(one);
  ist::sim::Simulation world(robot, ist::sim::demo_arm(), obstacles, {camera}, 1);
  world.arm().reset(
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(world.arm().config().joints.size())));
  return world;
}

// Clouds and queries, without and with memory, and liboctomap beside it.
class Trial {
 public:
  Trial(std::shared_ptr<const ist::RobotModel> model, const Eigen::Isometry3d& X_FS)
      : model_(std::move(model)),
        X_FS_(X_FS),
        ingest_(ingest_config()),
        map_(memory_config()),
        query_(model_, {}),
        query_with_(model_, {}) {}

  void take(ist::sim::Picture picture, const Poses& X_FL) {
    picture_ = std::move(picture);
    const auto solids = posed_solids(*model_, X_FL, std::vector<bool>(X_FL.size(), true));
    ThreadTimer timer;
    ingest_.run(picture_.raw(), X_FS_, solids, picture_.stamp, &cloud_);
    times_.ingest.push_back(timer.lap());
    read_memory_scan(picture_.raw(), cloud_, X_FS_, ingest_config().min_range, kMaxRange, &scan_);
    times_.scan.push_back(timer.lap());
    map_.insert(scan_);
    times_.insert.push_back(timer.lap());
    map_.hidden_boxes(&boxes_);
    auto index = std::make_shared<ist::BoxIndex>();
    index->build(boxes_);
    memory_.boxes = index;
    times_.boxes.push_back(timer.lap());
    if (times_.ingest.size() % kPeerEvery == 1) take_with_peer();
  }

  void query(const Poses& X_FL) {
    if (times_.ingest.empty()) return;
    const std::vector<bool> known(X_FL.size(), true);
    ThreadTimer timer;
    query_.run(X_FL, known, {&cloud_}, &results_);
    times_.query.push_back(timer.lap());
    query_with_.run(X_FL, known, {&cloud_, &memory_}, &results_);
    times_.query_with.push_back(timer.lap());
  }

  const Times& times() const { return times_; }

 private:
  static ist::IngestConfig ingest_config() {
    ist::IngestConfig config;
    config.max_range = kMaxRange;
    config.self_filter_padding = 0.03;
    return config;
  }
  static ist::MemoryConfig memory_config() {
    ist::MemoryConfig config;
    config.resolution = kResolution;
    config.max_range = kMaxRange;
    return config;
  }

  void take_with_peer() {
    times_.octomap.push_back(insert_octomap(scan_, false, &tree_));
    times_.octomap_discrete.push_back(insert_octomap(scan_, true, &discrete_tree_));
    const auto voxels = known_voxels(map_);
    ThreadTimer timer;
    map_.octree_bytes();
    times_.message.push_back(timer.lap());
    times_.octomap_message.push_back(write_octomap(map_, *voxels));
  }

  std::shared_ptr<const ist::RobotModel> model_;
  Eigen::Isometry3d X_FS_;
  ist::Ingest ingest_;
  ist::MemoryMap map_;
  octomap::OcTree tree_{kResolution}, discrete_tree_{kResolution};
  ist::sim::Picture picture_;
  ist::CloudSnapshot cloud_, memory_;
  ist::MemoryScan scan_;
  ist::VoxelBoxes boxes_;
  ist::ProximityQuery query_, query_with_;
  std::vector<ist::LinkProximity> results_;
  Times times_;
};

}  // namespace

int main(int argc, char** argv) {
  double seconds = 4.0;
  ist::benchmark::CommandLine line("What remembering costs, beside liboctomap.");
  line.add_option("--seconds", seconds, "Of simulation");
  line.read(argc, argv);
  const ist::RobotDescription robot = ist::test::demo_robot();
  ist::sim::Simulation world = make_world(robot);
  Trial trial(ist::build_robot_model(robot, {}), world.cameras()[0].config().X_FC);
  Eigen::VectorXd command = 0.0 * world.arm().positions();
  for (int step = 0; world.time() < seconds; ++step) {
    for (ist::sim::Picture& newest : world.take_pictures()) {
      const Poses X_FL = world.link_poses(newest.stamp);
      trial.take(std::move(newest), X_FL);
    }
    if (step % 2 == 0) trial.query(world.link_poses());
    for (Eigen::Index i = 0; i < command.size(); ++i) {
      command[i] = 0.6 * std::sin(world.time() * (0.9 + 0.3 * static_cast<double>(i)));
    }
    world.step(command);
  }
  return line.publish("memory cost", table(trial.times()));
}
