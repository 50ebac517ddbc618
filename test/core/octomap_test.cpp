// Maps of OctoMap as obstacles. octree_test has those of messages and files, memory_octomap_test
// a memory as a map.
#include "ist_proximity/octomap.h"

#include <gtest/gtest.h>
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "ist_proximity/facade/robot.h"
#include "support/errors.h"
#include "support/scene.h"

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

void expect_equal(const Boxes& a, const Boxes& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].min(), b[i].min());
    EXPECT_EQ(a[i].max(), b[i].max());
  }
}

double distance(const Obstacles& obstacles) {
  static const Robot ball(
      "<robot name='r'><link name='ball'><collision><origin xyz='1.5 0.2 0.1'/><geometry>"
      "<sphere radius='0.05'/></geometry></collision></link></robot>");
  QueryConfig exact;
  exact.tolerance = 0.0;
  return ball.nearest({}, obstacles, exact).nearest.distance;
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

// Inner nodes said what they had said before leaves were updated lazily, and an occupied leaf was
// lost.
TEST(Octomap, AJoinedLeafIsOccupiedWhereALeafIs) {
  octomap::OcTree tree(0.05);
  tree.updateNode(octomap::point3d(0.2F, 0.0F, 0.0F), false);  // and the nodes above it are free
  tree.updateNode(octomap::point3d(0.3F, 0.0F, 0.0F), true, true);
  const Boxes fine = occupied_boxes(tree);
  ASSERT_EQ(fine.size(), 1U);
  for (unsigned depth = 1; depth <= 16; ++depth) {
    OctomapSelection selection;
    selection.max_depth = depth;
    const Boxes coarse = occupied_boxes(tree, selection);
    ASSERT_EQ(coarse.size(), 1U) << depth;
    EXPECT_TRUE(coarse[0].contains(fine[0])) << depth;
    EXPECT_NEAR(coarse[0].sizes().x(), 0.05 * (1 << (16 - depth)), 1e-9);
  }
}

// NaN is in no region and above no threshold: obstacles were left out.
TEST(Octomap, WhatIsNotANumberIsRefused) {
  auto tree = random_tree<octomap::OcTree>(0.05, 400);
  OctomapSelection selection;
  selection.region = Eigen::AlignedBox3d(Eigen::Vector3d(-1.0, -1.0, -1.0),
                                         Eigen::Vector3d(1.0, 1.0, std::nan("")));
  test::expect_says(test::argument_error([&] { occupied_boxes(tree, selection); }), "region");
  tree.begin_leafs()->setLogOdds(std::nanf(""));
  test::expect_says(test::argument_error([&] { to_obstacles(tree); }), "log-odds");
}

TEST(Octomap, AMapIsPlacedByItsPose) {
  octomap::OcTree tree(0.1);
  tree.updateNode(octomap::point3d(0.05F, 0.05F, 0.05F), true);
  tree.updateNode(octomap::point3d(-0.05F, 0.05F, 0.05F), false);  // free, and nearer
  Eigen::Isometry3d X_FM = Eigen::Isometry3d::Identity();
  X_FM.translation() << 1.8, 0.15, 0.05;  // its lower corner; the ball ends at x = 1.55
  EXPECT_NEAR(distance(to_obstacles(tree, X_FM)), 0.25, 1e-6);
  X_FM.linear() *= 2.0;
  test::expect_says(test::argument_error([&] { to_obstacles(tree, X_FM); }), "X_FM");
}

TEST(Octomap, WhatCannotBeUsedIsSaid) {
  const octomap::OcTree empty(0.1);
  EXPECT_EQ(to_obstacles(empty).size(), 0U);
  EXPECT_EQ(distance(to_obstacles(empty)), std::numeric_limits<double>::infinity());
  const auto tree = random_tree<octomap::OcTree>(0.05, 400);
  OctomapSelection selection;
  selection.limits.max_leaves = occupied_boxes(tree).size();
  EXPECT_EQ(occupied_boxes(tree, selection).size(), selection.limits.max_leaves);
  --selection.limits.max_leaves;
  test::expect_says(
      test::argument_error([&] { to_obstacles(tree, Eigen::Isometry3d::Identity(), selection); }),
      std::to_string(selection.limits.max_leaves) + " (max_leaves)");
  selection = {};
  selection.limits.max_position = 0.5;
  test::expect_says(test::argument_error([&] { occupied_boxes(tree, selection); }),
                    "(max_position)");
  selection = {};
  selection.max_depth = 17;
  test::expect_says(test::argument_error([&] { occupied_boxes(tree, selection); }),
                    "max_depth is 17");
  const Eigen::AlignedBox3d none;
  test::expect_says(test::argument_error([&] { Obstacles::from_boxes({none}); }), "it is empty");
}

}  // namespace
}  // namespace ist
