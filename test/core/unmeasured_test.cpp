// What share of a message was measured, by its type: what is not measured must not read as free.

#include "internal/cloud/unmeasured.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "internal/cloud/noise_filter.h"
#include "ist_proximity/cloud/depth_image.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/laser_scan.h"
#include "ist_proximity/facade/obstacles.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kWidth = 48, kHeight = 32, kCount = kWidth * kHeight;

// The ranges of a node's source: points are kept from 0.05 to 3 m, and believed up to 100 m.
IngestConfig config_of(double sensor_range = 100.0) {
  IngestConfig config;
  config.sensor_range = sensor_range;
  return config;
}

IngestCounts ingested(const RawCloud& raw, const IngestConfig& config) {
  CloudSnapshot snapshot;
  Ingest(config).run(raw, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot);
  const IngestCounts& n = snapshot.counts;
  EXPECT_EQ(n.received,
            n.not_a_number + n.infinite + n.out_of_range + n.outside_region + n.on_robot + n.used);
  EXPECT_LE(n.too_near + n.not_believed, n.out_of_range);
  return n;
}

// A message whose i-th pixel, beam or point has the i-th depth, range or distance from the sensor,
// along rays that spread by 0.01 rad; 0 is a point at the sensor.
enum class Kind { kImage, kList, kDoubles, kMillimetres, kMetres, kScan };
const Kind kKinds[] = {Kind::kImage,       Kind::kList,   Kind::kDoubles,
                       Kind::kMillimetres, Kind::kMetres, Kind::kScan};
const char* name(Kind kind) {
  const char* const names[] = {"organized", "list", "doubles", "16UC1", "32FC1", "scan"};
  return names[static_cast<std::size_t>(kind)];
}

IngestCounts counts_of_cloud(const std::vector<float>& lengths, Kind kind, IngestConfig config) {
  std::vector<float> floats;
  std::vector<double> doubles;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const double angle = 0.01 * static_cast<double>(i % kWidth);
    const double height = 0.01 * static_cast<double>(i / kWidth);
    Eigen::Vector3d ray(std::sin(angle), height, std::cos(angle));
    ray.normalize();
    Eigen::Vector3d p = static_cast<double>(lengths[i]) * ray;
    if (!std::isfinite(lengths[i])) p.setConstant(static_cast<double>(lengths[i]));
    for (int k = 0; k < 3; ++k) {
      floats.push_back(static_cast<float>(p[k]));
      doubles.push_back(p[k]);
    }
    floats.push_back(0.0F);
  }
  if (kind == Kind::kDoubles) return ingested(packed_cloud(doubles.data(), kCount, 1), config);
  const bool is_list = kind == Kind::kList;
  return ingested(packed_cloud(floats.data(), is_list ? kCount : kWidth, is_list ? 1 : kHeight, 4),
                  config);
}

IngestCounts counts_of_image(const std::vector<float>& depths, bool is_float, IngestConfig config,
                             NoiseFilter* noise = nullptr) {
  CameraModel camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.P = {100, 0, kWidth / 2.0, 0, 0, 100, kHeight / 2.0, 0, 0, 0, 1, 0};
  std::shared_ptr<const DepthRays> rays;
  EXPECT_EQ(check_camera(camera, &rays), "");
  std::vector<std::uint16_t> millimetres;
  for (const float depth : depths) {
    const bool fits = depth > 0.0F && depth < 65.0F;
    millimetres.push_back(static_cast<std::uint16_t>(fits ? std::lround(1000.0F * depth) : 0));
  }
  DepthImage image;
  image.encoding = is_float ? "32FC1" : "16UC1";
  image.width = kWidth;
  image.height = kHeight;
  image.step = kWidth * (is_float ? 4 : 2);
  image.data = is_float ? reinterpret_cast<const std::uint8_t*>(depths.data())
                        : reinterpret_cast<const std::uint8_t*>(millimetres.data());
  image.data_size = kHeight * image.step;
  RawCloud raw;
  EXPECT_EQ(check_depth_image(image, rays, &raw), "");
  std::uint32_t dropped = 0;
  if (noise != nullptr) raw = noise->run(raw, config.max_range, &dropped);
  return ingested(raw, config);
}

IngestCounts counts_of_scan(const std::vector<float>& ranges, const IngestConfig& config) {
  LaserScan scan;
  scan.angle_increment = 0.001;
  scan.range_min = 0.01;
  scan.range_max = 30.0;
  scan.ranges = ranges.data();
  scan.count = ranges.size();
  EXPECT_EQ(check_scan(scan), "");
  ScanPoints points;
  to_points(scan, config.min_range, config.max_range, {}, &points, config.sensor_range);
  IngestConfig without_ranges = config;
  without_ranges.min_range = 0.0;
  without_ranges.max_range = std::numeric_limits<double>::infinity();
  return ingested(points.raw(), without_ranges);
}

IngestCounts counts_of(const std::vector<float>& lengths, Kind kind) {
  switch (kind) {
    case Kind::kMillimetres:
    case Kind::kMetres:
      return counts_of_image(lengths, kind == Kind::kMetres, config_of(10.0));
    case Kind::kScan:
      return counts_of_scan(lengths, config_of());
    default:
      return counts_of_cloud(lengths, kind, config_of());
  }
}

bool is_cloud(Kind kind) { return kind <= Kind::kDoubles; }

// A message that is the same everywhere says nothing, unless its own convention says that nothing
// is there: +inf of a scan (REP 117) and of a depth image in metres (REP 118).
TEST(Unmeasured, NothingUsable) {
  struct Row {
    const char* what;
    float length;
    bool (*is_free)(Kind);
    bool (*is_there)(Kind);
  };
  const auto never = [](Kind) { return false; };
  const auto always = [](Kind) { return true; };
  const Row rows[] = {
      {"zeros", 0.0F, never, always},
      {"NaN", kNan, never, always},
      {"+inf", kInf, [](Kind k) { return k == Kind::kMetres || k == Kind::kScan; },
       [](Kind k) { return k != Kind::kMillimetres; }},
      {"-inf", -kInf, never, always},
      {"2 cm before the lens", 0.02F, never, always},
      {"wrong unit", 1400.0F, never, [](Kind k) { return k != Kind::kMillimetres; }},
      {"wrong unit, 0.1 mm", 14.0F, always,
       [](Kind k) { return k != Kind::kMillimetres && k != Kind::kMetres; }},
      {"wrong unit of an image", 14.0F, never,
       [](Kind k) { return k == Kind::kMillimetres || k == Kind::kMetres; }},
      {"beyond max_range", 5.0F, always, always},
      {"in range", 1.0F, always, always},
      {"no return before REP 117", 31.0F, always, [](Kind k) { return k == Kind::kScan; }},
      {"beyond range_max", 32.0F, never, [](Kind k) { return k == Kind::kScan; }}};
  for (const Row& row : rows) {
    for (const Kind kind : kKinds) {
      if (!row.is_there(kind)) continue;
      SCOPED_TRACE(std::string(row.what) + ", " + name(kind));
      const IngestCounts counts = counts_of(std::vector<float>(kCount, row.length), kind);
      EXPECT_EQ(counts.received, kCount);
      EXPECT_EQ(counts.measured_share(), row.is_free(kind) ? 1.0 : 0.0) << unmeasured(counts);
      EXPECT_EQ(counts.saw_enough(0.1), row.is_free(kind));
      EXPECT_EQ(unmeasured(counts).empty(), row.is_free(kind));
    }
  }
}

// All that can be wrong with a point beside each other, in every form of a message: each is counted
// once, wherever the blocks and rows of the message begin.
TEST(Unmeasured, SharesOfAMixture) {
  test::Rng rng(3);
  const float lengths[] = {0.0F, kNan, kInf, -kInf, 0.02F, 0.5F, 2.0F, 5.0F, 1400.0F};
  for (int trial = 0; trial < 8; ++trial) {
    std::vector<float> mixture;
    std::size_t how_many[9] = {};
    std::size_t kind_of_length = 0;
    while (mixture.size() < kCount) {
      if (rng() % (trial % 2 == 0 ? 3 : 40) == 0) kind_of_length = rng() % 9;
      ++how_many[kind_of_length];
      mixture.push_back(lengths[kind_of_length]);
    }
    for (const Kind kind : kKinds) {
      SCOPED_TRACE(name(kind));
      const IngestCounts counts = counts_of(mixture, kind);
      const std::size_t free = kind == Kind::kMetres || kind == Kind::kScan ? how_many[2] : 0;
      EXPECT_EQ(counts.measured(), how_many[5] + how_many[6] + how_many[7] + free);
      const bool tells_zero = is_cloud(kind);
      EXPECT_EQ(counts.too_near, how_many[4] + (tells_zero ? how_many[0] : 0));
      EXPECT_EQ(counts.not_believed, kind == Kind::kMillimetres ? 0 : how_many[8]);
    }
  }
}

// Real sensors: a depth camera with 60 % of its pixels empty, a lidar that pads with zeros, a
// scanner in the open; and one far point beside zeros.
TEST(Unmeasured, OrdinarySensorsSeeEnough) {
  const auto share_of = [](Kind kind, float filler, double share) {
    std::vector<float> lengths(kCount, filler);
    std::fill_n(lengths.begin(), std::lround(share * kCount), 1.2F);
    return counts_of(lengths, kind);
  };
  for (const Kind kind : kKinds) {
    SCOPED_TRACE(name(kind));
    EXPECT_NEAR(share_of(kind, kNan, 0.4).measured_share(), 0.4, 1e-3);
    EXPECT_NEAR(share_of(kind, 0.0F, 0.3).measured_share(), 0.3, 1e-3);
    EXPECT_TRUE(share_of(kind, 0.0F, 0.3).saw_enough(0.1));
    EXPECT_FALSE(share_of(kind, 0.0F, 1.0 / kCount).saw_enough(0.1));
    EXPECT_TRUE(share_of(kind, 0.0F, 1.0 / kCount).saw_enough(0.0));
  }
  EXPECT_EQ(share_of(Kind::kScan, kInf, 0.05).measured_share(), 1.0);
}

// Rays in different directions do not end at one point; a list may hold one point or two.
TEST(Unmeasured, PointsAtOnePlace) {
  const auto counts_of_points = [](const std::vector<Eigen::Vector3d>& points,
                                   double min_range = 0.05) {
    IngestConfig config = config_of();
    config.min_range = min_range;
    return ingested(packed_cloud(points.data()->data(), points.size(), 1), config);
  };
  for (const Eigen::Vector3d& place :
       {Eigen::Vector3d(0.3, 0.1, 0.2), Eigen::Vector3d(4.0, 4.0, 4.0)}) {
    std::vector<Eigen::Vector3d> points(500, place);
    EXPECT_EQ(counts_of_points(points).at_one_place, 500U);
    EXPECT_TRUE(counts_of_points(points).saw_nothing());
    points[77] = {0.4, 0.1, 0.2};
    EXPECT_EQ(counts_of_points(points).measured(), 1U);
    for (std::size_t i = 0; i < points.size(); i += 2) {
      points[i].x() += 1e-3 * static_cast<double>(i + 1);
    }
    EXPECT_EQ(counts_of_points(points).measured_share(), 1.0) << "half of them differ";
  }
  EXPECT_EQ(counts_of_points({{0.3, 0.1, 0.2}}).measured_share(), 1.0);
  EXPECT_EQ(counts_of_points({{0.3, 0.1, 0.2}, {0.4, 0.1, 0.2}}).measured_share(), 1.0);
  EXPECT_TRUE(counts_of_points(std::vector<Eigen::Vector3d>(9, {0, 0, 0}), 0.0).saw_nothing());
}

// A noise filter turns an image into points, which mean the same.
TEST(Unmeasured, NoiseFilterKeepsTheConvention) {
  NoiseFilterConfig filter;
  filter.radius = 0.05;
  NoiseFilter noise(filter);
  const auto share = [&](float depth) {
    return counts_of_image(std::vector<float>(kCount, depth), true, config_of(10.0), &noise)
        .measured_share();
  };
  EXPECT_EQ(share(kInf), 1.0);
  EXPECT_EQ(share(1.0F), 1.0);
  EXPECT_EQ(share(0.0F), 0.0);
  EXPECT_EQ(share(0.02F), 0.0);
  EXPECT_EQ(share(1400.0F), 0.0);
}

// The facade has no ranges unless they are set: a point at the origin of its frame is an obstacle.
TEST(Unmeasured, ObstaclesThatWereNotMeasuredAreRefused) {
  const auto points = [](float x) { return std::vector<Eigen::Vector3f>(50, {x, x, x}); };
  for (const float x : {kNan, kInf, -kInf, 0.0F, 0.7F}) {
    EXPECT_THROW(Obstacles(points(x), {}), std::invalid_argument) << x;
    EXPECT_THROW(Obstacles::from_image(points(x).data()->data(), 10, 5), std::invalid_argument)
        << x;
  }
  ObstaclesConfig config;
  config.min_range = 0.5;
  const std::vector<Eigen::Vector3f> near = {{0.1F, 0.0F, 0.0F}, {0.2F, 0.0F, 0.0F}};
  EXPECT_THROW(Obstacles(near, config), std::invalid_argument);
  EXPECT_EQ(Obstacles(near).size(), 2U);
  EXPECT_EQ(Obstacles(std::vector<Eigen::Vector3f>()).size(), 0U) << "no obstacles";
  EXPECT_EQ(Obstacles(std::vector<Eigen::Vector3f>(1, {0.0F, 0.0F, 0.0F})).size(), 1U);
  std::vector<Eigen::Vector3f> mostly_blind = points(kNan);
  mostly_blind[7] = {0.5F, 0.0F, 0.0F};
  EXPECT_EQ(Obstacles(mostly_blind).size(), 1U) << "a part of an image";
}

}  // namespace
}  // namespace ist
