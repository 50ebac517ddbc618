#include "internal/cloud/point_bvh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include "support/instruction_sets.h"

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

// Visits every point of an index, each of which is to be there once, at its place.
struct Walk {
  // The bounds of the points below a child, which are those that its parent states.
  Eigen::AlignedBox3f bounds(std::int32_t child) {
    Eigen::AlignedBox3f all;
    if (child < 0) {
      PointTile scratch;
      const PointTile& tile = index.tile(static_cast<std::size_t>(~child), &scratch);
      for (int k = 0; k < tile.count; ++k) {
        const std::size_t source = (tile.id[k] - 7) / 3;
        ++seen.at(source);
        const Eigen::Vector3f p(points.x[source], points.y[source], points.z[source]);
        EXPECT_EQ(Eigen::Vector3f(tile.x[k], tile.y[k], tile.z[k]), p);
        all.extend(p);
      }
      return all;
    }
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(child)];
    for (int k = 0; k < node.count; ++k) {
      const Eigen::AlignedBox3f exact = bounds(node.child[k]);
      EXPECT_EQ(Eigen::Vector3f(node.min_x[k], node.min_y[k], node.min_z[k]), exact.min());
      EXPECT_EQ(Eigen::Vector3f(node.max_x[k], node.max_y[k], node.max_z[k]), exact.max());
      all.extend(exact);
    }
    return all;
  }

  const Points& points;
  const PointBvh& index;
  std::vector<int> seen = std::vector<int>(points.size(), 0);
};

void check(const Points& points) {
  const PointBvh index = build(points);
  ASSERT_EQ(index.size(), points.size());
  ASSERT_EQ(index.empty(), points.size() == 0);
  ASSERT_EQ(index.X_FO().matrix(), kFrame.matrix());
  if (index.empty()) return;
  Walk walk{points, index};
  const Eigen::AlignedBox3f all = walk.bounds(index.root());
  EXPECT_EQ(all.min(), index.bounds().min());
  EXPECT_EQ(all.max(), index.bounds().max());
  for (const int times : walk.seen) ASSERT_EQ(times, 1);
}

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

}  // namespace
}  // namespace ist
