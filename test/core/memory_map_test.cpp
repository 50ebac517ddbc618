// The memory: what stays, what is forgotten, what the last cloud answers for, and faults.

#include "ist_proximity/cloud/memory_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "internal/cloud/memory_scan.h"
#include "ist_proximity/cloud/seen_space.h"
#include "support/errors.h"
#include "support/images.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A sensor at the origin that looks along x at a square of 0.4 m, at some distance.
MemoryScan wall(float distance, double stamp) {
  MemoryScan scan;
  scan.stamp = stamp;
  for (int i = -40; i <= 40; ++i) {
    for (int k = -40; k <= 40; ++k) {
      scan.hits.emplace_back(distance, 0.005F * static_cast<float>(i),
                             0.005F * static_cast<float>(k));
    }
  }
  return scan;
}

bool holds(const VoxelBoxes& boxes, const Eigen::Vector3d& p) {
  return std::any_of(boxes.begin(), boxes.end(),
                     [&](const Eigen::AlignedBox3d& box) { return box.contains(p); });
}

bool hides(const MemoryMap& map, const Eigen::Vector3d& p) {
  VoxelBoxes boxes;
  map.hidden_boxes(&boxes);
  return holds(boxes, p);
}

double volume(const VoxelBoxes& boxes) {
  double sum = 0.0;
  for (const Eigen::AlignedBox3d& box : boxes) sum += box.volume();
  return sum;
}

TEST(MemoryMap, HiddenBehindSomethingNearerStays) {
  MemoryMap map{{}};
  VoxelBoxes boxes;
  map.insert(wall(1.0F, 0.0));
  map.hidden_boxes(&boxes);
  EXPECT_TRUE(boxes.empty()) << "the cloud answers for what it hits";
  map.insert(wall(0.5F, 0.1));  // hides the far one
  EXPECT_TRUE(hides(map, {1.01, 0.1, 0.1}));
  EXPECT_FALSE(hides(map, {0.51, 0.05, 0.05})) << "the near one is in the cloud";
  map.occupied_boxes(&boxes);
  EXPECT_TRUE(holds(boxes, {0.51, 0.05, 0.05}));
}

// A board hides half of a wall. The cloud answers for the half that it shows, and the memory for
// the other one, also where both lie in one block of voxels.
TEST(MemoryMap, WhatABoardHidesBesideWhatIsSeenStays) {
  MemoryMap map{{}};
  map.insert(wall(1.0F, 0.0));
  MemoryScan scan;
  scan.stamp = 0.1;
  for (const Eigen::Vector3f& p : wall(1.0F, 0.0).hits) {
    scan.hits.push_back(p.y() < 0.05F ? p : Eigen::Vector3f(0.5F * p));
  }
  map.insert(scan);
  for (double y = 0.09; y < 0.18; y += 0.02) EXPECT_TRUE(hides(map, {1.01, y, 0.1})) << y;
  for (double y = -0.15; y < 0.02; y += 0.02) EXPECT_FALSE(hides(map, {1.01, y, 0.1})) << y;
}

TEST(MemoryMap, WhatIsSeenThroughIsAnsweredByTheCloudAtOnceAndClearedSoon) {
  MemoryMap map{{}};
  for (int i = 0; i < 30; ++i) map.insert(wall(0.5F, i / 30.0));  // as occupied as can be
  double cleared = kInfinity;
  for (int i = 30; i < 60; ++i) {
    map.insert(wall(1.0F, i / 30.0));
    EXPECT_FALSE(hides(map, {0.51, 0.05, 0.05})) << "frame " << i;
    if (map.state({0.51, 0.05, 0.05}) == VoxelState::kFree) cleared = std::min(cleared, i / 30.0);
  }
  EXPECT_LE(cleared - 29.0 / 30.0, 0.5) << "a swept region is cleared within half a second";
}

TEST(MemoryMap, LeftTheViewStaysUntilTheDecay) {
  MemoryConfig config;
  config.decay = 2.0;
  MemoryMap map(config);
  map.insert(wall(1.0F, 0.0));
  MemoryScan elsewhere = wall(1.0F, 1.9);
  for (Eigen::Vector3f& p : elsewhere.hits) p.x() = -p.x();
  map.insert(elsewhere);
  EXPECT_TRUE(hides(map, {1.01, 0.1, 0.1}));
  map.forget(2.1);
  EXPECT_FALSE(hides(map, {1.01, 0.1, 0.1}));
  EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kUnknown);
  EXPECT_EQ(map.state({0.5, 0.0, 0.0}), VoxelState::kUnknown) << "free space is forgotten, too";
  EXPECT_EQ(map.state({-0.99, 0.1, 0.1}), VoxelState::kOccupied);
  map.forget(1e6);
  EXPECT_EQ(map.counts().nodes, 0U) << "memory comes back";
}

// What is seen is as old as its stamp, and what comes late makes nothing else older.
TEST(MemoryMap, WhatComesLateIsAsOldAsItsStamp) {
  MemoryConfig config;
  config.decay = 2.0;
  MemoryMap map(config);
  map.insert(wall(1.0F, 0.0));
  map.insert(wall(1.0F, 10.0));
  map.insert(wall(1.0F, 9.0));
  const auto time_seen = [&map](double x) {
    SeenSpace seen;
    seen.add(map);
    return seen.time_seen({x, 0.0, 0.0});
  };
  EXPECT_NEAR(time_seen(0.5), 10.0, 0.011);
  MemoryScan late = wall(1.0F, 9.5);
  for (Eigen::Vector3f& p : late.hits) p.x() = -p.x();
  map.insert(late);
  EXPECT_NEAR(time_seen(-0.5), 9.5, 0.011);
  EXPECT_NEAR(time_seen(0.5), 10.0, 0.011);
  map.note_free({{-0.3F, 0.5F, 0.0F, 0.1F}}, 9.2);
  SeenSpace seen;
  seen.add(map);
  EXPECT_NEAR(seen.time_seen({-0.3, 0.5, 0.0}), 9.2, 0.011);
  map.forget(11.8);
  EXPECT_TRUE(std::isnan(time_seen(-0.5)));
  EXPECT_NEAR(time_seen(0.5), 10.0, 0.011);
}

TEST(MemoryMap, MissesThatLeaveAVoxelOccupiedDoNotProlongItsLife) {
  MemoryConfig config;
  config.decay = 1.0;
  MemoryMap map(config);
  for (int i = 0; i < 20; ++i) map.insert(wall(0.5F, 0.0));
  map.insert(wall(1.0F, 0.9));  // one miss of nine that would free it
  ASSERT_EQ(map.state({0.51, 0.05, 0.05}), VoxelState::kOccupied);
  map.forget(1.5);
  EXPECT_EQ(map.state({0.51, 0.05, 0.05}), VoxelState::kUnknown);
}

// Points on the robot are free ends: nothing is written there, and nothing behind is cleared.
TEST(MemoryMap, TheRobotIsNeverWrittenAndItsShadowNeverCleared) {
  MemoryMap map{{}};
  map.insert(wall(1.0F, 0.0));
  MemoryScan robot = wall(0.5F, 0.1);
  std::swap(robot.hits, robot.free_ends);
  for (int i = 0; i < 50; ++i) map.insert(robot);
  EXPECT_EQ(map.state({0.51, 0.05, 0.05}), VoxelState::kFree) << "of the first cloud's rays";
  EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kOccupied);
  EXPECT_TRUE(hides(map, {1.01, 0.1, 0.1}));
  EXPECT_FALSE(hides(map, {0.51, 0.05, 0.05}));

  MemoryMap fresh{{}};
  fresh.insert(robot);
  EXPECT_EQ(fresh.state({0.25, 0.0, 0.0}), VoxelState::kFree) << "in front of the robot";
  EXPECT_EQ(fresh.state({0.51, 0.05, 0.05}), VoxelState::kUnknown);
  EXPECT_EQ(fresh.state({0.8, 0.0, 0.0}), VoxelState::kUnknown);
  EXPECT_EQ(fresh.counts().occupied, 0U);
}

// A voxel just behind a point of the last cloud would double its surface as a box.
TEST(MemoryMap, NoiseBehindASurfaceThatIsInViewIsNoBox) {
  MemoryMap map{{}};
  map.insert(wall(1.025F, 0.0));
  map.insert(wall(1.015F, 0.1));  // the voxel in front
  VoxelBoxes boxes;
  map.hidden_boxes(&boxes);
  EXPECT_LT(volume(boxes), 0.1 * 0.4 * 0.4 * 0.02);
}

TEST(MemoryMap, BoxesAreExactlyTheOccupiedVoxels) {
  test::Rng rng(3);
  std::uniform_real_distribution<float> place(-0.3F, 0.3F);
  MemoryMap map{{}};
  MemoryScan scan;
  scan.origin = {2.0F, 0.0F, 0.0F};
  for (int i = 0; i < 5000; ++i) scan.hits.emplace_back(place(rng), place(rng), place(rng));
  map.insert(scan);
  VoxelBoxes boxes;
  map.occupied_boxes(&boxes);
  const double voxel = std::pow(0.02, 3);
  const std::size_t occupied = map.counts().occupied;
  EXPECT_NEAR(volume(boxes), static_cast<double>(occupied) * voxel, 1e-9);
  EXPECT_LT(boxes.size(), occupied) << "merged";
  for (const Eigen::AlignedBox3d& box : boxes) {
    EXPECT_EQ(map.state(box.center() + Eigen::Vector3d::Constant(1e-4)), VoxelState::kOccupied);
  }
}

TEST(MemoryMap, MemoryIsBoundedAndWhatIsOldGoesFirst) {
  MemoryConfig config;
  config.max_nodes = 512 * 200;
  MemoryMap map(config);
  std::size_t most = 0;
  for (int i = 0; i < 200; ++i) {  // a sensor that moves along
    MemoryScan scan = wall(1.0F, 0.01 * i);
    scan.origin.y() += 0.1F * static_cast<float>(i);
    for (Eigen::Vector3f& p : scan.hits) p.y() += 0.1F * static_cast<float>(i);
    map.insert(scan);
    most = std::max(most, map.counts().nodes);
  }
  EXPECT_LE(most, config.max_nodes);
  EXPECT_GT(map.counts().forgotten, 0U);
  EXPECT_EQ(map.state({1.01, 0.0, 0.0}), VoxelState::kUnknown);
  EXPECT_EQ(map.state({1.01, 19.9, 0.0}), VoxelState::kOccupied);
}

TEST(MemoryMap, NothingOutsideTheRegion) {
  MemoryMap map{{}};
  RegionOfInterest region;
  region.center_F = {1.0, 0.0, 0.0};
  region.radius = 0.2;
  map.set_region(region);
  map.insert(wall(1.0F, 0.0));
  map.insert(wall(2.0F, 0.1));
  EXPECT_EQ(map.state({0.5, 0.0, 0.0}), VoxelState::kUnknown);
  EXPECT_EQ(map.state({0.9, 0.0, 0.0}), VoxelState::kFree);
  EXPECT_EQ(map.state({1.01, 0.0, 0.0}), VoxelState::kOccupied);
  EXPECT_EQ(map.state({2.01, 0.0, 0.0}), VoxelState::kUnknown);
}

TEST(MemoryMap, StampsThatGoBackAreTheLastOne) {
  MemoryMap map{{}};
  map.insert(wall(1.0F, 100.0));
  map.insert(wall(1.0F, 50.0));
  EXPECT_EQ(map.now(), 100.0);
  map.forget(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kOccupied);
  map.clear();
  map.insert(wall(1.0F, 50.0));
  EXPECT_EQ(map.now(), 50.0) << "a new start";
}

// A clock that is set back makes nothing older or younger, and takes nothing away.
TEST(MemoryMap, AClockThatIsSetBackLosesNothing) {
  MemoryConfig config;
  config.decay = 10.0;
  MemoryMap map{config};
  map.insert(wall(1.0F, 100.0));
  map.insert(wall(1.0F, 101.0));
  map.shift_times(-60.0);
  EXPECT_EQ(map.now(), 41.0);
  const std::size_t known = map.counts().known;
  map.forget(50.5);
  EXPECT_EQ(map.counts().known, known);
  EXPECT_TRUE(map.has_obstacles());
  map.forget(51.5);
  EXPECT_EQ(map.counts().known, 0U);
  EXPECT_FALSE(map.has_obstacles());
}

// Times are counted in ticks that last for a year; a clock that begins late, or jumps, needs more.
TEST(MemoryMap, AClockThatIsSetForwardByYearsForgetsByTheDecayAlone) {
  MemoryConfig config;
  config.decay = kInfinity;
  MemoryMap lasting(config);
  lasting.insert(wall(1.0F, 1000.0));
  for (const double now : {1.7e9, 1.8e9, 9e15}) {
    lasting.forget(now);
    EXPECT_EQ(lasting.state({1.01, 0.1, 0.1}), VoxelState::kOccupied) << now;
    SeenSpace seen;
    seen.add(lasting);
    EXPECT_LE(seen.time_seen({1.01, 0.1, 0.1}), 1000.02) << "nothing gets newer";
  }
  lasting.insert(wall(0.5F, 9e15));
  EXPECT_TRUE(hides(lasting, {1.01, 0.1, 0.1}));

  for (const double decay :
       {1e7, 3e7}) {  // [s] shorter and longer than half of what ticks last for
    SCOPED_TRACE(decay);
    config.decay = decay;
    MemoryMap map(config);
    map.insert(wall(-1.0F, 0.0));
    ASSERT_EQ(map.state({-0.99, 0.1, 0.1}), VoxelState::kOccupied);
    map.insert(wall(1.0F, 4.1e7 - 0.9 * decay));
    map.forget(4.1e7);
    EXPECT_EQ(map.state({-0.99, 0.1, 0.1}), VoxelState::kUnknown);
    EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kOccupied);
    map.forget(4.1e7 + 0.1 * decay - 1.0);
    EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kOccupied);
    map.forget(4.1e7 + 0.1 * decay + 1.0);
    EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kUnknown);
  }
}

TEST(MemoryMap, FreeSpaceIsForgottenAlone) {
  MemoryMap map{{}};
  map.insert(wall(1.0F, 100.0));
  const std::size_t occupied = map.counts().occupied;
  map.clear_free();
  EXPECT_EQ(map.counts().known, occupied);
  EXPECT_EQ(map.state({1.01, 0.1, 0.1}), VoxelState::kOccupied);
  EXPECT_EQ(map.state({0.5, 0.0, 0.0}), VoxelState::kUnknown);
  VoxelBoxes boxes;
  map.occupied_boxes(&boxes);
  EXPECT_FALSE(boxes.empty());
  map.insert(wall(1.0F, 100.1));
  EXPECT_EQ(map.state({0.5, 0.0, 0.0}), VoxelState::kFree);
}

TEST(MemoryMap, CoordinatesThatNoKeyHolds) {
  MemoryMap map{{}};
  MemoryScan scan;
  scan.hits = {{1e30F, 0.0F, 0.0F}, {0.0F, -1e9F, 0.0F}, {1.0F, 0.0F, 0.0F}};
  map.insert(scan);
  EXPECT_EQ(map.counts().occupied, 1U);
  EXPECT_EQ(map.state({1e30, 0.0, 0.0}), VoxelState::kUnknown);
  scan.origin.x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(map.insert(scan), std::invalid_argument);
}

TEST(MemoryMap, WrongConfigurationsAreNamed) {
  const auto fault = [](auto change) {
    MemoryConfig config;
    change(&config);
    return test::argument_error([&] { const MemoryMap map(config); });
  };
  test::expect_says(fault([](auto* c) { c->resolution = 0.0; }), "resolution is 0");
  test::expect_says(fault([](auto* c) { c->decay = -1.0; }), "decay is -1");
  test::expect_says(fault([](auto* c) { c->decay = std::nan(""); }), "decay");
  test::expect_says(fault([](auto* c) { c->max_nodes = 0; }), "max_nodes is 0");
  test::expect_says(fault([](auto* c) { c->max_range = kInfinity; }), "max_range");
  EXPECT_EQ(fault([](auto* c) { c->decay = kInfinity; }), "(no error)");
}

TEST(MemoryFile, FaultsAreNamedAndNothingIsLost) {
  const test::TempDir folder;
  MemoryMap map{{}};
  map.insert(wall(1.0F, 0.0));
  const std::string path = folder.file("memory.bt");
  ASSERT_EQ(map.write_file(path), "");
  const std::size_t known = map.counts().known;

  // Another resolution.
  MemoryConfig coarse;
  coarse.resolution = 0.05;
  MemoryMap other(coarse);
  test::expect_says(other.read_file(path, 0.0), "resolution of 0.02 m, the memory's is 0.05");
  // Cut off.
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 3);
  EXPECT_NE(map.read_file(path, 0.0).find("ends in the middle"), std::string::npos);
  EXPECT_EQ(map.counts().known, known) << "what was remembered stays";
  // Not there, and where nothing can be written.
  EXPECT_NE(map.read_file(folder.file("none.bt"), 0.0), "");
  EXPECT_NE(map.write_file(folder.file("no/folder/memory.bt")), "");
  EXPECT_FALSE(std::filesystem::exists(folder.file("no")));
  // More voxels than allowed.
  ASSERT_EQ(map.write_file(path), "");
  MemoryConfig small;
  small.max_nodes = 4096;
  MemoryMap narrow(small);
  EXPECT_NE(narrow.read_file(path, 0.0).find("max_nodes"), std::string::npos);
  EXPECT_EQ(narrow.counts().known, 0U);
}

// One leaf of 655 m: more voxels than any memory has, told without counting them one by one.
TEST(MemoryFile, AHugeLeafIsRefused) {
  const test::TempDir folder;
  const std::string header = "# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.02\ndata\n";
  const std::string path = folder.write("huge.bt", header + std::string("\x01\x00", 2));
  MemoryMap map{{}};
  EXPECT_NE(map.read_file(path, 0.0).find("max_nodes"), std::string::npos);
}

TEST(SeenSpace, JoinsWhatMemoriesKnow) {
  MemoryMap map{{}}, body{{}};
  map.insert(wall(1.0F, 3.0));
  SeenSpace seen;
  VoxelBoxes boxes;
  EXPECT_TRUE(seen.unknown_boxes({0.5, 0, 0}, 1.0, 1000000, &boxes));
  EXPECT_TRUE(boxes.empty());
  const std::vector<Eigen::Vector4f> spheres = {{0.5F, 0.5F, 0.0F, 0.1F}};
  body.note_free(spheres, 4.0);
  seen.add(map);
  seen.add(body);
  EXPECT_NEAR(seen.time_seen({0.7, 0.0, 0.0}), 3.0, 0.011);
  EXPECT_NEAR(seen.time_seen({0.5, 0.55, 0.0}), 4.0, 0.011);
  EXPECT_TRUE(std::isnan(seen.time_seen({0.5, 0.65, 0.0})));
  ASSERT_TRUE(seen.unknown_boxes({0.5, 0, 0}, 1.0, 1000000, &boxes));
  // Each point in the sphere is either seen or in a box.
  test::Rng rng(5);
  int unknown = 0;
  for (int i = 0; i < 2000; ++i) {
    Eigen::Vector3d p = Eigen::Vector3d(0.5, 0, 0) + test::random_vector(&rng, 0.5);
    const bool is_unknown = std::isnan(seen.time_seen(p));
    EXPECT_EQ(holds(boxes, p), is_unknown) << p.transpose();
    unknown += is_unknown ? 1 : 0;
  }
  EXPECT_GT(unknown, 200);
  EXPECT_LT(unknown, 1990);
  EXPECT_FALSE(seen.unknown_boxes({0.5, 0, 0}, 1.0, 10, &boxes));
  EXPECT_EQ(boxes.size(), 10U);
  MemoryConfig coarse;
  coarse.resolution = 0.05;
  EXPECT_THROW(seen.add(MemoryMap(coarse)), std::invalid_argument);
}

// A depth image of 4 x 1 pixels: an obstacle, nothing known, nothing in range, something too far.
TEST(MemoryScan, OfADepthImage) {
  CameraModel camera;
  camera.width = 4;
  camera.height = 1;
  camera.P = {100, 0, 1.5, 0, 0, 100, 0, 0, 0, 0, 1, 0};
  const std::vector<float> depths = {1.0F, std::nanf(""), static_cast<float>(kInfinity), 8.0F};
  const RawCloud raw = test::depth_cloud(test::rays_of(camera), depths);
  Ingest ingest({});
  CloudSnapshot snapshot;
  const Eigen::Isometry3d X_FS = test::at(0.0, 1.0, 0.0);
  ingest.run(raw, X_FS, {}, 5.0, &snapshot);
  MemoryScan scan;
  read_memory_scan(raw, snapshot, X_FS, 0.05, 3.0, &scan);
  EXPECT_EQ(scan.stamp, 5.0);
  EXPECT_EQ(scan.origin, Eigen::Vector3f(0, 1, 0));
  ASSERT_EQ(scan.hits.size(), 1U);
  EXPECT_LT((scan.hits[0] - Eigen::Vector3f(-0.015F, 1, 1)).norm(), 1e-6F);
  ASSERT_EQ(scan.free_ends.size(), 2U);
  for (const Eigen::Vector3f& p : scan.free_ends) {
    EXPECT_NEAR((p - scan.origin).norm(), 3.0F, 1e-4F);
    EXPECT_LE((p - scan.origin).norm(), 3.0F);
  }
}

}  // namespace
}  // namespace ist
