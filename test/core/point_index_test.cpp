#include "internal/cloud/point_bvh.h"
#include "support/tiles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <random>

#include "cloud/index/point_bvh_builder.h"

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
  std::vector<CloudPoint> list() const {
    std::vector<CloudPoint> points;
    for (std::size_t i = 0; i < size(); ++i) points.push_back({x[i], y[i], z[i], id[i]});
    return points;
  }
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

// Distance to the nearest point, and the numbers of nodes and tiles visited.
struct Nearest {
  const PointBvh& index;
  Eigen::Vector3f query;
  float squared = std::numeric_limits<float>::infinity();
  int nodes = 0, tiles = 0;

  void visit(std::int32_t i) {
    ++nodes;
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(i)];
    std::vector<std::pair<float, std::int32_t>> children;
    for (int k = 0; k < node.count; ++k) {
      children.emplace_back(box_of(node, k).squaredExteriorDistance(query), node.child[k]);
    }
    std::sort(children.begin(), children.end());
    for (const auto& [bound, child] : children) {
      if (bound >= squared) return;
      if (child >= 0) {
        visit(child);
        continue;
      }
      ++tiles;
      PointTile scratch;
      const PointTile& tile = index.tile(static_cast<std::size_t>(~child), &scratch);
      for (int k = 0; k < tile.count; ++k) {
        squared = std::min(squared, (point_of(tile, k) - query).squaredNorm());
      }
    }
  }
};

TEST(PointIndex, everyPointOnceAtAnySize) {
  for (const std::size_t n : {0U, 1U, 2U, 15U, 16U, 17U, 63U, 64U, 65U, 255U, 256U, 257U, 1000U,
                              4095U, 4096U, 4097U, 65537U}) {
    SCOPED_TRACE(n);
    check(in_a_box(n, 2.0F, static_cast<unsigned>(n)));
  }
}

TEST(PointIndex, everyPointOnceInADepthImage) { check(depth_image(160, 120)); }

TEST(PointIndex, allPointsEqual) {
  Points points;
  for (int i = 0; i < 5000; ++i) points.add(0.1F, -0.2F, 0.3F);
  check(points);
  const PointBvh index = build(points);
  EXPECT_EQ(index.bounds().sizes(), Eigen::Vector3f::Zero());
  EXPECT_EQ(index.tile_count(), (5000U + 15U) / 16U);
}

TEST(PointIndex, pointsOnALineAndInAPlane) {
  Points line, plane;
  for (int i = 0; i < 3000; ++i) line.add(0.001F * static_cast<float>(i), 0.0F, 0.0F);
  for (int i = 0; i < 3000; ++i) {
    plane.add(0.0F, 0.01F * static_cast<float>(i % 50), 0.01F * static_cast<float>(i / 50));
  }
  check(line);
  check(plane);
}

// The spread of the coordinates may under- or overflow what keys are computed with.
TEST(PointIndex, extremeCoordinates) {
  for (const float size : {1e-45F, 1e-39F, 1e-30F, 1e9F, 1e14F}) {
    SCOPED_TRACE(size);
    check(in_a_box(1000, size, 1));
  }
  Points signed_zeros;
  for (int i = 0; i < 100; ++i) signed_zeros.add(i % 2 == 0 ? 0.0F : -0.0F, 0.0F, -0.0F);
  check(signed_zeros);
}

// A single point a kilometre off makes the Morton grid coarser than the whole cloud. Without
// ordering crowded cells again, tiles of the remaining points would be as large as the cloud.
TEST(PointIndex, outliersDoNotSpoilTheTiles) {
  Points points = in_a_box(20000, 1.0F, 3);
  points.add(1e6F, -1e6F, 1e6F);
  points.add(1000.0F, 0.0F, 0.0F);
  check(points);
  const PointBvh index = build(points);
  std::vector<float> diagonals;
  for (const PointTile& tile : test::tiles_of(index)) {
    Eigen::AlignedBox3f box;
    for (int k = 0; k < tile.count; ++k) box.extend(point_of(tile, k));
    diagonals.push_back(box.diagonal().norm());
  }
  std::sort(diagonals.begin(), diagonals.end());
  // 16 of 20000 points in 8 m^3 fill a cube of 0.19 m, 0.32 m across.
  EXPECT_LT(diagonals[diagonals.size() / 2], 0.4F);
  EXPECT_LT(diagonals[diagonals.size() * 99 / 100], 0.8F);
}

// Sixteen consecutive points of an order may be apart: across depth discontinuities and from cell
// to cell. Without splits, one tile in a hundred of this image is longer than 0.2 m and the longest
// is 1.05 m; the median is 33 mm.
TEST(PointIndex, tilesDoNotSpanDiscontinuities) {
  const PointBvh index = build(depth_image(320, 240));
  std::vector<float> diagonals;
  for (const PointTile& tile : test::tiles_of(index)) {
    Eigen::AlignedBox3f box;
    for (int k = 0; k < tile.count; ++k) box.extend(point_of(tile, k));
    diagonals.push_back(box.diagonal().norm());
  }
  std::sort(diagonals.begin(), diagonals.end());
  EXPECT_LT(diagonals[diagonals.size() * 99 / 100], 0.08F);
  EXPECT_LT(diagonals.back(), 0.2F);
  EXPECT_GT(static_cast<double>(index.size()) / static_cast<double>(index.tile_count()), 10.0)
      << "points a tile: splits must not empty the tiles";
}

TEST(PointIndex, nearestPointAgainstBruteForce) {
  const Points points = depth_image(160, 120);
  const PointBvh index = build(points);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> u(-0.7F, 0.7F);
  double nodes = 0.0, tiles = 0.0;
  constexpr int kQueries = 300;
  for (int i = 0; i < kQueries; ++i) {
    Nearest nearest{index, {u(random), u(random), 0.9F + u(random)}};
    nearest.visit(index.root());
    float expected = std::numeric_limits<float>::infinity();
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Eigen::Vector3f p(points.x[k], points.y[k], points.z[k]);
      expected = std::min(expected, (p - nearest.query).squaredNorm());
    }
    ASSERT_EQ(nearest.squared, expected);
    nodes += nearest.nodes;
    tiles += nearest.tiles;
  }
  // Measured: 6.2 and 4.7. In Morton order without splits, it would be 9.5 and 9.1.
  EXPECT_LT(nodes / kQueries, 7.5);
  EXPECT_LT(tiles / kQueries, 5.5);
}

// Whether two arrays of tiles or nodes are the same, bit by bit. The bytes after the last member,
// `count`, may be anything.
template <typename Array>
bool are_same(const Array& a, const Array& b) {
  using Element = typename Array::value_type;
  constexpr std::size_t kBytes = offsetof(Element, count) + sizeof(Element::count);
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Element& u, const Element& v) {
    return std::memcmp(&u, &v, kBytes) == 0;
  });
}

bool same(const PointBvh& a, const PointBvh& b) {
  return a.size() == b.size() && a.root() == b.root() &&
         are_same(test::tiles_of(a), test::tiles_of(b)) && are_same(a.nodes(), b.nodes());
}

TEST(PointIndex, dependsOnNothingButItsArguments) {
  const Points large = in_a_box(30000, 1.0F, 1), small = depth_image(64, 48);
  const PointBvh expected = build(small);
  PointBvhBuilder builder;
  PointBvh index;
  for (const Points* points : {&small, &large, &small, &small}) {
    const std::vector<CloudPoint> list = points->list();
    builder.build(kFrame, list.data(), list.size(), {}, &index);
  }
  EXPECT_TRUE(same(index, expected));
}

TEST(PointIndex, buffersAreReused) {
  const Points large = in_a_box(30000, 1.0F, 1), small = in_a_box(29000, 1.0F, 2);
  PointBvhBuilder builder;
  PointBvh index;
  const auto run = [&](const Points& points) {
    const std::vector<CloudPoint> list = points.list();
    builder.build(kFrame, list.data(), list.size(), {}, &index);
  };
  run(large);
  PointTile scratch;
  const PointTile* tiles = &index.tile(0, &scratch);
  const auto* nodes = index.nodes().data();
  run(small);
  run(large);
  EXPECT_EQ(&index.tile(0, &scratch), tiles);
  EXPECT_EQ(index.nodes().data(), nodes);
  Checker(large, index).run();
}

TEST(PointIndex, filterDropsPointsOneByOne) {
  const Points points = in_a_box(5000, 1.0F, 4);
  const auto is_dropped = [](float x, float y) { return x > 0.2F || y < -0.9F; };
  PointBvh index;
  std::size_t asked = 0;
  const std::vector<CloudPoint> list = points.list();
  PointBvhBuilder().build(
      kFrame, list.data(), list.size(),
      [&](const PointTile& tile, const PaddedBox& box) {
        asked += static_cast<std::size_t>(tile.count);
        Eigen::AlignedBox3f exact;
        std::uint32_t mask = 0;
        for (int k = 0; k < tile.count; ++k) {
          exact.extend(point_of(tile, k));
          if (is_dropped(tile.x[k], tile.y[k])) mask |= 1U << k;
        }
        EXPECT_EQ(exact.min(), box.min.head<3>().matrix());
        EXPECT_EQ(exact.max(), box.max.head<3>().matrix());
        return mask;
      },
      &index);
  EXPECT_EQ(asked, points.size());
  std::size_t expected = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    expected += is_dropped(points.x[i], points.y[i]) ? 0 : 1;
  }
  ASSERT_EQ(index.size(), expected);
  std::size_t found = 0;
  for (const PointTile& tile : test::tiles_of(index)) {
    ASSERT_GE(tile.count, 1);
    for (int k = 0; k < tile.count; ++k, ++found) {
      const std::size_t source = (tile.id[k] - 7) / 3;
      ASSERT_EQ(tile.x[k], points.x[source]);
      ASSERT_FALSE(is_dropped(tile.x[k], tile.y[k]));
    }
  }
  EXPECT_EQ(found, expected);
  EXPECT_LE(index.bounds().max().x(), 0.2F) << "boxes must shrink to the remaining points";
}

TEST(PointIndex, filterThatDropsAll) {
  const Points points = in_a_box(500, 1.0F, 4);
  PointBvh index;
  const std::vector<CloudPoint> list = points.list();
  PointBvhBuilder().build(
      kFrame, list.data(), list.size(), [](const PointTile&, const PaddedBox&) { return 0xFFFFU; },
      &index);
  EXPECT_TRUE(index.empty());
  EXPECT_EQ(index.root(), -1);
  EXPECT_TRUE(index.nodes().empty());
}

TEST(PointIndex, fiveMillionPoints) {
  const Points points = depth_image(2500, 2000);
  const PointBvh index = build(points);
  ASSERT_EQ(index.size(), 5000000U);
  std::vector<bool> seen(points.size(), false);
  for (const PointTile& tile : test::tiles_of(index)) {
    for (int k = 0; k < tile.count; ++k) seen[(tile.id[k] - 7) / 3] = true;
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 5000000);
}

}  // namespace
}  // namespace ist
