// The memory's semantics against liboctomap, voxel by voxel.

#include <gtest/gtest.h>
#include <octomap/octomap.h>

#include <cmath>
#include <random>
#include <string>

#include "cloud/memory/voxel_ray.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/octomap.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

MemoryConfig config_of(double resolution, bool discretize, double max_range) {
  MemoryConfig config;
  config.decay = std::numeric_limits<double>::infinity();
  config.resolution = resolution;
  config.discretize = discretize;
  config.max_range = max_range;
  return config;
}

// A cloud about a surface or in all directions, as some sensors see it.
MemoryScan random_scan(test::Rng* rng) {
  std::uniform_real_distribution<float> place(-1.5F, 1.5F);
  std::normal_distribution<float> noise(0.0F, 0.02F);
  MemoryScan scan;
  scan.origin = {place(*rng), place(*rng), place(*rng)};
  const int points = 1 + static_cast<int>((*rng)() % 60);
  const bool is_plane = (*rng)() % 2 == 0;
  const float height = place(*rng);
  for (int i = 0; i < points; ++i) {
    Eigen::Vector3f p(place(*rng), place(*rng), place(*rng));
    if (is_plane) p.z() = height + noise(*rng);
    if ((*rng)() % 8 == 0) p = scan.origin;          // a point at the sensor
    if ((*rng)() % 8 == 0) p.x() = scan.origin.x();  // a ray in a plane of the grid's axes
    scan.hits.push_back(p);
  }
  return scan;
}

octomap::Pointcloud cloud_of(const MemoryScan& scan) {
  octomap::Pointcloud cloud;
  for (const Eigen::Vector3f& p : scan.hits) cloud.push_back(p.x(), p.y(), p.z());
  return cloud;
}

struct Differences {
  std::size_t compared = 0, occupied = 0, free = 0, different = 0;
};

// Compares all voxels that either of them knows.
// @param is_binary  the tree is of a file that holds no log-odds
void compare(const MemoryMap& map, const octomap::OcTree& tree, Differences* d,
             bool is_binary = false) {
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    const int side = 1 << (16 - leaf.getDepth());  // pruned leaves hold several voxels
    const octomap::OcTreeKey low = leaf.getIndexKey();
    for (int i = 0; i < side * side * side; ++i) {
      const octomap::OcTreeKey key(low[0] + i % side, low[1] + i / side % side,
                                   low[2] + i / side / side);
      const octomap::point3d c = tree.keyToCoord(key);
      const bool is_ours = is_binary || map.log_odds({c.x(), c.y(), c.z()}) == leaf->getLogOdds();
      const bool is_occupied = tree.isNodeOccupied(*leaf);
      ++d->compared;
      ++(is_occupied ? d->occupied : d->free);
      const VoxelState expected = is_occupied ? VoxelState::kOccupied : VoxelState::kFree;
      if (!is_ours || map.state({c.x(), c.y(), c.z()}) != expected) ++d->different;
    }
  }
}

void expect_same(const MemoryMap& map, const octomap::OcTree& tree, Differences* d) {
  const std::size_t before = d->compared;
  compare(map, tree, d);
  // As many known here as there, and all of those there are known here: no other is.
  if (map.counts().known != d->compared - before) ++d->different;
}

TEST(MemoryOctomap, RandomCloudsLeaveTheSameVoxels) {
  test::Rng rng(20261122);
  std::uniform_real_distribution<double> log_resolution(std::log(0.02), std::log(0.3));
  Differences d;
  int clouds = 0;
  while (clouds < 1000) {
    const bool discretize = rng() % 2 == 0;
    const double max_range = rng() % 3 == 0 ? 0.8 : 100.0;
    const double resolution = rng() % 2 == 0 ? 0.05 : std::exp(log_resolution(rng));
    octomap::OcTree tree(resolution);
    MemoryMap map(config_of(resolution, discretize, max_range));
    for (int i = 0; i < 20; ++i, ++clouds) {
      MemoryScan scan = random_scan(&rng);
      scan.stamp = 0.1 * i;
      const octomap::point3d origin(scan.origin.x(), scan.origin.y(), scan.origin.z());
      tree.insertPointCloud(cloud_of(scan), origin, max_range, false, discretize);
      map.insert(scan);
      expect_same(map, tree, &d);
    }
  }
  EXPECT_EQ(d.different, 0U) << "of " << d.compared << " voxels";
  EXPECT_GT(d.occupied, 100000U);
  EXPECT_GT(d.free, 100000U);
}

TEST(MemoryOctomap, FilesAreReadByEachOther) {
  test::Rng rng(7);
  const test::TempDir folder;
  for (const double resolution : {0.05, 0.02, 1.0 / 30.0}) {
    MemoryMap map(config_of(resolution, true, 100.0));
    for (int i = 0; i < 10; ++i) map.insert(random_scan(&rng));
    const std::string path = (folder.path() / "memory.bt").string();
    ASSERT_EQ(map.write_file(path), "");
    octomap::OcTree tree(0.1);
    ASSERT_TRUE(tree.readBinary(path));
    Differences d;
    compare(map, tree, &d, true);
    EXPECT_EQ(d.different, 0U);
    EXPECT_EQ(d.compared, map.counts().known);
    EXPECT_TRUE(*to_octree(map) == tree);
    EXPECT_EQ(to_octree(MemoryMap(map.config()))->size(), 0U);

    // And back, as octomap writes it.
    const std::string again = (folder.path() / "again.bt").string();
    ASSERT_TRUE(tree.writeBinary(again));
    MemoryMap read(config_of(resolution, true, 100.0));
    ASSERT_EQ(read.read_file(again, 0.0), "");
    EXPECT_EQ(read.counts().known, map.counts().known);
    EXPECT_EQ(read.counts().occupied, map.counts().occupied);
    EXPECT_EQ(read.octree_bytes(), map.octree_bytes());
  }
}

}  // namespace
}  // namespace ist
