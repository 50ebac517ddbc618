// The points of an unorganized cloud are sorted into cells, slices and tiles.

#include "cloud/index/point_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <vector>

#include "cloud/index/point_bvh_builder.h"
#include "cloud/index/point_slicer.h"
#include "cloud/index/slice_kernel.h"
#include "support/instruction_sets.h"
#include "support/tiles.h"

namespace ist {
namespace {

using Cloud = std::vector<CloudPoint>;

Cloud numbered(Cloud points) {
  for (std::size_t i = 0; i < points.size(); ++i) points[i].id = static_cast<std::uint32_t>(i);
  return points;
}

Cloud in_a_box(std::size_t n, float size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(-size, size);
  Cloud points;
  for (std::size_t i = 0; i < n; ++i) {
    const float x = u(random), y = u(random), z = u(random);
    points.push_back({x, y, z, 0});
  }
  return numbered(points);
}

// Each point is about half as far from the corner as the one before, repeatedly: at any scale,
// nearly all points are close together.
Cloud nested(std::size_t n, int halvings) {
  Cloud points = in_a_box(n, 1.0F, 3);
  for (std::size_t i = 0; i < n; ++i) {
    const float scale = std::ldexp(1.0F, -static_cast<int>(i % static_cast<std::size_t>(halvings)));
    points[i].x = std::abs(points[i].x) * scale;
    points[i].y *= scale;
    points[i].z *= scale;
  }
  return points;
}

Cloud with_outliers(Cloud points, float distance) {
  points.push_back({distance, 0.0F, 0.0F, 0});
  points.push_back({0.0F, -distance, distance, 0});
  return numbered(points);
}

// Two walls far apart.
Cloud far_clusters(std::size_t n, float distance) {
  Cloud points = in_a_box(n, 1.0F, 4);
  for (std::size_t i = 0; i < n; ++i) {
    points[i].z = 0.0F;
    if (i % 2 == 0) points[i].x += distance;
  }
  return points;
}

Cloud on_a_line(std::size_t n) {
  Cloud points;
  for (std::size_t i = 0; i < n; ++i) {
    const float t = static_cast<float>((i * 7919) % n) / static_cast<float>(n);
    points.push_back({t, 2.0F * t, -t, 0});
  }
  return numbered(points);
}

Cloud of_two_places(std::size_t n, float a, float b) {
  Cloud points;
  for (std::size_t i = 0; i < n; ++i) points.push_back({i % 3 == 0 ? a : b, 0.5F, -0.5F, 0});
  return numbered(points);
}

std::vector<Cloud> hard_clouds() {
  return {{},
          in_a_box(1, 1.0F, 1),
          in_a_box(20000, 1.0F, 2),
          in_a_box(5000, 1e-42F, 2),
          in_a_box(5000, 1e14F, 2),
          nested(20000, 40),
          nested(20000, 120),
          with_outliers(in_a_box(20000, 1.0F, 5), 1000.0F),
          with_outliers(nested(20000, 40), 1e9F),
          far_clusters(20000, 1e6F),
          on_a_line(5000),
          of_two_places(5000, 0.25F, 0.25F),
          of_two_places(5000, 0.25F, std::nextafter(0.25F, 1.0F)),
          of_two_places(5000, 0.0F, std::numeric_limits<float>::denorm_min()),
          of_two_places(5000, -1e14F, 1e14F)};
}

bool is_same(const CloudPoint& a, const CloudPoint& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z && a.id == b.id;
}

TEST(PointCells, eachPointIsInOneCell) {
  test::for_each_instruction_set([] {
    PointCells cells;
    for (const Cloud& cloud : hard_clouds()) {
      Cloud sample(cloud.begin(), cloud.begin() + static_cast<std::ptrdiff_t>(
                                                      std::min(cloud.size(), PointCells::kSample)));
      cells.start(sample.data(), sample.size(), cloud.size());
      cells.add(cloud.data(), cloud.size());
      std::vector<bool> seen(cloud.size(), false);
      std::size_t visited = 0;
      cells.for_each_first([&visited](const CloudPoint&) { ++visited; });
      for (; cells.next(); --visited) {
        Cloud parts;
        cells.for_each_part([&parts](const CloudPoint* part, std::size_t n) {
          parts.insert(parts.end(), part, part + n);
        });
        const PointCells::Points cell = cells.points();
        ASSERT_EQ(cell.size, parts.size());
        for (std::size_t i = 0; i < cell.size; ++i) {
          const std::uint32_t id = cell.points[i].id;
          ASSERT_LT(id, cloud.size());
          ASSERT_TRUE(is_same(cell.points[i], cloud[id]));
          ASSERT_TRUE(is_same(cell.points[i], parts[i]));
          ASSERT_FALSE(seen[id]);
          ASSERT_TRUE(i == 0 || cell.points[i - 1].id < id)
              << "the order of the message must be kept";
          seen[id] = true;
        }
      }
      EXPECT_EQ(visited, 0U) << "each cell has one first point";
      EXPECT_EQ(std::count(seen.begin(), seen.end(), true),
                static_cast<std::ptrdiff_t>(cloud.size()));
      EXPECT_FALSE(cells.next());
    }
  });
}

// A few far points must not make the grid's cells larger.
TEST(PointCells, cellsAreSmall) {
  Cloud cloud = with_outliers(in_a_box(100000, 1.0F, 6), 1000.0F);
  Cloud sample(cloud.end() - PointCells::kSample, cloud.end());
  PointCells cells;
  cells.start(sample.data(), sample.size(), cloud.size());
  cells.add(cloud.data(), cloud.size());
  std::size_t most = 0;
  while (cells.next()) most = std::max(most, cells.points().size);
  EXPECT_LT(most, cloud.size() / 50);
}

TEST(PointCells, slicesAreInOrderAndHoldEachPoint) {
  test::for_each_instruction_set([] {
    PointSlicer slicer;
    for (Cloud cloud : hard_clouds()) {
      const std::size_t n = cloud.size();
      if (n == 0) continue;
      cloud.resize(n + kPointSlack, {std::numeric_limits<float>::quiet_NaN(), 0.0F, 1e30F, 0});
      Cloud sorted(n);
      Eigen::AlignedBox3f box;
      for (std::size_t i = 0; i < n; ++i)
        box.extend(Eigen::Vector3f(cloud[i].x, cloud[i].y, cloud[i].z));
      Eigen::Index axis;
      const float longest = box.sizes().maxCoeff(&axis);
      if (!slicer.sort(cloud.data(), n, sorted.data())) {
        EXPECT_LT(longest, 1e-36F) << "these points can be distinguished";
        continue;
      }
      std::set<std::uint32_t> ids;
      float reached = -std::numeric_limits<float>::infinity();
      for (const CloudPoint& p : sorted) {
        ASSERT_TRUE(is_same(p, cloud[p.id]));
        ids.insert(p.id);
        const float along = axis == 0 ? p.x : axis == 1 ? p.y : p.z;
        ASSERT_GE(along, reached - longest / 30.0F);
        reached = std::max(reached, along);
      }
      EXPECT_EQ(ids.size(), n);
      ASSERT_LE(slicer.dense_end(), n);
      const std::size_t dense = slicer.dense_end() - slicer.dense_begin();
      EXPECT_TRUE(slicer.dense_end() == 0 || (dense > n / 4 && dense < n));
    }
  });
}

PointBvh build(const Cloud& cloud) {
  PointBvh index;
  PointBvhBuilder().build(Eigen::Isometry3d::Identity(), cloud.data(), cloud.size(), {}, &index);
  return index;
}

// Answers may not depend on the instruction set, so the indices are equal.
TEST(PointCells, indexIsTheSameOnEveryInstructionSet) {
  const std::vector<Cloud> clouds = hard_clouds();
  std::vector<PointBvh> expected;
  test::for_each_instruction_set([&] {
    const bool is_first = expected.empty();
    for (std::size_t i = 0; i < clouds.size(); ++i) {
      PointBvh index = build(clouds[i]);
      if (is_first) {
        expected.push_back(std::move(index));
        continue;
      }
      ASSERT_EQ(index.tile_count(), expected[i].tile_count());
      ASSERT_EQ(index.nodes().size(), expected[i].nodes().size());
      const std::vector<PointTile> a = test::tiles_of(index), b = test::tiles_of(expected[i]);
      for (std::size_t t = 0; t < a.size(); ++t) ASSERT_TRUE(test::same_points(a[t], b[t]));
    }
  });
}

float diagonal_of(const PointTile& tile) {
  Eigen::AlignedBox3f box;
  for (int k = 0; k < tile.count; ++k) box.extend(Eigen::Vector3f(tile.x[k], tile.y[k], tile.z[k]));
  return box.diagonal().norm();
}

// Tiles are full, and small where points are close together, in clouds of any shape.
TEST(PointCells, tilesOfHardCloudsAreGood) {
  for (const Cloud& cloud : hard_clouds()) {
    const PointBvh index = build(cloud);
    ASSERT_EQ(index.size(), cloud.size());
    EXPECT_LE(index.tile_count(), cloud.size() / 8 + 1) << "half empty";
  }
  for (const Cloud& cloud : {with_outliers(in_a_box(20000, 1.0F, 5), 1e9F),
                             with_outliers(in_a_box(20000, 1.0F, 5), 1e5F)}) {
    const PointBvh index = build(cloud);
    std::vector<float> diagonals;
    for (const PointTile& tile : test::tiles_of(index)) diagonals.push_back(diagonal_of(tile));
    std::sort(diagonals.begin(), diagonals.end());
    // 16 of 20000 points in 8 m^3 fill a cube 0.32 m across.
    EXPECT_LT(diagonals[diagonals.size() / 2], 0.4F);
    EXPECT_LT(diagonals[diagonals.size() * 99 / 100], 0.8F);
  }
  // Few tiles hold several scales of the nested clouds: a tile's size is in proportion to its
  // distance from the corner.
  const PointBvh index = build(nested(20000, 40));
  std::size_t large = 0;
  for (const PointTile& tile : test::tiles_of(index)) {
    const Eigen::Vector3f p(tile.x[0], tile.y[0], tile.z[0]);
    large += diagonal_of(tile) > 4.0F * p.norm();
  }
  EXPECT_LT(large, index.tile_count() / 10);
}

TEST(PointCells, orderOfPointsChangesNoTilesSize) {
  Cloud cloud = far_clusters(20000, 3.0F);
  const std::size_t tiles = build(cloud).tile_count();
  std::shuffle(cloud.begin(), cloud.end(), std::mt19937(7));
  const auto shuffled = static_cast<double>(build(cloud).tile_count());
  EXPECT_NEAR(shuffled, static_cast<double>(tiles), 0.02 * shuffled);
}

}  // namespace
}  // namespace ist
