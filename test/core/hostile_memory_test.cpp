// The memory under attack: what it is given is out of keys, out of time, out of memory, or crafted.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "internal/cloud/memory_body.h"
#include "internal/cloud/memory_scan.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/seen_space.h"
#include "support/demo_arm.h"
#include "support/images.h"
#include "support/sanitizers.h"
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

// What is hidden stays for all of the decay, also when the memory is older than that.
TEST(HostileMemory, NothingIsForgottenBeforeTheDecay) {
  MemoryConfig config;
  config.decay = 2.0;
  MemoryMap map(config);
  map.insert(ray({0, 0, 0}, {0, 1, 0}, 100.0));
  for (int i = 0; i < 50; ++i) {
    const double stamp = 110.0 + 3.0 * i;
    map.insert(ray({0, 0, 0}, {1, 0, 0}, stamp));
    for (const double later : {0.5, 1.0, 1.5, 1.98}) {
      map.insert(ray({0, 0, 0}, {0, 1, 0}, stamp + later));
      ASSERT_EQ(map.state({1, 0, 0}), VoxelState::kOccupied) << later;
    }
    map.forget(stamp + 2.02);
    ASSERT_EQ(map.state({1, 0, 0}), VoxelState::kUnknown);
  }
}

// Old free space fills the memory. An obstacle that is seen once, and hidden from then on, is there
// all the same; other obstacles stay.
TEST(HostileMemory, AnObstacleTakesThePlaceOfOldFreeSpaceAtOnce) {
  MemoryConfig config;
  config.max_nodes = 512 * 40;
  MemoryMap map(config);
  // The second cloud adds nothing, so that no place is made for the next one.
  for (int i = 0; i < 2; ++i) map.insert(ray({0.0F, 0.0F, 0.01F}, {0.3F, 0.01F, 0.01F}, 0.0));
  std::vector<Eigen::Vector4f> spheres;  // one voxel each, in blocks of their own
  for (int i = 0; i < 64; ++i) {
    spheres.emplace_back(0.09F + 0.16F * static_cast<float>(i % 8),
                         2.09F + 0.16F * static_cast<float>(i / 8), 0.01F, 0.015F);
  }
  map.note_free(spheres, 0.0);
  ASSERT_EQ(map.counts().nodes, config.max_nodes);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3f p(0.3F, 0.01F, 3.01F + 0.16F * static_cast<float>(i % 12));
    map.insert(ray({0.2F, 0.01F, p.z()}, p, 0.01 * i));
    ASSERT_EQ(map.state(p.cast<double>()), VoxelState::kOccupied) << "cloud " << i;
    ASSERT_EQ(map.state({0.3, 0.01, 0.01}), VoxelState::kOccupied) << "cloud " << i;
  }
  EXPECT_GT(map.counts().forgotten, 0U);
  EXPECT_LE(map.counts().nodes, config.max_nodes);
}

// More obstacles in one cloud than there is memory for: as many as fit are remembered, and what
// the same cloud has hit is not forgotten for the rest of it.
TEST(HostileMemory, ACloudOfMoreObstaclesThanFitsFillsTheMemoryWithObstacles) {
  MemoryConfig config;
  config.max_nodes = 512 * 16;
  MemoryMap map(config);
  MemoryScan scan;
  for (int i = 0; i < 100; ++i) {
    scan.hits.emplace_back(1.0F, 0.05F + 0.16F * static_cast<float>(i % 10),
                           0.05F + 0.16F * static_cast<float>(i / 10));
  }
  for (int frame = 0; frame < 4; ++frame) {
    scan.stamp = frame;
    map.insert(scan);
    EXPECT_EQ(map.counts().occupied, 16U) << frame;
    EXPECT_GE(map.counts().skipped, 84U) << frame;
    if (frame > 0) continue;
    for (const Eigen::Vector3f& p : scan.hits) {  // each is hit once
      if (map.state(p.cast<double>()) == VoxelState::kUnknown) continue;
      EXPECT_NEAR(map.log_odds(p.cast<double>()), std::log(0.7 / 0.3), 1e-5);
    }
  }
}

// Rays that need more memory than there is take that of free space alone.
TEST(HostileMemory, FreeSpaceNeverTakesThePlaceOfObstacles) {
  MemoryConfig config;
  config.max_nodes = 512 * 16;
  MemoryMap map(config);
  MemoryScan scan;
  for (int i = 0; i < 12; ++i) {  // each in a block of its own, at the sensor
    scan.origin = {0.05F + 0.32F * static_cast<float>(i % 4),
                   5.05F + 0.32F * static_cast<float>(i / 4), 0.05F};
    scan.hits = {scan.origin + Eigen::Vector3f(0.03F, 0.0F, 0.0F)};
    map.insert(scan);
  }
  ASSERT_EQ(map.counts().occupied, 12U);
  for (int frame = 0; frame < 30; ++frame) {
    scan.stamp = 0.1 * frame;
    scan.origin = Eigen::Vector3f::Zero();
    const float angle = 0.1F * static_cast<float>(frame);
    scan.hits.clear();
    scan.free_ends = {{4.0F * std::cos(angle), -4.0F * std::sin(angle), -1.0F}};
    map.insert(scan);
    ASSERT_EQ(map.counts().occupied, 12U) << frame;
    EXPECT_GT(map.counts().skipped, 0U);
  }
}

// Each voxel of a ray but its last is free, and none behind it is known: the whole line is looked
// at, 1000 random rays each.
TEST(HostileMemory, RaysClearUpToTheirEndsAndNoFarther) {
  test::Rng rng(12);
  const std::vector<Eigen::Vector3f> none;
  for (const bool is_robot : {false, true}) {
    for (int i = 0; i < 1000; ++i) {
      MemoryMap map{{}};
      const Eigen::Vector3d origin = test::random_vector(&rng, 1.0);
      const Eigen::Vector3d end = origin + test::random_vector(&rng, 2.0);
      MemoryScan scan;
      scan.origin = origin.cast<float>();
      auto& ends = is_robot ? scan.free_ends : scan.hits;
      ends.assign(1, end.cast<float>());
      map.insert(scan);
      const double length = (end - origin).norm();
      const Eigen::Vector3d along = (end - origin) / length;
      for (double t = 0.05; t < 0.5; t += 0.01) {
        EXPECT_NE(map.state(end + t * along), VoxelState::kFree) << i << ", " << t;
      }
      EXPECT_EQ(map.counts().occupied, is_robot ? 0U : 1U);
      EXPECT_EQ(map.state(end), is_robot ? VoxelState::kUnknown : VoxelState::kOccupied);
    }
  }
}

// An obstacle that is hidden three voxels behind a surface is no noise of the surface.
TEST(HostileMemory, WhatIsHiddenCloseBehindASurfaceStays) {
  MemoryMap map{{}};
  MemoryScan scan;
  for (int i = -5; i <= 5; ++i) {
    for (int k = -5; k <= 5; ++k) scan.hits.emplace_back(1.01F, 0.02F * i, 0.02F * k);
  }
  map.insert(scan);
  for (Eigen::Vector3f& p : scan.hits) p *= 0.95F / 1.01F;
  scan.stamp = 0.1;
  map.insert(scan);
  VoxelBoxes boxes;
  map.hidden_boxes(&boxes);
  EXPECT_TRUE(holds(boxes, {1.01, 0.01, 0.01}));
}

// The robot's body is known where it is, and nowhere else.
TEST(HostileMemory, ABodyIsFreeWithinItsSpheresAlone) {
  test::Rng rng(13);
  MemoryMap map{{}};
  const std::vector<Eigen::Vector4f> spheres = {{0.1F, 0.2F, 0.3F, 0.1F},
                                                {0.3F, 0.2F, 0.3F, 0.06F}};
  map.note_free(spheres, 1.0);
  int known = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d p = Eigen::Vector3d(0.2, 0.2, 0.3) + test::random_vector(&rng, 0.15);
    double outside = kInfinity;
    for (const Eigen::Vector4f& sphere : spheres) {
      outside = std::min(
          outside, (p - sphere.head<3>().cast<double>()).norm() - static_cast<double>(sphere.w()));
    }
    const bool is_known = map.state(p) != VoxelState::kUnknown;
    known += is_known ? 1 : 0;
    if (outside > 0.0174) ASSERT_FALSE(is_known) << p.transpose();
    if (outside < -0.0174) ASSERT_TRUE(is_known) << p.transpose();
  }
  EXPECT_GT(known, 500);
}

// [m] From the nearest of the links, negative inside.
double distance_to(const std::vector<PosedSolid>& robot, const Eigen::Vector3d& p_F) {
  double least = kInfinity;
  for (const PosedSolid& link : robot) {
    least = std::min(least, link.solid->signed_distance(link.X_FL.inverse() * p_F).distance);
  }
  return least;
}

// The robot's own space is that of its exact solids and a skin, as promised. The cover spheres of
// this arm reach 34 mm out of it, and coarse ones 50 mm, to where nothing has been seen.
TEST(HostileMemory, TheBodyIsNoLargerThanTheRobotAndItsSkin) {
  constexpr double kSkin = 0.0374;
  const double half_voxel = 0.0174;  // [m] of its diagonal
  for (const double max_error : {0.005, 0.05}) {
    RobotModelConfig config;
    config.packing.max_error = max_error;
    const auto model = build_robot_model(test::demo_robot(), config);
    test::Rng rng(15);
    const Eigen::Isometry3d X_MF = test::random_pose(&rng, 1.0);
    std::vector<PosedSolid> robot;
    for (const LinkModel& link : model->links) {
      if (!link.usable() || link.tree.empty()) continue;
      robot.push_back({&link.tree, &link.solid, test::random_pose(&rng, 0.4)});
    }
    ASSERT_GT(robot.size(), 5U);
    MemoryMap body{{}};
    const Eigen::AlignedBox3d box = note_body(robot, X_MF, kSkin, 1.0, &body);
    int known = 0, inside = 0;
    for (int i = 0; i < test::scaled(60000); ++i) {
      const Eigen::Vector3d p_F = test::random_vector(&rng, 0.9);
      const double distance = distance_to(robot, p_F);
      const Eigen::Vector3d p_M = X_MF * p_F;
      const bool is_known = body.state(p_M) == VoxelState::kFree;
      known += is_known ? 1 : 0;
      inside += distance < 0.0 ? 1 : 0;
      if (distance > kSkin + half_voxel) ASSERT_FALSE(is_known) << distance;
      if (distance < kSkin - half_voxel) ASSERT_TRUE(is_known) << distance;
      if (distance < kSkin) ASSERT_TRUE(box.contains(p_M)) << distance;
    }
    EXPECT_GT(known, inside);
    EXPECT_GT(inside, test::kSanitized ? 3 : 100);
  }
}

// A pixel says nothing where it is NaN, negative or zero, and the other ones are not misread.
TEST(HostileMemory, DepthsThatSayNothingClearNothing) {
  CameraModel camera;
  camera.width = 4;
  camera.height = 1;
  camera.P = {100, 0, 1.5, 0, 0, 100, 0, 0, 0, 0, 1, 0};
  const std::vector<float> depths = {static_cast<float>(kNaN), -1.0F, 0.0F,
                                     static_cast<float>(-kInfinity)};
  const RawCloud raw = test::depth_cloud(test::rays_of(camera), depths);
  Ingest ingest({});
  CloudSnapshot snapshot;
  ingest.run(raw, Eigen::Isometry3d::Identity(), {}, 5.0, &snapshot);
  MemoryScan scan;
  read_memory_scan(raw, snapshot, snapshot.X_FS, 0.05, 3.0, &scan);
  EXPECT_TRUE(scan.hits.empty());
  EXPECT_TRUE(scan.free_ends.empty());
  // The same as a cloud, with infinite coordinates: their direction is not known.
  const auto inf = static_cast<float>(kInfinity), nan = static_cast<float>(kNaN);
  const float points[] = {nan, nan, nan, inf, 0, 0, -inf, inf, nan, 0, 0, 0};
  ingest.run(packed_cloud(points, 4, 1), Eigen::Isometry3d::Identity(), {}, 5.0, &snapshot);
  read_memory_scan(packed_cloud(points, 4, 1), snapshot, snapshot.X_FS, 0.05, 3.0, &scan);
  EXPECT_TRUE(scan.hits.empty());
  EXPECT_TRUE(scan.free_ends.empty());
}

// Two ends on both sides of a voxel's border, so close that the square of their distance is zero in
// float: the ray has no direction, and its walk never ended.
TEST(HostileMemory, ARayThatHasNoLengthInFloatEnds) {
  MemoryConfig config;
  config.discretize = false;
  MemoryMap map(config);
  map.insert(ray({-1e-30F, 0.01F, 0.01F}, {1e-30F, 0.01F, 0.01F}, 0.0));
  EXPECT_EQ(map.state({1e-30, 0.01, 0.01}), VoxelState::kOccupied);
  EXPECT_LE(map.counts().known, 2U);
}

// An obstacle that a file remembers is an obstacle.
TEST(HostileMemory, ObstaclesOfAFileAreHidden) {
  const test::TempDir folder;
  const std::string path = folder.file("map.bt");
  MemoryMap map{{}}, again{{}};
  map.insert(ray({0, 0, 0}, {1.01F, 0.01F, 0.01F}, 0.0));
  ASSERT_EQ(map.write_file(path), "");
  ASSERT_EQ(again.read_file(path, 3.0), "");
  VoxelBoxes boxes;
  again.hidden_boxes(&boxes);
  EXPECT_TRUE(holds(boxes, {1.01, 0.01, 0.01}));
  EXPECT_EQ(again.state({0.5, 0.005, 0.005}), VoxelState::kFree);
}

// Files that nobody should give: each is refused in one sentence, or read as what it says, and the
// memory stays as it was where there is a fault.
TEST(HostileMemory, FilesThatAreCutOffOrChanged) {
  const test::TempDir folder;
  const std::string path = folder.file("map.bt");
  MemoryMap map{{}};
  test::Rng rng(14);
  MemoryScan scan;
  for (int i = 0; i < 300; ++i) {
    scan.hits.push_back(test::random_vector(&rng, 0.5).cast<float>());
  }
  map.insert(scan);
  ASSERT_EQ(map.write_file(path), "");
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  MemoryMap other{{}};
  other.insert(ray({0, 0, 0}, {2.01F, 0.01F, 0.01F}, 0.0));
  const auto read = [&](const std::string& text) {
    MemoryMap reader{{}};
    reader.insert(ray({0, 0, 0}, {2.01F, 0.01F, 0.01F}, 0.0));
    const std::string fault = reader.read_file(folder.write("other.bt", text), 0.5);
    const bool is_kept = reader.state({2.01, 0.01, 0.01}) == VoxelState::kOccupied;
    if (!fault.empty()) EXPECT_TRUE(is_kept) << fault;
    return fault;
  };
  ASSERT_EQ(read(bytes), "");
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 50) {
    EXPECT_NE(read(bytes.substr(0, size)), "") << "cut off after " << size << " bytes";
  }
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string changed = bytes;
    for (int k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(test::uniform(&rng, 0.0, 0.999) * bytes.size());
      changed[at] = static_cast<char>(test::uniform(&rng, 0.0, 255.9));
    }
    refused += read(changed).empty() ? 0 : 1;
  }
  EXPECT_GT(refused, 200);
  const std::string data = bytes.substr(bytes.find("data\n") + 5);
  for (const char* resolution : {"-0.02", "0", "nan", "inf", "1e-9", "1e9", "0.020001", "x", ""}) {
    EXPECT_NE(read("# Octomap OcTree binary file\nid OcTree\nsize 2\nres " +
                   std::string(resolution) + "\ndata\n" + data),
              "")
        << resolution;
  }
  // Inner nodes in inner nodes, deeper than the tree is.
  EXPECT_NE(read("# Octomap OcTree binary file\nid OcTree\nsize 100\nres 0.02\ndata\n" +
                 std::string(1000, '\x03')),
            "");
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
