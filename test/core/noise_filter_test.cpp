// The noise filter against counting every neighbor.

#include "internal/cloud/noise_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cloud/format/point_reader.h"
#include "support/images.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

using Points = std::vector<Eigen::Vector3d>;

RawCloud raw(const Points& points, std::size_t width) {
  return packed_cloud(reinterpret_cast<const double*>(points.data()), width, points.size() / width);
}

Points read_all(const RawCloud& cloud) {
  Points points;
  for (std::size_t row = 0; row < cloud.height; ++row) {
    for (std::size_t column = 0; column < cloud.width; ++column) {
      points.push_back(point_at(cloud, row, column));
    }
  }
  return points;
}

int neighbors(const Points& points, std::size_t i, double radius) {
  int count = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    count += k != i && (points[k] - points[i]).norm() <= radius;
  }
  return count;
}

// @returns how many are dropped
std::uint32_t check(const RawCloud& cloud, const NoiseFilterConfig& config, double max_range) {
  const Points before = read_all(cloud);
  NoiseFilter filter(config);
  std::uint32_t dropped = 0;
  Points after;
  for (int round = 0; round < 2; ++round) {  // with and without memory of a cloud before
    after = read_all(filter.run(cloud, max_range, &dropped));
  }
  std::uint32_t expected = 0;
  EXPECT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    const bool is_noise = before[i].allFinite() && before[i].norm() <= max_range &&
                          neighbors(before, i, config.radius) < config.neighbors;
    expected += is_noise;
    for (int k = 0; k < 3; ++k) {
      if (is_noise) {
        EXPECT_TRUE(std::isnan(after[i][k])) << i;
      } else {
        EXPECT_TRUE(after[i][k] == before[i][k] || std::isnan(before[i][k])) << i;
      }
    }
  }
  EXPECT_EQ(dropped, expected);
  return dropped;
}

// Surfaces seen by a camera, with points in the air, blind pixels and points out of range.
Points picture(std::size_t width, std::size_t height, test::Rng* rng) {
  Points points;
  for (std::size_t i = 0; i < width * height; ++i) {
    const double u = static_cast<double>(i % width) / 60.0 - 0.5,
                 v = static_cast<double>(i / width) / 60.0 - 0.4;
    double z = u > 0.0 ? 0.6 : 1.1;
    if ((*rng)() % 30 == 0) z = test::uniform(rng, 0.3, 2.0);
    points.emplace_back(u * z, v * z, z);
    if ((*rng)() % 50 == 0) points.back().setConstant(kNan);
    if ((*rng)() % 70 == 0) points.back().x() = kInf;
  }
  return points;
}

TEST(NoiseFilter, CountsEveryNeighbor) {
  test::Rng rng(3);
  for (const NoiseFilterConfig config :
       {NoiseFilterConfig{0.03, 4}, NoiseFilterConfig{0.02, 1}, NoiseFilterConfig{0.06, 30},
        NoiseFilterConfig{0.3, 400}}) {
    SCOPED_TRACE(config.radius);
    const Points points = picture(48, 36, &rng);
    for (const std::size_t width : {std::size_t{48}, points.size(), std::size_t{1}}) {
      const std::uint32_t dropped = check(raw(points, width), config, 1.5);
      EXPECT_GT(dropped, 5U);
      EXPECT_LT(dropped, points.size());
    }
    Points shuffled = points;
    std::shuffle(shuffled.begin(), shuffled.end(), rng);
    check(raw(shuffled, shuffled.size()), config, kInf);
  }
}

// Float cannot tell neighbors apart here: 1000 km from the sensor its step is 6 cm.
TEST(NoiseFilter, FarFromTheSensor) {
  test::Rng rng(4);
  Points points = picture(24, 20, &rng);
  for (Eigen::Vector3d& p : points) p += Eigen::Vector3d(1e6, -2e6, 3e5);
  EXPECT_GT(check(raw(points, 24), {0.03, 4}, kInf), 0U);
}

// The largest range cuts through a surface: what lies beyond it is no obstacle, but shows that what
// lies before it is one.
TEST(NoiseFilter, NeighborsBeyondTheRange) {
  Points points(5, Eigen::Vector3d(0.0, 0.0, 1.51));
  points[2].z() = 1.49;
  for (const std::size_t width : {std::size_t{5}, std::size_t{1}}) {
    EXPECT_EQ(check(raw(points, width), {0.03, 4}, 1.5), 0U);
    EXPECT_EQ(check(raw(points, width), {0.01, 4}, 1.5), 1U);
  }
  for (int i = 0; i < 40; ++i) points.insert(points.begin() + 3, Eigen::Vector3d(0.0, 0.0, 3.0));
  EXPECT_EQ(check(raw(points, points.size()), {0.03, 4}, 1.5), 0U) << "found by a search";
}

TEST(NoiseFilter, NothingInRange) {
  const Points far(40, Eigen::Vector3d(0.0, 0.0, 9.0)), nan(40, Eigen::Vector3d::Constant(kNan));
  EXPECT_EQ(check(raw(far, 8), {0.03, 4}, 3.0), 0U);
  EXPECT_EQ(check(raw(nan, 8), {0.03, 4}, 3.0), 0U);
  const Points huge = {{1e40, 0, 0}, {0, -1e150, 0}, {0, 0, 1e300}, {1e38, 0, 0}};
  EXPECT_EQ(check(raw(huge, 4), {0.03, 4}, 1e9), 0U);
}

TEST(NoiseFilter, DepthImage) {
  CameraModel camera;
  camera.width = 32;
  camera.height = 24;
  camera.K = {40, 0, 16, 0, 40, 12, 0, 0, 1};
  std::vector<float> depths(std::size_t{32} * 24, 0.8F);
  depths[10 * 32 + 7] = 0.4F;
  depths[11] = 0.0F;
  EXPECT_EQ(check(test::depth_cloud(test::rays_of(camera), depths), {0.05, 4}, 3.0), 1U);
}

}  // namespace
}  // namespace ist
