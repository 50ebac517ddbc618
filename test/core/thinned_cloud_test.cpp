// The thinned cloud, which is found node by node when a query first asks for it, against one that
// is made of all points at once.

#include "internal/cloud/thinned_cloud.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <thread>
#include <tuple>
#include <vector>

#include "cloud/thinning/voxel_kernel.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "support/allocations.h"
#include "support/instruction_sets.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/tiles.h"
#include "support/whole_cloud.h"

namespace ist {
namespace {

using Points = std::vector<Eigen::Vector3d>;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// A message of four floats a point, which lives as long as its snapshot.
RawCloud message_of(const Points& points_S, std::size_t width) {
  const auto floats = std::make_shared<std::vector<float>>();
  for (const Eigen::Vector3d& p : points_S) {
    for (int i = 0; i < 3; ++i) floats->push_back(static_cast<float>(p[i]));
    floats->push_back(0.0F);
  }
  RawCloud cloud = packed_cloud(floats->data(), width, points_S.size() / width, 4);
  cloud.owner = floats;
  return cloud;
}

CloudSnapshot snapshot_of(const RawCloud& cloud, const Eigen::Isometry3d& X_FS,
                          double thinning = 0.01) {
  IngestConfig config = test::whole_cloud(true);
  config.thinning = thinning;
  CloudSnapshot snapshot;
  Ingest(config).run(cloud, X_FS, {}, 0.0, &snapshot);
  return snapshot;
}

// A depth image of a slanted wall with a board before it, and holes of several sizes.
Points depth_image(std::size_t width, std::size_t height, test::Rng* rng) {
  Points points;
  for (std::size_t i = 0; i < width * height; ++i) {
    const double u = static_cast<double>(i % width) / 300.0 - 0.2,
                 v = static_cast<double>(i / width) / 300.0 - 0.2;
    const bool board = u > 0.0 && v < 0.05;
    const double depth = (board ? 0.6 : 1.0 + 0.4 * u) + test::uniform(rng, -0.001, 0.001);
    const bool hole = (u < -0.1 && std::abs(v) < 0.03) || (*rng)() % 200 == 0;
    points.emplace_back(Eigen::Vector3d(u, v, 1.0) * (hole ? static_cast<double>(kNan) : depth));
  }
  return points;
}

using Thinned = std::map<std::uint32_t, std::array<float, 4>>;  // point and weight by id

Thinned found(const PointIndex& index) {
  Thinned all;
  for (const ThinnedTile& tile : test::thinned_tiles_of(index)) {
    for (int k = 0; k < tile.count; ++k) {
      EXPECT_TRUE(all.emplace(tile.id[k],
                              std::array<float, 4>{tile.x[k], tile.y[k], tile.z[k], tile.weight[k]})
                      .second)
          << "point " << tile.id[k] << " is in two nodes";
      EXPECT_TRUE(tile.box.min_x[0] <= tile.x[k] && tile.x[k] <= tile.box.max_x[0]);
      EXPECT_TRUE(tile.box.min_y[0] <= tile.y[k] && tile.y[k] <= tile.box.max_y[0]);
      EXPECT_TRUE(tile.box.min_z[0] <= tile.z[k] && tile.z[k] <= tile.box.max_z[0]);
    }
  }
  return all;
}

// All points at once, one entry for each voxel.
Thinned expected(const CloudSnapshot& snapshot) {
  const VoxelGrid grid(snapshot.index.X_FO(), snapshot.thinning);
  using Voxel = std::array<float, 3>;
  using Best = std::tuple<float, float, float, float, std::uint32_t>;
  std::map<Voxel, Best> voxels;
  for (const PointTile& tile : test::tiles_of(snapshot.index)) {
    TileVoxels of_tile;
    find_voxels(grid, tile, &of_tile);
    for (int k = 0; k < tile.count; ++k) {
      const Best one(of_tile.offset_sq[k], tile.x[k], tile.y[k], tile.z[k], tile.id[k]);
      const auto [at, is_new] =
          voxels.emplace(Voxel{of_tile.x[k], of_tile.y[k], of_tile.z[k]}, one);
      if (!is_new) at->second = std::min(at->second, one);
    }
  }
  Thinned all;
  for (const auto& [voxel, best] : voxels) {
    const auto& [offset_sq, x, y, z, id] = best;
    all[id] = {x, y, z, cell_weight(offset_sq)};
  }
  return all;
}

TEST(ThinnedCloud, IsThatOfAllPointsAtOnce) {
  test::Rng rng(201);
  for (int trial = 0; trial < test::scaled(12); ++trial) {
    SCOPED_TRACE(trial);
    const Eigen::Isometry3d X_FS = test::random_pose(&rng, 1.0);
    Points points = depth_image(160, 120, &rng);
    std::size_t width = 160;
    if (trial % 3 == 1) {  // a list
      std::shuffle(points.begin(), points.end(), rng);
      width = points.size();
    }
    if (trial % 3 == 2) {  // a volume
      for (Eigen::Vector3d& p : points) p = test::random_vector(&rng, 0.3);
      width = points.size();
    }
    const CloudSnapshot snapshot =
        snapshot_of(message_of(points, width), X_FS, trial % 2 == 0 ? 0.01 : 0.035);
    const Thinned all = found(snapshot.index);
    EXPECT_GT(all.size(), 100U);
    EXPECT_EQ(all, expected(snapshot));
  }
}

// Where thousands of points share a voxel or a place, many tiles might hold a better point. All the
// same the work must not grow with the square of their number: a node's first rivals are the most
// likely ones.
TEST(ThinnedCloud, ManyPointsInAVoxel) {
  test::Rng rng(203);
  for (const double size : {0.0, 1e-4, 0.004, 0.02}) {
    SCOPED_TRACE(size);
    Points points(60000);
    for (Eigen::Vector3d& p : points) {
      p = test::random_vector(&rng, size) + Eigen::Vector3d(0.3041, 0.2043, 0.5042);
    }
    const CloudSnapshot snapshot =
        snapshot_of(message_of(points, points.size()), Eigen::Isometry3d::Identity());
    EXPECT_EQ(found(snapshot.index), expected(snapshot));
  }
}

// The points of a node do not depend on which nodes were asked for before.
TEST(ThinnedCloud, DoesNotDependOnTheOrderOfQueries) {
  test::Rng rng(204);
  const RawCloud message = message_of(depth_image(160, 120, &rng), 160);
  const Eigen::Isometry3d X_FS = test::random_pose(&rng, 1.0);
  const CloudSnapshot forward = snapshot_of(message, X_FS), backward = snapshot_of(message, X_FS);
  const Thinned all = found(forward.index);
  const ThinnedCloud cloud = backward.index.bvh().thinned();
  ThinnedNode buffer;
  for (std::size_t i = cloud.nodes().size(); i-- > 0;) {
    if (ThinnedCloud::is_leaf(cloud.nodes()[i])) cloud.tiles(static_cast<std::int32_t>(i), &buffer);
  }
  EXPECT_EQ(found(backward.index), all);
}

TEST(ThinnedCloud, ThreadsFindTheSamePoints) {
  test::Rng rng(205);
  const RawCloud message = message_of(depth_image(160, 120, &rng), 160);
  const Eigen::Isometry3d X_FS = test::random_pose(&rng, 1.0);
  const Thinned all = found(snapshot_of(message, X_FS).index);
  for (int round = 0; round < test::scaled(10); ++round) {
    const CloudSnapshot snapshot = snapshot_of(message, X_FS);
    std::array<Thinned, 3> answers;
    std::vector<std::thread> threads;
    for (Thinned& answer : answers) {
      threads.emplace_back([&answer, &snapshot] { answer = found(snapshot.index); });
    }
    for (std::thread& thread : threads) thread.join();
    for (const Thinned& answer : answers) ASSERT_EQ(answer, all);
    ASSERT_EQ(found(snapshot.index), all) << "what they stored";
  }
}

// A wall of 1.3 m; a small link before its middle.
struct NearAWall {
  NearAWall() {
    test::Rng rng(206);
    Points points;
    for (int v = -160; v < 160; ++v) {
      for (int u = -160; u < 160; ++u) points.emplace_back(0.004 * u, 0.004 * v, 1.0);
    }
    message = message_of(points, 320);
    auto robot = std::make_shared<RobotModel>();
    robot->links.resize(1);
    robot->links[0].packing.spheres = {{{0.0, 0.0, 0.0}, 0.03, 0.03}};
    model = robot;
    X_FL.translation() = Eigen::Vector3d(0.01, 0.02, 0.9);
    proximity.state = LinkState::kNear;
    proximity.distance = 0.07;
    proximity.direction = -Eigen::Vector3d::UnitZ();
  }
  CloudSnapshot snapshot() const { return snapshot_of(message, Eigen::Isometry3d::Identity()); }

  RawCloud message;
  std::shared_ptr<const RobotModel> model;
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  LinkProximity proximity;
};

std::size_t loaded_tiles(const PointBvh& bvh) {
  std::size_t loaded = 0;
  for (std::size_t i = 0; i < bvh.tile_count(); ++i) loaded += bvh.is_loaded(i) ? 1 : 0;
  return loaded;
}

// The cost of a cloud: ingest reads no tile, and repulsion only those near what counts.
TEST(ThinnedCloud, OnlyTilesNearALinkAreRead) {
  const NearAWall scene;
  const CloudSnapshot fresh = scene.snapshot(), asked = scene.snapshot();
  EXPECT_EQ(loaded_tiles(fresh.index.bvh()), 0U);
  const Repulsion repulsion(scene.model);
  RepulsionConfig config;
  config.smoothing = 0.05;
  const RepulsiveWrench push = repulsion.wrench(0, scene.X_FL, {&asked}, scene.proximity, config);
  EXPECT_LT(push.force.z(), -0.5);
  const std::size_t loaded = loaded_tiles(asked.index.bvh());
  EXPECT_GT(loaded, 100U);
  EXPECT_LT(loaded, asked.index.bvh().tile_count() / 8);
}

TEST(ThinnedCloud, ThinningAllocatesNothing) {
  const NearAWall scene;
  const CloudSnapshot snapshot = scene.snapshot();
  const Repulsion repulsion(scene.model);
  const std::vector<const CloudSnapshot*> clouds = {&snapshot};
  const long before = test::allocations;
  repulsion.wrench(0, scene.X_FL, clouds, scene.proximity, {});
  EXPECT_EQ(test::allocations - before, 0);
}

// A copy thins what it holds itself.
TEST(ThinnedCloud, CopyIsThinnedAlike) {
  test::Rng rng(207);
  const RawCloud message = message_of(depth_image(96, 80, &rng), 96);
  CloudSnapshot copy;
  Thinned all;
  {
    const CloudSnapshot snapshot = snapshot_of(message, Eigen::Isometry3d::Identity());
    copy = snapshot;
    all = found(snapshot.index);
  }
  EXPECT_EQ(found(copy.index), all);
}

}  // namespace
}  // namespace ist
