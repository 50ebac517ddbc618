#include "ist_proximity/cloud/ingest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <stdexcept>
#include <tuple>

#include "support/errors.h"
#include "support/instruction_sets.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

using Points = std::vector<Eigen::Vector3d>;

// The layout of a message's points.
struct Format {
  bool is_double = false, is_bigendian = false;
  std::size_t x = 0, y = 4, z = 8, point_step = 12;
  std::size_t width = 0;        // 0: one row
  std::size_t row_padding = 0;  // bytes after each row
  std::size_t misaligned = 1;   // bytes before the first point; 1: nothing is aligned
  bool owned = false;           // the cloud shares the bytes, so tiles can be loaded lazily
};

template <typename T>
void put(T value, bool reversed, std::uint8_t* bytes) {
  std::memcpy(bytes, &value, sizeof value);
  if (reversed) std::reverse(bytes, bytes + sizeof value);
}

// A message's bytes, checked as the node checks them. The bytes between the coordinates are 0xFF.
class Message {
 public:
  Message(const Points& points, const Format& format) {
    const std::size_t width = format.width == 0 ? points.size() : format.width;
    CloudLayout layout;
    layout.width = static_cast<std::uint32_t>(width);
    layout.height = static_cast<std::uint32_t>(width == 0 ? 0 : points.size() / width);
    layout.point_step = static_cast<std::uint32_t>(format.point_step);
    layout.row_step = static_cast<std::uint32_t>(width * format.point_step + format.row_padding);
    layout.is_bigendian = format.is_bigendian;
    const auto type = static_cast<std::uint8_t>(format.is_double ? 8 : 7);
    layout.fields = {{"x", static_cast<std::uint32_t>(format.x), type, 1},
                     {"y", static_cast<std::uint32_t>(format.y), type, 1},
                     {"z", static_cast<std::uint32_t>(format.z), type, 1}};
    bytes_->assign(format.misaligned + std::size_t{layout.height} * layout.row_step, 0xFF);
    for (std::size_t i = 0; i < points.size(); ++i) {
      std::uint8_t* point = &(*bytes_)[format.misaligned] + i / width * layout.row_step +
                            i % width * format.point_step;
      for (const auto& [offset, value] :
           {std::pair{format.x, points[i].x()}, std::pair{format.y, points[i].y()},
            std::pair{format.z, points[i].z()}}) {
        if (format.is_double) {
          put(value, format.is_bigendian, point + offset);
        } else {
          put(static_cast<float>(value), format.is_bigendian, point + offset);
        }
      }
    }
    layout.data = bytes_->data() + format.misaligned;
    layout.data_size = bytes_->size() - format.misaligned;
    EXPECT_EQ(check_layout(layout, &raw), "");
    if (format.owned) raw.owner = bytes_;
  }
  Message(const Message&) = delete;

  RawCloud raw;

 private:
  std::shared_ptr<std::vector<std::uint8_t>> bytes_ = std::make_shared<std::vector<std::uint8_t>>();
};

Format float64() {
  Format format;
  format.is_double = true;
  format.y = 8;
  format.z = 16;
  format.point_step = 24;
  return format;
}

// As drivers write points: with a fourth float.
Format four_floats(std::size_t width = 0) {
  Format format;
  format.point_step = 16;
  format.width = width;
  format.misaligned = 0;
  return format;
}

CloudSnapshot ingest(const Points& points, const IngestConfig& config = {},
                     const Format& format = {},
                     const Eigen::Isometry3d& X_FS = Eigen::Isometry3d::Identity(),
                     const std::vector<PosedSolid>& robot = {}) {
  const Message message(points, format);
  CloudSnapshot snapshot;
  Ingest(config).run(message.raw, X_FS, robot, 12.5, &snapshot);
  const IngestCounts& n = snapshot.counts;
  EXPECT_EQ(n.received, points.size());
  EXPECT_EQ(n.received,
            n.not_a_number + n.infinite + n.out_of_range + n.outside_region + n.on_robot + n.used);
  EXPECT_EQ(n.used, snapshot.index.size());
  return snapshot;
}

Points random_points(std::size_t n, double size, unsigned seed) {
  std::mt19937 random(seed);
  // The coordinates are floats, so that float32 and float64 messages hold the same points.
  std::uniform_real_distribution<float> u(-static_cast<float>(size), static_cast<float>(size));
  Points points;
  for (std::size_t i = 0; i < n; ++i) {
    const float x = u(random), y = u(random), z = u(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

Eigen::Isometry3d pose(double x, double y, double z) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() << x, y, z;
  X.rotate(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()));
  return X;
}

TEST(Ingest, emptyCloud) {
  const CloudSnapshot snapshot = ingest({});
  EXPECT_TRUE(snapshot.index.empty());
  EXPECT_TRUE(snapshot.index.bvh().thinned().empty());
  EXPECT_FALSE(snapshot.counts.saw_nothing())
      << "an empty cloud is a measurement without obstacles";
}

TEST(Ingest, countsAndStamp) {
  const Points points = {{1, 0, 0},  {kNan, 0, 0}, {0, kNan, kInf},  {0, -kInf, 0},
                         {0, 0, 10}, {0.01, 0, 0}, {0, -1e38, 1e38}, {kInf, 1e300, 0}};
  for (const Format& format : {Format(), float64()}) {
    const CloudSnapshot snapshot = ingest(points, {}, format);
    EXPECT_EQ(snapshot.counts.not_a_number, 2U) << "NaN counts before infinite";
    EXPECT_EQ(snapshot.counts.infinite, 2U);
    EXPECT_EQ(snapshot.counts.out_of_range, 3U);
    EXPECT_EQ(snapshot.counts.on_robot, 0U);
    EXPECT_EQ(snapshot.counts.used, 1U);
    EXPECT_EQ(snapshot.stamp, 12.5);
    EXPECT_GT(snapshot.ingest_time, 0.0);
  }
}

TEST(Ingest, rangesIncludeTheirBounds) {
  IngestConfig config;
  config.min_range = 0.5;
  config.max_range = 2.0;
  const float too_near = std::nextafter(0.5F, 0.0F), too_far = std::nextafter(2.0F, 3.0F);
  const CloudSnapshot snapshot = ingest({{0.5, 0, 0},
                                         {0, 2.0, 0},
                                         {0, 0, static_cast<double>(too_near)},
                                         {static_cast<double>(too_far), 0, 0},
                                         {1.2, 1.2, 1.2},
                                         {1.1, 1.1, 1.1}},
                                        config);
  EXPECT_EQ(test::ids_of(snapshot.index), (std::set<std::uint32_t>{0, 1, 5}));
}

TEST(Ingest, denormalsAndZeroFollowMinRange) {
  const Points points = {{0, 0, 0}, {1e-45, 0, 0}, {-1e-40, 1e-42, 0}, {0.04, 0, 0}};
  EXPECT_EQ(ingest(points).counts.out_of_range, 4U);
  IngestConfig config;
  config.min_range = 0.0;
  EXPECT_EQ(ingest(points, config).counts.used, 4U);
}

TEST(Ingest, everyFormatReadsTheSame) {
  Points points = random_points(600, 1.5, 1);
  points[17].x() = kNan;
  points[45].z() = kInf;
  std::map<std::string, Format> formats;
  formats["float64"] = float64();
  formats["four floats"] = four_floats();
  for (const bool is_bigendian : {false, true}) {
    for (const bool is_double : {false, true}) {
      const std::size_t size = is_double ? 8 : 4;
      const std::string name =
          std::string(is_double ? "float64" : "float32") + (is_bigendian ? " big endian" : "");
      Format odd;
      odd.is_double = is_double;
      odd.is_bigendian = is_bigendian;
      odd.point_step = 37;  // odd stride and offsets, coordinates in another order
      odd.z = 1;
      odd.x = 1 + size + 2;
      odd.y = 37 - size;
      formats[name + ", odd stride"] = odd;
      Format rows = odd;
      rows.width = 25;
      formats[name + ", organized"] = rows;
      rows.row_padding = 11;
      formats[name + ", padded rows"] = rows;
      rows.width = 1;
      formats[name + ", one padded column"] = rows;
      rows.width = 300;
      formats[name + ", rows longer than a block"] = rows;
    }
  }
  const Eigen::Isometry3d X_FS = pose(0.3, -0.2, 0.9);
  const CloudSnapshot expected = ingest(points, {}, {}, X_FS);
  const auto expected_points = test::points_by_id(expected.index);
  ASSERT_GT(expected_points.size(), 500U);
  for (const auto& [name, format] : formats) {
    SCOPED_TRACE(name);
    const CloudSnapshot snapshot = ingest(points, {}, format, X_FS);
    EXPECT_EQ(snapshot.counts.not_a_number, 1U);
    EXPECT_EQ(snapshot.counts.infinite, 1U);
    EXPECT_TRUE(test::points_by_id(snapshot.index) == expected_points);
  }
}

IngestConfig without_limits() {
  IngestConfig config;
  config.min_range = 0.0;
  config.max_range = kInf;
  return config;
}

// The two indices have different frames, so their points are rounded to float differently.
void expect_same(const std::map<std::uint32_t, Eigen::Vector3d>& a,
                 const std::map<std::uint32_t, Eigen::Vector3d>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [id, p] : a) {
    ASSERT_EQ(b.count(id), 1U) << id;
    ASSERT_LT((b.at(id) - p).norm(), 1e-6) << id;
  }
}

void expect_transformed(const Points& points, const Eigen::Isometry3d& X_FS,
                        const PointIndex& index) {
  std::map<std::uint32_t, Eigen::Vector3d> expected;
  for (std::size_t i = 0; i < points.size(); ++i) {
    expected[static_cast<std::uint32_t>(i)] = X_FS * points[i];
  }
  expect_same(expected, test::points_by_id(index));
}

// A depth image: a wall, a board in front of it, and some NaN pixels.
// @param blind  one pixel in `blind` is NaN; 0: none
Points depth_image(std::size_t width, std::size_t height, unsigned blind = 10) {
  std::mt19937 random(8);
  Points points;
  for (std::size_t v = 0; v < height; ++v) {
    for (std::size_t u = 0; u < width; ++u) {
      const double a = static_cast<double>(u) / 80.0 - 1.0, b = static_cast<double>(v) / 80.0 - 0.7;
      const double depth = a > 0.1 && b < 0.2 ? 0.9 : 1.5 + 0.1 * a;
      const double x = blind > 0 && random() % blind == 0 ? kNan : a * depth;
      points.emplace_back(static_cast<double>(static_cast<float>(x)),
                          static_cast<double>(static_cast<float>(b * depth)),
                          static_cast<double>(static_cast<float>(depth)));
    }
  }
  return points;
}

// Organized clouds have a code path of their own, and so have images whose size is no multiple of a
// block's.
void check_images(const Format& format, unsigned blind) {
  for (const auto& [width, height] :
       {std::pair<std::size_t, std::size_t>{160, 120}, {163, 41}, {300, 5}, {17, 90}, {257, 64}}) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    Format organized = format;
    organized.width = width;
    Points points = depth_image(width, height, blind);
    points[5 * width / 2].y() = kInf;
    IngestConfig config;
    config.max_range = 1.7;
    config.thin = !format.owned;  // thinning would load all tiles at once
    const CloudSnapshot a = ingest(points, config, {}, pose(0.5, 0.2, 1.0));
    const CloudSnapshot b = ingest(points, config, organized, pose(0.5, 0.2, 1.0));
    EXPECT_EQ(a.counts.not_a_number, b.counts.not_a_number);
    EXPECT_EQ(a.counts.infinite, b.counts.infinite);
    EXPECT_EQ(a.counts.out_of_range, b.counts.out_of_range);
    expect_same(test::points_by_id(a.index), test::points_by_id(b.index));
  }
}

// Tiles are loaded at once, or lazily when a query first looks at them.
void check_images_eager_and_lazy(Format format) {
  for (const bool owned : {false, true}) {
    format.owned = owned;
    for (const unsigned blind : {10U, 1000U, 0U}) {
      test::for_each_instruction_set([&] { check_images(format, blind); });
    }
  }
}

TEST(Ingest, imageHoldsTheSamePointsAsAList) { check_images_eager_and_lazy({}); }

// Layouts of sixteen or more aligned bytes a point, as drivers write them, have a code path of
// their own.
TEST(Ingest, imageOfFourFloatsHoldsTheSamePointsAsAList) {
  Format format = four_floats();
  check_images_eager_and_lazy(format);
  format.row_padding = 48;
  check_images_eager_and_lazy(format);
}

TEST(Ingest, imageOfMoreThanFourFloatsHoldsTheSamePointsAsAList) {
  Format coloured;
  coloured.point_step = 32;
  coloured.misaligned = 0;
  check_images_eager_and_lazy(coloured);
  coloured.point_step = 20;
  coloured.x = 4;
  coloured.y = 8;
  coloured.z = 12;
  check_images_eager_and_lazy(coloured);
  coloured.is_bigendian = true;
  check_images_eager_and_lazy(coloured);
  check_images_eager_and_lazy(float64());
}

// Points lie on the sphere of a range limit or a fraction of a micrometre off it, where float alone
// cannot decide whether they are in range.
TEST(Ingest, imageAtItsRangeIsCutAsAListIs) {
  IngestConfig config;
  config.min_range = 0.7;
  config.max_range = 1.1;
  for (const double range : {config.min_range, config.max_range}) {
    Points points;
    std::mt19937 random(4);
    std::uniform_real_distribution<double> hair(-2e-7, 2e-7);
    for (std::size_t v = 0; v < 96; ++v) {
      for (std::size_t u = 0; u < 128; ++u) {
        const Eigen::Vector3d ray(static_cast<double>(u) / 100.0 - 0.6,
                                  static_cast<double>(v) / 100.0 - 0.5, 1.0);
        const Eigen::Vector3f p = (range * (1.0 + hair(random)) * ray.normalized()).cast<float>();
        points.emplace_back(p.cast<double>());
      }
    }
    Format organized = float64();
    organized.width = 128;
    for (const Format& format : {organized, four_floats(128)}) {
      SCOPED_TRACE(format.point_step);
      const CloudSnapshot a = ingest(points, config), b = ingest(points, config, format);
      EXPECT_GT(a.counts.used, points.size() / 8);
      EXPECT_LT(a.counts.used, points.size() * 7 / 8);
      EXPECT_EQ(a.counts.out_of_range, b.counts.out_of_range);
      expect_same(test::points_by_id(a.index), test::points_by_id(b.index));
    }
  }
}

// A sensor that tf places at 10^16 m: coordinates there are whole metres, so no bound means
// anything.
TEST(Ingest, refusesASensorFarOut) {
  const Points points = random_points(50, 1.0, 3);
  for (const double far : {1.1e9, 1e16, 1e300, kInf, kNan}) {
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
      X_FS.translation()[axis] = -far;
      EXPECT_THROW(ingest(points, {}, {}, X_FS), std::invalid_argument) << far;
    }
  }
  test::expect_says(test::argument_error([&] { ingest(points, {}, {}, pose(1e16, 0, 0)); }),
                    "(1e+16");
  EXPECT_EQ(ingest(points, without_limits(), {}, pose(0, 0, 9e8)).counts.used, points.size());
}

TEST(Ingest, refusesMorePointsThanAllowed) {
  IngestConfig config = without_limits();
  config.max_points = 50;
  EXPECT_EQ(ingest(random_points(50, 1.0, 3), config).counts.used, 50U);
  EXPECT_THROW(ingest(random_points(51, 1.0, 3), config), std::invalid_argument);
  config.max_points = 0;
  EXPECT_THROW(Ingest{config}, std::invalid_argument);
}

// Points far from an origin: in float, a coordinate of 4e6 m is off by up to 0.25 m. The sensor is
// far out, or the points are far from it, and its pose brings them near or not.
TEST(Ingest, farSensorsAndPointsLoseNothing) {
  const Eigen::Vector3d far(691000.123, 5334000.456, 520.789);
  const Points near_points = random_points(500, 2.0, 3);
  Points far_points = near_points;
  for (Eigen::Vector3d& p : far_points) p += far;
  const Eigen::Isometry3d X_back(Eigen::Translation3d(-691000.0, -5334000.0, -520.0));
  const Eigen::Isometry3d X_far = pose(far.x(), far.y(), far.z());
  IngestConfig config = without_limits();
  config.max_range = 10.0;
  for (const Format& format : {Format(), float64()}) {
    expect_transformed(near_points, X_far, ingest(near_points, config, format, X_far).index);
  }
  for (const Eigen::Isometry3d& X_FS :
       {Eigen::Isometry3d(Eigen::Isometry3d::Identity()), pose(1.0, 2.0, 3.0), X_back}) {
    expect_transformed(far_points, X_FS,
                       ingest(far_points, without_limits(), float64(), X_FS).index);
  }
  EXPECT_LT(
      ingest(far_points, without_limits(), float64(), X_back).index.X_FO().translation().norm(),
      10.0);
}

// A few far points must not move the origin away from most of the points.
TEST(Ingest, farOutliersDoNotMoveTheOrigin) {
  Points points = random_points(500, 2.0, 6);
  for (int i = 0; i < 50; ++i) points.emplace_back(1e8, -1e8, 1e8);
  const CloudSnapshot snapshot = ingest(points, without_limits(), float64());
  EXPECT_EQ(snapshot.index.X_FO().translation(), Eigen::Vector3d(0, 0, 0));
}

// The formats cover every code path that reads points: float or double, organized or unorganized,
// four floats or not.
TEST(Ingest, pointsOutsideTheRegionOfInterestAreDiscarded) {
  const Points points = depth_image(160, 120);
  const Eigen::Isometry3d X_FS = pose(0.5, 0.2, 1.0);
  RegionOfInterest region;
  region.center_F << 0.3, -0.4, 0.9;
  region.radius = 1.5;
  Format organized, owned = four_floats(160);
  organized.width = 160;
  owned.owned = true;
  for (const Format& format : {Format(), organized, four_floats(160), owned, float64()}) {
    const Message message(points, format);
    IngestConfig config = without_limits();
    config.thin = !format.owned;
    Ingest ingest(config);
    CloudSnapshot all, inside;
    ingest.run(message.raw, X_FS, {}, 0.0, &all);
    ingest.set_region_of_interest(region);
    ingest.run(message.raw, X_FS, {}, 0.0, &inside);
    EXPECT_EQ(all.region.radius, kInf);
    EXPECT_EQ(inside.region.radius, 1.5);
    const auto found = test::points_by_id(inside.index);
    std::size_t expected = 0;
    for (const auto& [id, p] : test::points_by_id(all.index)) {
      const double from_center = (p - region.center_F).norm();
      ASSERT_GT(std::abs(from_center - 1.5), 1e-9) << "rounding decides about this point";
      ASSERT_EQ(found.count(id), from_center < 1.5 ? 1U : 0U) << from_center;
      expected += from_center < 1.5;
    }
    EXPECT_GT(expected, 1000U);
    EXPECT_EQ(inside.counts.used, expected);
    EXPECT_EQ(inside.counts.outside_region, all.counts.used - expected);
    EXPECT_EQ(inside.counts.out_of_range, 0U);
  }
}

TEST(Ingest, refusesARegionOfInterestThatIsNoSphere) {
  Ingest ingest{IngestConfig()};
  for (const double radius : {kNan, -1.0}) {
    EXPECT_THROW(ingest.set_region_of_interest({Eigen::Vector3d::Zero(), radius}),
                 std::invalid_argument);
  }
  EXPECT_THROW(ingest.set_region_of_interest({Eigen::Vector3d(0, kInf, 0), 1.0}),
               std::invalid_argument);
}

TEST(Ingest, namesTheFaultyMemberOfItsConfiguration) {
  const auto fault = [](const IngestConfig& config) {
    return test::argument_error([&] { Ingest ingest(config); });
  };
  EXPECT_EQ(fault({}), "(no error)");
  for (const auto& [member, bad, words] :
       {std::tuple(&IngestConfig::min_range, -1.0, "min_range is -1"),
        std::tuple(&IngestConfig::max_range, 0.05, "max_range"),
        std::tuple(&IngestConfig::max_range, kNan, "max_range"),
        std::tuple(&IngestConfig::self_filter_padding, -0.1, "self_filter_padding"),
        std::tuple(&IngestConfig::thinning, 0.0, "thinning")}) {
    IngestConfig config;
    config.*member = bad;
    test::expect_says(fault(config), words);
  }
}

// The voxel grid belongs to the fixed frame, not to the sensor or the index's origin.
void check_cells() {
  IngestConfig config = without_limits();
  config.thinning = 0.1;
  const CloudSnapshot snapshot =
      ingest(random_points(20000, 1.0, 9), config, {}, pose(3.013, -4.027, 5.041));
  std::map<std::vector<double>, std::pair<double, std::uint32_t>> nearest;
  const auto all = test::points_by_id(snapshot.index);
  for (const auto& [id, p] : all) {
    const Eigen::Vector3d cell = (p / config.thinning).array().floor();
    const Eigen::Vector3d centre = config.thinning * (cell + Eigen::Vector3d::Constant(0.5));
    const std::pair<double, std::uint32_t> candidate((p - centre).norm(), id);
    const auto [it, is_new] =
        nearest.emplace(std::vector<double>(cell.begin(), cell.end()), candidate);
    if (!is_new) it->second = std::min(it->second, candidate);
  }
  const auto thin = test::thinned_points_of(snapshot.index);
  EXPECT_EQ(thin.size(), nearest.size());
  for (const auto& [cell, best] : nearest) {
    ASSERT_EQ(thin.count(best.second), 1U);
    EXPECT_EQ(thin.at(best.second), all.at(best.second));
  }
}

TEST(Thinning, keepsThePointNearestToTheCentreOfEachOccupiedVoxel) {
  test::for_each_instruction_set(check_cells);
}

// A grid that has to number all voxels from its origin to a point at 1e9 m in 30 bits has voxels of
// 0.93 m: the wall below was thinned to a few points.
void check_far_point(double far) {
  IngestConfig config = without_limits();
  config.thinning = 0.01;
  Points points;
  for (int i = -50; i < 50; ++i) {
    for (int k = -50; k < 50; ++k) {
      const Eigen::Vector3d centre(0.01 * i + 0.005, 0.01 * k + 0.005, 0.205);
      points.push_back(centre);
      points.push_back(centre + Eigen::Vector3d(0.002, -0.003, 0.001));
    }
  }
  const auto near = test::thinned_points_of(ingest(points, config, float64()).index);
  ASSERT_EQ(near.size(), 10000U);
  points.emplace_back(0.6 * far, -0.8 * far, 0.0);
  points.emplace_back(-0.6 * far, 0.8 * far, 0.0);
  const CloudSnapshot snapshot = ingest(points, config, float64());
  ASSERT_EQ(snapshot.counts.used, 20002U);
  const auto all = test::thinned_points_of(snapshot.index);
  EXPECT_EQ(all.size(), 10002U) << "points at " << far << " m";
  for (const auto& [id, p] : near) EXPECT_EQ(all.count(id), 1U) << "point " << id;
  EXPECT_EQ(snapshot.thinning, 0.01);
}

TEST(Thinning, pointsFarAwayChangeNothingForTheOthers) {
  for (const double far : {1e3, 1.07e7, 1.1e7, 1e9}) {
    test::for_each_instruction_set([far] { check_far_point(far); });
  }
}

TEST(Thinning, twoPointsAreTwoVoxelsAtTheFinestEdge) {
  IngestConfig config = without_limits();
  config.thinning = 1e-9;
  const CloudSnapshot snapshot =
      ingest({{1e9, 0, 0}, {-1e9, 0, 0}, {0, 0, 1}, {0, 0, 1.000001}}, config, float64());
  EXPECT_EQ(snapshot.counts.used, 4U);
  EXPECT_EQ(test::thinned_points_of(snapshot.index).size(), 4U);
}

}  // namespace
}  // namespace ist
