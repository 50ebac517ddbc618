// Distances from links to an octree map: Inner Sphere Trees against FCL's mesh - octree distance,
// on the same map in the same run. Without FCL the first only.
//
// The map is clutter in a cube of 8 m: patches of surface made of occupied leaves of 1 to 8 cm. The
// links are the Panda's (test data: IST_PROXIMITY_DATA, or ../shared/data).
//
// Usage: octomap [leaves] [queries]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <random>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support.h"
#include "truth_scenes.h"

#ifdef IST_PROXIMITY_HAS_FCL
#include <fcl/fcl.h>
#include <octomap/octomap.h>
#endif

namespace {

using ist::benchmark::Clock;
using ist::benchmark::microseconds_since;
using ist::benchmark::quantile;

constexpr double kLeaf = 0.01;  // [m]

// Leaves begin at multiples of their own size, as in an octree.
std::vector<Eigen::AlignedBox3d> make_map_boxes(std::size_t leaves) {
  std::mt19937_64 rng(1);
  std::uniform_real_distribution<double> place(-4.0, 4.0);
  std::vector<Eigen::AlignedBox3d> boxes;
  while (boxes.size() < leaves) {
    const int choice = static_cast<int>(rng() % 100);
    const int level = choice == 0 ? 3 : choice % 2;
    const double size = kLeaf * (1 << level);
    // One patch of a surface: a square of leaves.
    Eigen::Vector3d low(place(rng), place(rng), place(rng));
    if (low.norm() < 0.6) continue;  // the robot stands there
    const int flat = static_cast<int>(rng() % 3);
    for (int i = 0; i < 20; ++i) {
      for (int j = 0; j < 20; ++j) {
        Eigen::Vector3d corner = low;
        corner[(flat + 1) % 3] += i * size;
        corner[(flat + 2) % 3] += j * size;
        corner = size * (corner / size).array().floor();
        boxes.emplace_back(corner, corner + Eigen::Vector3d::Constant(size));
      }
    }
  }
  boxes.resize(leaves);
  return boxes;
}

#ifdef IST_PROXIMITY_HAS_FCL
std::vector<ist::TriangleMesh> panda_meshes(const std::filesystem::path& data) {
  std::vector<ist::TriangleMesh> meshes;
  for (std::size_t i = 0; i < ist::test::kPandaLinks; ++i) {
    const auto file = data / "robots/franka_description/meshes/visual" /
                      (std::string(ist::test::panda_mesh(i)) + ".dae");
    meshes.push_back(ist::load_mesh(file.string()));
  }
  return meshes;
}

class Fcl {
 public:
  // Large leaves are entered as smallest ones, which octomap merges again.
  Fcl(const std::vector<Eigen::AlignedBox3d>& boxes, const std::vector<ist::TriangleMesh>& meshes) {
    auto tree = std::make_shared<octomap::OcTree>(kLeaf);
    for (const Eigen::AlignedBox3d& box : boxes) {
      const int n = static_cast<int>(std::lround(box.sizes().x() / kLeaf));
      for (int i = 0; i < n * n * n; ++i) {
        const Eigen::Vector3d p =
            box.min() + kLeaf * Eigen::Vector3d(i % n + 0.5, i / n % n + 0.5, i / n / n + 0.5);
        tree->updateNode(p.x(), p.y(), p.z(), true, true);
      }
    }
    tree->updateInnerOccupancy();
    tree->prune();
    for (auto leaf = tree->begin_leafs(); leaf != tree->end_leafs(); ++leaf) {
      const Eigen::Vector3d center(leaf.getX(), leaf.getY(), leaf.getZ());
      const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * leaf.getSize());
      leaves_.emplace_back(center - half, center + half);
    }
    const auto geometry = std::make_shared<fcl::OcTree<double>>(tree);
    room_ = std::make_unique<fcl::CollisionObject<double>>(geometry);
    for (const ist::TriangleMesh& mesh : meshes) {
      const auto model = std::make_shared<fcl::BVHModel<fcl::OBBRSS<double>>>();
      std::vector<fcl::Triangle> triangles;
      for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
      model->beginModel();
      model->addSubModel(mesh.vertices, triangles);
      model->endModel();
      links_.push_back(std::make_unique<fcl::CollisionObject<double>>(model));
    }
  }

  double distance(std::size_t link, const Eigen::Isometry3d& X_FL) {
    links_[link]->setTransform(X_FL);
    const fcl::DistanceRequest<double> request;
    fcl::DistanceResult<double> result;
    return fcl::distance(links_[link].get(), room_.get(), request, result);
  }

  /// The leaves of octomap's tree: the boxes merged, each once.
  const std::vector<Eigen::AlignedBox3d>& leaves() const { return leaves_; }

 private:
  std::unique_ptr<fcl::CollisionObject<double>> room_;
  std::vector<std::unique_ptr<fcl::CollisionObject<double>>> links_;
  std::vector<Eigen::AlignedBox3d> leaves_;
};
#endif

struct Comparison {
  std::vector<double> fcl_us;  // of a configuration
  int apart = 0;               // links that are near, and not in contact
  double largest = 0.0;        // [m] difference of their distances
};

#ifdef IST_PROXIMITY_HAS_FCL
void compare(Fcl* fcl, const std::vector<Eigen::Isometry3d>& X_FL,
             const std::vector<ist::LinkProximity>& results, Comparison* comparison) {
  const Clock::time_point start = Clock::now();
  std::vector<double> distances;
  for (std::size_t i = 0; i < results.size(); ++i) distances.push_back(fcl->distance(i, X_FL[i]));
  comparison->fcl_us.push_back(microseconds_since(start));
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (results[i].state != ist::LinkState::kNear) continue;
    ++comparison->apart;
    comparison->largest =
        std::max(comparison->largest, std::abs(results[i].distance - distances[i]));
  }
}
#endif

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path data = ist::benchmark::data_or_exit();
  const std::size_t leaves = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 1000000;
  const int queries = argc > 2 ? std::atoi(argv[2]) : 10;
  const auto model = ist::test::panda_model(data, 0.005);
  std::vector<Eigen::AlignedBox3d> boxes = make_map_boxes(leaves);
#ifdef IST_PROXIMITY_HAS_FCL
  Fcl fcl(boxes, panda_meshes(data));
  boxes = fcl.leaves();
#endif
  ist::BoxIndex index;
  const Clock::time_point build = Clock::now();
  index.build(boxes);
  const double build_ms = 1e-3 * microseconds_since(build);
  ist::CloudSnapshot map;
  map.boxes = std::make_shared<const ist::BoxIndex>(std::move(index));

  ist::QueryConfig config;
  config.max_distance = 10.0;
  const std::vector<bool> known(ist::test::kPandaLinks, true);
  std::printf("%zu leaves, index built in %.0f ms\n\n", boxes.size(), build_ms);
  std::printf(
      "| tolerance | motion | configurations | median, 11 links | p99 | without contact | median | "
      "p99 | FCL, median | times "
      "faster | links apart | largest difference to FCL |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const double tolerance : {0.001, 0.0}) {
    config.tolerance = tolerance;
    for (const char* motion : {"traj", "rand"}) {
      ist::ProximityQuery query(model, config);
      std::vector<double> us, free_us;
      std::vector<ist::LinkProximity> results;
      Comparison fcl_comparison;
      int count = 0;
      for (const ist::test::TruthCase& truth : ist::test::truth_cases(data, "mosd0", motion)) {
        const Clock::time_point start = Clock::now();
        query.run(truth.X_FL, known, {&map}, &results);
        us.push_back(microseconds_since(start));
        const bool is_free =
            std::none_of(results.begin(), results.end(), [](const ist::LinkProximity& result) {
              return result.state == ist::LinkState::kContact;
            });
        if (is_free) free_us.push_back(us.back());
        if (count++ >= queries) continue;
#ifdef IST_PROXIMITY_HAS_FCL
        compare(&fcl, truth.X_FL, results, &fcl_comparison);
#endif
      }
      const double median = quantile(us, 0.5), fcl_median = quantile(fcl_comparison.fcl_us, 0.5);
      std::printf(
          "| %.0f mm | %s | %zu | %.0f us | %.0f us | %zu | %.0f us | %.0f us | %.0f us | %.0f | "
          "%d "
          "| %.4f mm |\n",
          1e3 * tolerance, motion, us.size(), median, quantile(us, 0.99), free_us.size(),
          quantile(free_us, 0.5), quantile(free_us, 0.99), fcl_median, fcl_median / median,
          fcl_comparison.apart, 1e3 * fcl_comparison.largest);
    }
  }
  return 0;
}
