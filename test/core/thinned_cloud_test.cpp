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
#include <thread>
#include <tuple>
#include <vector>

#include "cloud/thinning/voxel_kernel.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/repulsion/repulsion.h"
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
  IngestConfig config = test::whole_cloud();
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
