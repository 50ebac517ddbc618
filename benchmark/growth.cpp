// Growth of a query's time with the number of spheres, points and links, and with the distance to
// the obstacle, as CSV. The scene is synthetic; no data is needed.
//
// One thread, processor time of that thread. Every query starts from another pose, so temporal
// coherence helps little.
//
// Usage: growth RESULT.csv CACHE_FOLDER; scripts/benchmark calls it.

#include <algorithm>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "peers/scene.h"
#include "support.h"
#include "support/whole_cloud.h"

namespace {

using ist::benchmark::Frame;
using ist::benchmark::quantile;
using ist::benchmark::Robot;
using ist::benchmark::ThreadTimer;
using Model = std::shared_ptr<const ist::RobotModel>;
using Poses = std::vector<std::vector<Eigen::Isometry3d>>;

constexpr std::size_t kPoses = 100;
constexpr double kMaxError = 0.005;             // [m] where it does not vary
constexpr double kTolerances[] = {0.001, 0.0};  // [m]

ist::QueryConfig query_config(double tolerance) {
  ist::QueryConfig config;
  config.max_distance = 10.0;
  config.tolerance = tolerance;
  return config;
}

// The snapshot keeps the frame: queries read its points when they need them.
ist::CloudSnapshot ingested(Frame frame) {
  const auto owner = std::make_shared<const Frame>(std::move(frame));
  ist::RawCloud raw = owner->raw();
  raw.owner = owner;
  ist::IngestConfig config = ist::test::whole_cloud();
  config.max_points = raw.size();  // the largest cloud has more points than the default allows
  ist::CloudSnapshot snapshot;
  ist::Ingest(config).run(raw, owner->X_FS, {}, 0.0, &snapshot);
  return snapshot;
}

// Random poses of every link without contact.
Poses free_poses(const Model& model, const ist::CloudSnapshot& cloud) {
  std::mt19937_64 rng(2);
  const std::size_t links = model->links.size();
  ist::ProximityQuery query(model, query_config(0.001));
  std::vector<ist::LinkProximity> results;
  Poses poses(kPoses, std::vector<Eigen::Isometry3d>(links));
  for (auto& X_FL : poses) {
    std::vector<bool> wanted(links, true);
    while (std::find(wanted.begin(), wanted.end(), true) != wanted.end()) {
      for (std::size_t i = 0; i < links; ++i) {
        if (wanted[i]) X_FL[i] = ist::benchmark::synthetic_pose(&rng);
      }
      query.run(X_FL, wanted, {&cloud}, &results);
      for (std::size_t i = 0; i < links; ++i) {
        if (wanted[i]) wanted[i] = results[i].state == ist::LinkState::kContact;
      }
    }
  }
  return poses;
}

void measure(std::FILE* csv, const char* what, double value, const Model& model,
             const ist::CloudSnapshot& cloud, const Poses& poses) {
  const std::vector<bool> known(model->links.size(), true);
  for (const double tolerance : kTolerances) {
    ist::ProximityQuery query(model, query_config(tolerance));
    std::vector<ist::LinkProximity> results;
    std::vector<double> us;
    for (int round = 0; round < 3; ++round) {  // the first round warms the caches
      for (const auto& X_FL : poses) {
        ThreadTimer timer;
        query.run(X_FL, known, {&cloud}, &results);
        if (round > 0) us.push_back(timer.lap());
      }
    }
    std::fprintf(csv, "%s,%g,%g,%.1f,%.1f\n", what, value, 1e3 * tolerance, quantile(us, 0.5),
                 quantile(us, 0.99));
    std::fflush(csv);
  }
}

std::size_t spheres_of(const Model& model) {
  std::size_t count = 0;
  for (const ist::LinkModel& link : model->links) count += link.tree.sphere_count();
  return count;
}

// A sheet of points in the plane z = 0, 2.4 m x 1.8 m.
Frame sheet() {
  Frame frame;
  frame.width = 640;
  frame.height = 480;
  for (std::size_t v = 0; v < frame.height; ++v) {
    for (std::size_t u = 0; u < frame.width; ++u) {
      const float x = (static_cast<float>(u) / 639.0F - 0.5F) * 2.4F;
      const float y = (static_cast<float>(v) / 479.0F - 0.5F) * 1.8F;
      frame.data.insert(frame.data.end(), {x, y, 0.0F, 0.0F});
    }
  }
  return frame;
}

// Every link in a random orientation with its lowest vertex `height` above the sheet.
Poses poses_above(const Robot& robot, double height) {
  std::mt19937_64 rng(3);
  Poses poses(kPoses);
  for (auto& X_FL : poses) {
    for (const ist::TriangleMesh& mesh : robot.meshes) {
      Eigen::Isometry3d X = ist::benchmark::synthetic_pose(&rng);
      double lowest = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector3d& v : mesh.vertices) lowest = std::min(lowest, (X * v).z());
      X.translation().z() += height - lowest;
      X_FL.push_back(X);
    }
  }
  return poses;
}

}  // namespace

int main(int argc, char** argv) {
  std::FILE* csv = argc == 3 ? std::fopen(argv[1], "w") : nullptr;
  if (csv == nullptr) {
    std::fprintf(stderr, "Usage: growth RESULT.csv CACHE_FOLDER\n");
    return 2;
  }
  std::fprintf(csv, "what,value,tolerance_mm,query_us,query_p99_us\n");
  Robot robot;
  robot.cache_directory = argv[2];
  robot.meshes = ist::benchmark::synthetic_meshes();
  const Model model = robot.pack(kMaxError);
  const ist::CloudSnapshot cloud = ingested(ist::benchmark::synthetic_frame(640, 480));
  const Poses poses = free_poses(model, cloud);
  for (const double max_error : {0.013, 0.005, 0.002, 0.0009, 0.0006}) {
    const Model packed = robot.pack(max_error);
    measure(csv, "spheres", static_cast<double>(spheres_of(packed)), packed, cloud, poses);
  }
  for (const std::size_t width : {160, 320, 640, 1280, 2560, 3200}) {
    const ist::CloudSnapshot other =
        ingested(ist::benchmark::synthetic_frame(width, width * 3 / 4));
    measure(csv, "points", static_cast<double>(other.index.size()), model, other, poses);
  }
  const std::vector<ist::TriangleMesh> meshes = robot.meshes;
  for (const std::size_t links : {7, 14, 35, 70}) {
    Robot many;
    many.cache_directory = robot.cache_directory;
    for (std::size_t i = 0; i < links; ++i) many.meshes.push_back(meshes[i % 7]);
    const Model packed = many.pack(kMaxError);
    measure(csv, "links", static_cast<double>(links), packed, cloud, free_poses(packed, cloud));
  }
  const ist::CloudSnapshot plane = ingested(sheet());
  for (const double height : {0.01, 0.03, 0.1, 0.3, 1.0, 2.0}) {
    measure(csv, "distance", height, model, plane, poses_above(robot, height));
  }
  std::fclose(csv);
  return 0;
}
