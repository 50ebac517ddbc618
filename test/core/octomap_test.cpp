// Maps of OctoMap as obstacles, and a memory as a map of OctoMap.
#include "ist_proximity/octomap.h"

#include <gtest/gtest.h>
#include <octomap/ColorOcTree.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <functional>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include "ist_proximity/facade/robot.h"
#include "support/errors.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

using Boxes = std::vector<Eigen::AlignedBox3d>;

template <class Tree>
Tree random_tree(double resolution, int points) {
  test::Rng rng(3);
  Tree tree(resolution);
  for (int i = 0; i < points; ++i) {
    const Eigen::Vector3d p = test::random_vector(&rng, 1.0);
    tree.updateNode(octomap::point3d(static_cast<float>(p.x()), static_cast<float>(p.y()),
                                     static_cast<float>(p.z())),
                    i % 3 != 0);
  }
  // A block that is pruned to one leaf.
  for (int i = 0; i < 64; ++i) {
    const auto at = [&](int k) { return static_cast<float>((k + 0.5) * resolution); };
    tree.updateNode(octomap::point3d(at(i % 4), at(i / 4 % 4), at(i / 16)), true);
  }
  tree.updateInnerOccupancy();
  tree.prune();
  return tree;
}

Boxes sorted(Boxes boxes) {
  std::sort(boxes.begin(), boxes.end(), [](const auto& a, const auto& b) {
    return std::make_tuple(a.min().x(), a.min().y(), a.min().z()) <
           std::make_tuple(b.min().x(), b.min().y(), b.min().z());
  });
  return boxes;
}

void expect_equal(const Boxes& a, const Boxes& b) {
  ASSERT_EQ(a.size(), b.size());
  const Boxes left = sorted(a), right = sorted(b);
  for (std::size_t i = 0; i < left.size(); ++i) {
    EXPECT_EQ(left[i].min(), right[i].min());
    EXPECT_EQ(left[i].max(), right[i].max());
  }
}

double volume(const Boxes& boxes) {
  double sum = 0.0;
  for (const Eigen::AlignedBox3d& box : boxes) sum += box.volume();
  return sum;
}

double distance(const Obstacles& obstacles) {
  static const Robot ball(
      "<robot name='r'><link name='ball'><collision><origin xyz='1.5 0.2 0.1'/><geometry>"
      "<sphere radius='0.05'/></geometry></collision></link></robot>");
  QueryConfig exact;
  exact.tolerance = 0.0;
  return ball.nearest({}, obstacles, exact).nearest.distance;
}

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "(no error)";
}

// A tree, its message and its files are the same obstacles, to the bit.
TEST(Octomap, ATreeIsWhatItsMessageAndFilesAre) {
  auto tree = random_tree<octomap::OcTree>(0.05, 500);
  const Boxes boxes = occupied_boxes(tree);
  std::stringstream stream;
  ASSERT_TRUE(tree.writeData(stream));
  const std::string bytes = stream.str();
  OctreeData message;
  message.id = tree.getTreeType();
  message.resolution = tree.getResolution();
  message.data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  message.size = bytes.size();
  Octree read;
  ASSERT_EQ(read_octree(message, &read), "");
  expect_equal(read.occupied, boxes);
  EXPECT_GT(boxes.size(), 300U);
  EXPECT_EQ(distance(to_obstacles(tree)), distance(Obstacles::from_boxes(read.occupied)));

  const test::TempDir folder;
  ASSERT_TRUE(tree.write(folder.file("map.ot")));
  ASSERT_EQ(read_octree_file(folder.file("map.ot"), &read), "");
  expect_equal(read.occupied, boxes);
  ASSERT_TRUE(tree.writeBinary(folder.file("map.bt")));  // which makes leaves free or occupied
  ASSERT_EQ(read_octree_file(folder.file("map.bt"), &read), "");
  expect_equal(read.occupied, occupied_boxes(tree));
  EXPECT_NEAR(volume(read.occupied), volume(boxes), 1e-9);
  EXPECT_EQ(distance(to_obstacles(tree)), distance(Obstacles::from_boxes(read.occupied)));
}

TEST(Octomap, ATreeOfColoursIsRead) {
  const auto plain = random_tree<octomap::OcTree>(0.05, 400);
  const auto coloured = random_tree<octomap::ColorOcTree>(0.05, 400);
  expect_equal(occupied_boxes(coloured), occupied_boxes(plain));
  EXPECT_EQ(distance(to_obstacles(coloured)), distance(to_obstacles(plain)));
}

// Joined leaves hold those that they are joined of; a region leaves out what does not reach into
// it.
TEST(Octomap, DepthAndRegionAreChosen) {
  const auto tree = random_tree<octomap::OcTree>(0.05, 400);
  const Boxes fine = occupied_boxes(tree);
  OctomapSelection selection;
  selection.max_depth = 14;
  const Boxes coarse = occupied_boxes(tree, selection);
  EXPECT_LT(coarse.size(), fine.size());
  for (const Eigen::AlignedBox3d& box : fine) {
    EXPECT_TRUE(std::any_of(coarse.begin(), coarse.end(),
                            [&](const auto& joined) { return joined.contains(box); }));
  }
  EXPECT_LE(distance(to_obstacles(tree, Eigen::Isometry3d::Identity(), selection)),
            distance(to_obstacles(tree)));
  selection.max_depth = 0;
  selection.region =
      Eigen::AlignedBox3d(Eigen::Vector3d(-0.3, -0.3, -0.3), Eigen::Vector3d(0.3, 0.3, 0.3));
  Boxes expected;
  std::copy_if(fine.begin(), fine.end(), std::back_inserter(expected),
               [&](const auto& box) { return box.intersects(selection.region); });
  ASSERT_LT(expected.size(), fine.size());
  expect_equal(occupied_boxes(tree, selection), expected);
}

TEST(Octomap, AMapIsPlacedByItsPose) {
  octomap::OcTree tree(0.1);
  tree.updateNode(octomap::point3d(0.05F, 0.05F, 0.05F), true);
  Eigen::Isometry3d X_FM = Eigen::Isometry3d::Identity();
  X_FM.translation() << 1.8, 0.15, 0.05;  // its lower corner; the ball ends at x = 1.55
  EXPECT_NEAR(distance(to_obstacles(tree, X_FM)), 0.25, 1e-6);
  X_FM.linear() *= 2.0;
  test::expect_says(error_of([&] { to_obstacles(tree, X_FM); }), "X_FM");
}

TEST(Octomap, WhatCannotBeUsedIsSaid) {
  const octomap::OcTree empty(0.1);
  EXPECT_EQ(to_obstacles(empty).size(), 0U);
  EXPECT_EQ(distance(to_obstacles(empty)), std::numeric_limits<double>::infinity());
  const auto tree = random_tree<octomap::OcTree>(0.05, 400);
  OctomapSelection selection;
  selection.limits.max_leaves = 100;
  test::expect_says(error_of([&] { to_obstacles(tree, Eigen::Isometry3d::Identity(), selection); }),
                    "100 (max_leaves)");
  selection = {};
  selection.limits.max_position = 0.5;
  test::expect_says(error_of([&] { occupied_boxes(tree, selection); }), "(max_position)");
  selection = {};
  selection.max_depth = 17;
  test::expect_says(error_of([&] { occupied_boxes(tree, selection); }), "max_depth is 17");
  const Eigen::AlignedBox3d none;
  test::expect_says(error_of([&] { Obstacles::from_boxes({none}); }), "it is empty");
}

TEST(Octomap, AMemoryIsATree) {
  test::Rng rng(5);
  MemoryConfig config;
  config.resolution = 0.05;
  MemoryMap memory(config);
  EXPECT_EQ(to_octree(memory)->size(), 0U);
  MemoryScan scan;
  for (int i = 0; i < 200; ++i) scan.hits.push_back(test::random_vector(&rng, 1.0).cast<float>());
  memory.insert(scan);
  const std::unique_ptr<octomap::OcTree> tree = to_octree(memory);
  VoxelBoxes occupied;
  memory.occupied_boxes(&occupied);
  EXPECT_NEAR(volume(occupied_boxes(*tree)), volume(occupied), 1e-9);
  std::size_t known = 0;
  for (auto leaf = tree->begin_leafs(); leaf != tree->end_leafs(); ++leaf) {
    const octomap::point3d p = leaf.getCoordinate();
    known += std::size_t{1} << (3 * (16 - leaf.getDepth()));
    EXPECT_EQ(memory.state({p.x(), p.y(), p.z()}),
              tree->isNodeOccupied(*leaf) ? VoxelState::kOccupied : VoxelState::kFree);
  }
  EXPECT_EQ(known, memory.counts().known);
}

}  // namespace
}  // namespace ist
