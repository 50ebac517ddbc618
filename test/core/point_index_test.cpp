#include "internal/cloud/point_bvh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include "support/instruction_sets.h"
#include "support/tiles.h"

namespace ist {
namespace {

struct Points {
  std::vector<float> x, y, z;
  std::vector<std::uint32_t> id;

  void add(float px, float py, float pz) {
    x.push_back(px);
    y.push_back(py);
    z.push_back(pz);
    id.push_back(7 + 3 * static_cast<std::uint32_t>(id.size()));  // not the position
  }
  std::size_t size() const { return x.size(); }
};

const Eigen::Isometry3d kFrame(Eigen::Translation3d(1.0, 2.0, 3.0));

PointBvh build(const Points& points) {
  PointIndex index;
  index.build({1.0, 2.0, 3.0}, points.x.data(), points.y.data(), points.z.data(), points.id.data(),
              points.size());
  return index.bvh();
}

Points in_a_box(std::size_t n, float size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(-size, size);
  Points points;
  for (std::size_t i = 0; i < n; ++i) points.add(u(random), u(random), u(random));
  return points;
}

// A depth camera's view: a wavy wall 1.5 m away and, before its right half, a board.
Points depth_image(int width, int height) {
  Points points;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const float a = static_cast<float>(u) / static_cast<float>(width) - 0.5F;
      const float b = static_cast<float>(v) / static_cast<float>(height) - 0.5F;
      const float depth = a > 0.1F ? 0.9F : 1.5F + 0.1F * std::sin(9.0F * a) * std::cos(7.0F * b);
      points.add(a * depth, b * depth, depth);
    }
  }
  return points;
}

Eigen::AlignedBox3f box_of(const BoxNode& node, int k) {
  return {Eigen::Vector3f(node.min_x[k], node.min_y[k], node.min_z[k]),
          Eigen::Vector3f(node.max_x[k], node.max_y[k], node.max_z[k])};
}

Eigen::Vector3f point_of(const PointTile& tile, int k) { return {tile.x[k], tile.y[k], tile.z[k]}; }

// Traverses the index and checks every statement of the header.
class Checker {
 public:
  Checker(const Points& points, const PointBvh& index)
      : points_(points),
        index_(index),
        seen_(points.size(), 0),
        tile_seen_(index.tile_count(), 0) {}

  void run() {
    ASSERT_EQ(index_.size(), points_.size());
    ASSERT_EQ(index_.empty(), points_.size() == 0);
    ASSERT_EQ(index_.X_FO().matrix(), kFrame.matrix());
    if (index_.empty()) {
      EXPECT_TRUE(index_.nodes().empty());
      EXPECT_EQ(index_.root(), -1);
      EXPECT_TRUE(index_.bounds().isEmpty());
      return;
    }
    const Eigen::AlignedBox3f all = node(index_.root());
    EXPECT_EQ(all.min(), index_.bounds().min());
    EXPECT_EQ(all.max(), index_.bounds().max());
    EXPECT_EQ(nodes_, index_.nodes().size());
    for (const int times : tile_seen_) ASSERT_EQ(times, 1);
    for (const int times : seen_) ASSERT_EQ(times, 1);
  }

 private:
  // Returns the exact bounds of the subtree; the stored box must equal them.
  Eigen::AlignedBox3f node(std::int32_t i) {
    ++nodes_;
    const BoxNode& node_i = index_.nodes()[static_cast<std::size_t>(i)];
    EXPECT_GE(node_i.count, 1);
    EXPECT_LE(node_i.count, kPointWidth);
    Eigen::AlignedBox3f all;
    for (int k = 0; k < kPointWidth; ++k) {
      const Eigen::AlignedBox3f stored = box_of(node_i, k);
      if (k >= node_i.count) {
        EXPECT_EQ(stored.min(), Eigen::Vector3f::Constant(kFarAway));
        EXPECT_EQ(stored.max(), Eigen::Vector3f::Constant(kFarAway));
        continue;
      }
      const std::int32_t child = node_i.child[k];
      const Eigen::AlignedBox3f exact = child >= 0 ? node(child) : tile(~child);
      EXPECT_EQ(stored.min(), exact.min());
      EXPECT_EQ(stored.max(), exact.max());
      all.extend(exact);
    }
    return all;
  }

  Eigen::AlignedBox3f tile(std::int32_t i) {
    PointTile scratch;
    const PointTile& tile_i = index_.tile(static_cast<std::size_t>(i), &scratch);
    ++tile_seen_[static_cast<std::size_t>(i)];
    EXPECT_GE(tile_i.count, 1);
    EXPECT_LE(tile_i.count, kPointWidth);
    Eigen::AlignedBox3f all;
    for (int k = 0; k < kPointWidth; ++k) {
      const Eigen::Vector3f p = point_of(tile_i, k);
      if (k >= tile_i.count) {
        EXPECT_EQ(p, Eigen::Vector3f::Constant(kFarAway));
        EXPECT_TRUE(std::isfinite(p.squaredNorm()));
        continue;
      }
      const std::size_t source = (tile_i.id[k] - 7) / 3;
      if (source >= seen_.size()) {
        ADD_FAILURE() << "id " << tile_i.id[k];
        continue;
      }
      ++seen_[source];
      EXPECT_EQ(p, Eigen::Vector3f(points_.x[source], points_.y[source], points_.z[source]));
      all.extend(p);
    }
    return all;
  }

  const Points& points_;
  const PointBvh& index_;
  std::vector<int> seen_, tile_seen_;
  std::size_t nodes_ = 0;
};

void check(const Points& points) { Checker(points, build(points)).run(); }

// Each point is about half as far from the corner as the one before, repeatedly: at any scale,
// nearly all points are close together.
Points nested(int halvings) {
  const Points box = in_a_box(20000, 1.0F, 3);
  Points points;
  for (std::size_t i = 0; i < box.size(); ++i) {
    const float scale = std::ldexp(1.0F, -static_cast<int>(i % static_cast<std::size_t>(halvings)));
    points.add(std::abs(box.x[i]) * scale, box.y[i] * scale, box.z[i] * scale);
  }
  return points;
}

Points with_outliers(Points points, float distance) {
  points.add(distance, 0.0F, 0.0F);
  points.add(0.0F, -distance, distance);
  return points;
}

Points of_two_places(float a, float b) {
  Points points;
  for (int i = 0; i < 5000; ++i) points.add(i % 3 == 0 ? a : b, 0.5F, -0.5F);
  return points;
}

// The spread of the coordinates may under- or overflow what cells are computed with.
std::vector<Points> hard_clouds() {
  Points line, plane, apart;
  for (int i = 0; i < 3000; ++i) {
    line.add(0.001F * static_cast<float>(i), 0.0F, 0.0F);
    plane.add(0.0F, 0.01F * static_cast<float>(i % 50), 0.01F * static_cast<float>(i / 50));
    apart.add(i % 2 == 0 ? 1e6F : 0.0F, 0.001F * static_cast<float>(i), 0.0F);
  }
  return {line,
          plane,
          apart,
          depth_image(160, 120),
          in_a_box(1000, 1e-45F, 1),
          in_a_box(1000, 1e-39F, 1),
          in_a_box(5000, 1e-30F, 1),
          in_a_box(5000, 1e14F, 2),
          nested(40),
          nested(120),
          with_outliers(in_a_box(20000, 1.0F, 5), 1000.0F),
          with_outliers(nested(40), 1e9F),
          of_two_places(0.25F, 0.25F),
          of_two_places(0.25F, std::nextafter(0.25F, 1.0F)),
          of_two_places(0.0F, -0.0F),
          of_two_places(0.0F, std::numeric_limits<float>::denorm_min()),
          of_two_places(-1e14F, 1e14F)};
}

TEST(PointIndex, everyPointOnceAtAnySize) {
  for (const std::size_t n : {0U, 1U, 2U, 15U, 16U, 17U, 63U, 64U, 65U, 255U, 256U, 257U, 1000U,
                              4095U, 4096U, 4097U, 65537U}) {
    SCOPED_TRACE(n);
    check(in_a_box(n, 2.0F, static_cast<unsigned>(n)));
  }
}

TEST(PointIndex, everyPointOnceInHardClouds) {
  test::for_each_instruction_set([] {
    for (const Points& points : hard_clouds()) {
      check(points);
      EXPECT_LE(build(points).tile_count(), points.size() / 8 + 1) << "half empty";
    }
  });
}

// [m] Of the boxes of all tiles, in order.
std::vector<float> diagonals(const PointBvh& index) {
  std::vector<float> sizes;
  for (const PointTile& tile : test::tiles_of(index)) {
    Eigen::AlignedBox3f box;
    for (int k = 0; k < tile.count; ++k) box.extend(point_of(tile, k));
    sizes.push_back(box.diagonal().norm());
  }
  std::sort(sizes.begin(), sizes.end());
  return sizes;
}

// A single point a kilometre off makes the Morton grid coarser than the whole cloud. Without
// ordering crowded cells again, tiles of the remaining points would be as large as the cloud.
TEST(PointIndex, outliersDoNotSpoilTheTiles) {
  for (const float distance : {1000.0F, 1e6F, 1e9F}) {
    const auto sizes = diagonals(build(with_outliers(in_a_box(20000, 1.0F, 3), distance)));
    // 16 of 20000 points in 8 m^3 fill a cube of 0.19 m, 0.32 m across.
    EXPECT_LT(sizes[sizes.size() / 2], 0.4F);
    EXPECT_LT(sizes[sizes.size() * 99 / 100], 0.8F);
  }
}

// Sixteen consecutive points of an order may be apart: across depth discontinuities and from cell
// to cell. Without splits, one tile in a hundred of this image is longer than 0.2 m and the longest
// is 1.05 m; the median is 33 mm.
TEST(PointIndex, tilesDoNotSpanDiscontinuities) {
  const PointBvh index = build(depth_image(320, 240));
  const std::vector<float> sizes = diagonals(index);
  EXPECT_LT(sizes[sizes.size() * 99 / 100], 0.08F);
  EXPECT_LT(sizes.back(), 0.2F);
  EXPECT_GT(static_cast<double>(index.size()) / static_cast<double>(index.tile_count()), 10.0)
      << "points a tile: splits must not empty the tiles";
}

}  // namespace
}  // namespace ist
