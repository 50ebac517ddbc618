// The memory under attack: what it is given is out of keys, out of time, out of memory, or crafted.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "internal/cloud/memory_scan.h"
#include "ist_proximity/cloud/depth_image.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/seen_space.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool holds(const VoxelBoxes& boxes, const Eigen::Vector3d& p) {
  return std::any_of(boxes.begin(), boxes.end(),
                     [&](const Eigen::AlignedBox3d& box) { return box.contains(p); });
}

MemoryScan ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& end, double stamp) {
  MemoryScan scan;
  scan.origin = origin;
  scan.hits = {end};
  scan.stamp = stamp;
  return scan;
}

// Space that no key holds was never seen. At 1 mm it begins at 32.8 m, at 2 cm at 655 m: a robot
// that drives in `odom`, or a map frame of UTM coordinates, is there.
TEST(HostileSeenSpace, SpaceOutsideAllKeysIsUnknown) {
  MemoryConfig config;
  config.resolution = 0.001;
  MemoryMap map(config);
  map.insert(ray({0, 0, 0}, {1, 0, 0}, 0.0));
  SeenSpace seen;
  seen.add(map);
  test::Rng rng(11);
  VoxelBoxes boxes;
  int outside = 0;
  for (int scene = 0; scene < 60; ++scene) {
    Eigen::Vector3d center = test::random_vector(&rng, 0.2);
    const int axis = scene % 3;
    center[axis] = (scene % 2 == 0 ? 1.0 : -1.0) * (scene < 30 ? 32.768 : 40.0);
    const double radius = 0.05;
    ASSERT_TRUE(seen.unknown_boxes(center, radius, 1000000, &boxes));
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p = center + test::random_vector(&rng, 0.57 * radius);
      if ((p - center).norm() > radius || !std::isnan(seen.time_seen(p))) continue;
      outside += std::abs(p[axis]) > 32.768 ? 1 : 0;
      ASSERT_TRUE(holds(boxes, p)) << "scene " << scene << ": " << p.transpose();
    }
  }
  EXPECT_GT(outside, 1000);
}

// Stamps that are no numbers say nothing of time, and nothing is lost or kept for ever by them.
TEST(HostileMemory, StampsThatAreNoNumbers) {
  for (const double stamp : {kNaN, kInfinity, -kInfinity}) {
    MemoryMap map{{}};
    map.insert(ray({0, 0, 0}, {1, 0, 0}, stamp));
    map.forget(stamp);
    const std::vector<Eigen::Vector4f> spheres = {{0, 0, 0, 0.1F}};
    map.note_free(spheres, stamp);
    map.insert(ray({0, 0, 0}, {1, 0, 0}, 5.0));
    EXPECT_EQ(map.now(), 5.0);
    map.insert(ray({0, 0, 0}, {0, 1, 0}, stamp));
    EXPECT_EQ(map.state({1.0, 0, 0}), VoxelState::kOccupied);
    EXPECT_EQ(map.state({0, 1.0, 0}), VoxelState::kOccupied);
    map.forget(15.1);
    EXPECT_EQ(map.counts().known, 0U);
  }
}

// A file that fills more than half of the memory is all there after the first cloud.
TEST(HostileMemory, AFileIsNotForgottenByTheFirstCloud) {
  const test::TempDir folder;
  const std::string path = folder.file("map.bt");
  MemoryConfig config;
  config.max_nodes = 512 * 100;
  MemoryMap first(config);
  MemoryScan scan;
  scan.origin = {0.0F, 0.0F, 0.01F};
  for (int i = 0; i < 70; ++i) {  // each in a block of its own
    scan.hits.emplace_back(0.08F + 0.16F * static_cast<float>(i % 10),
                           0.08F + 0.16F * static_cast<float>(i / 10), 0.01F);
  }
  first.insert(scan);
  const std::size_t occupied = first.counts().occupied;
  ASSERT_GE(occupied, 70U);
  ASSERT_EQ(first.write_file(path), "");
  MemoryMap second(config);
  ASSERT_EQ(second.read_file(path, 1.0), "");
  ASSERT_EQ(second.counts().occupied, occupied);
  second.insert(ray({0.0F, 0.0F, 0.01F}, {0.01F, 0.03F, 0.01F}, 1.1));
  EXPECT_EQ(second.counts().forgotten, 0U) << "of " << second.counts().known;
  EXPECT_GE(second.counts().occupied, occupied);
}

// Rays need more blocks than there is memory for. The obstacles at their ends come first.
TEST(HostileMemory, WithoutMemoryObstaclesComeBeforeFreeSpace) {
  MemoryConfig config;
  config.max_nodes = 4096;  // 8 blocks of 16 cm
  MemoryMap map(config);
  MemoryScan scan;
  for (int i = 0; i < 4; ++i) {
    const float angle = 1.5F * static_cast<float>(i);
    scan.hits.emplace_back(3.0F * std::cos(angle), 3.0F * std::sin(angle), 0.1F);
  }
  for (int frame = 0; frame < 5; ++frame) {
    scan.stamp = 0.1 * frame;
    map.insert(scan);
    for (const Eigen::Vector3f& p : scan.hits) {
      EXPECT_EQ(map.state(p.cast<double>()), VoxelState::kOccupied) << "frame " << frame;
    }
    EXPECT_GT(map.counts().skipped, 0U);
  }
}

// What ~save_memory writes can be read again: every second voxel of a cube, which no leaf joins.
TEST(HostileMemory, WhatIsWrittenIsRead) {
  const test::TempDir folder;
  const std::string path = folder.file("map.bt");
  const MemoryConfig config;
  MemoryMap map(config);
  std::vector<Eigen::Vector4f> spheres;
  constexpr int kAcross = 170;
  for (int i = 0; i < kAcross * kAcross * kAcross; ++i) {
    const Eigen::Vector3i voxel(i % kAcross, i / kAcross % kAcross, i / kAcross / kAcross);
    if ((voxel.sum() & 1) == 0) continue;
    const Eigen::Vector3f p = (voxel.cast<float>().array() + 0.5F) * 0.02F;
    spheres.emplace_back(p.x(), p.y(), p.z(), 0.001F);
  }
  map.note_free(spheres, 1.0);
  ASSERT_EQ(map.counts().known, spheres.size());
  ASSERT_LT(map.counts().nodes, config.max_nodes);
  ASSERT_EQ(map.write_file(path), "");
  MemoryMap again(config);
  ASSERT_EQ(again.read_file(path, 2.0), "");
  EXPECT_EQ(again.counts().known, spheres.size());
}

// Far from the origin of the map's frame.
TEST(HostileMemory, WhatIsWrittenFarFromTheOriginIsRead) {
  const test::TempDir folder;
  const std::string path = folder.file("map.bt");
  MemoryConfig config;
  config.resolution = 1.0;
  MemoryMap map(config);
  map.insert(ray({20000.5F, 0.5F, 0.5F}, {20003.5F, 0.5F, 0.5F}, 1.0));
  ASSERT_EQ(map.state({20003.5, 0.5, 0.5}), VoxelState::kOccupied);
  ASSERT_EQ(map.write_file(path), "");
  MemoryMap again(config);
  ASSERT_EQ(again.read_file(path, 2.0), "");
  EXPECT_EQ(again.state({20003.5, 0.5, 0.5}), VoxelState::kOccupied);
}

}  // namespace
}  // namespace ist
