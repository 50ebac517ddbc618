#include "ist_proximity/cloud/laser_scan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "support/scene.h"
#include "support/tiles.h"
#include "support/whole_cloud.h"

namespace ist {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

LaserScan scan_of(const std::vector<float>& ranges) {
  LaserScan scan;
  scan.angle_min = -1.5;
  scan.angle_increment = ranges.size() > 1 ? 3.0 / static_cast<double>(ranges.size() - 1) : 0.0;
  scan.range_min = 0.1;
  scan.range_max = 10.0;
  scan.ranges = ranges.data();
  scan.count = ranges.size();
  return scan;
}

CloudSnapshot ingested(const LaserScan& scan, double min_range, double max_range,
                       const Eigen::Isometry3d& X_FS = Eigen::Isometry3d::Identity(),
                       Span<const SensorAtBeam> sensor = {}) {
  ScanPoints points;
  to_points(scan, min_range, max_range, sensor, &points);
  CloudSnapshot snapshot;
  Ingest(test::whole_cloud()).run(points.raw(), X_FS, {}, 0.0, &snapshot);
  return snapshot;
}

std::vector<Eigen::Vector3d> by_beam(const CloudSnapshot& snapshot, std::size_t count) {
  std::vector<Eigen::Vector3d> points(count, Eigen::Vector3d::Constant(NAN));
  for (const PointTile& tile : test::tiles_of(snapshot.index)) {
    for (int k = 0; k < tile.count; ++k) {
      points[tile.id[k]] = snapshot.index.X_FO() * tile.point(static_cast<int>(k));
    }
  }
  return points;
}

TEST(LaserScan, PointsLieAlongTheirBeams) {
  const std::vector<float> ranges = {1.0F, 2.0F, 0.5F};
  test::Rng rng(1);
  const Eigen::Isometry3d X_FS = test::random_pose(&rng, 3.0);
  const auto points = by_beam(ingested(scan_of(ranges), 0.0, 5.0, X_FS), 3);
  for (int i = 0; i < 3; ++i) {
    const double angle = -1.5 + 1.5 * i,
                 r = static_cast<double>(ranges[static_cast<std::size_t>(i)]);
    const Eigen::Vector3d truth =
        X_FS * Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), 0);
    EXPECT_LT((points[static_cast<std::size_t>(i)] - truth).norm(), 1e-6);
  }
}

// Special values follow REP 117. Many drivers write 0 where nothing came back.
TEST(LaserScan, CountsSpecialValues) {
  const std::vector<float> ranges = {kNaN,  -kInfinity, 0.0F, 0.05F, -1.0F, kInfinity,
                                     11.0F, 0.2F,       7.0F, 1.0F,  10.0F};
  const IngestCounts counts = ingested(scan_of(ranges), 0.5, 5.0).counts;
  EXPECT_EQ(counts.received, ranges.size());
  EXPECT_EQ(counts.not_a_number, 5U) << "NaN, -inf and below range_min";
  EXPECT_EQ(counts.infinite, 2U) << "+inf and above range_max";
  EXPECT_EQ(counts.out_of_range, 3U) << "0.2 m, 7 m and 10 m";
  EXPECT_EQ(counts.used, 1U);
  EXPECT_FALSE(counts.saw_nothing());
}

// A sensor on a moving arm scans a fixed wall, each beam from the sensor's pose at the beam's time:
// from the first beam to the last one the arm changes its direction a few times.
TEST(LaserScan, EachBeamAtItsOwnTime) {
  test::Rng rng(2);
  constexpr std::size_t kBeams = 200;
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Isometry3d X_start = test::random_pose(&rng, 0.3);
    std::vector<SensorAtBeam> sensor;
    std::vector<double> turns;
    double moved = 0.0;
    for (std::size_t beam = 0; beam < kBeams; beam += 1 + beam / 2) {
      if (beam + 1 + beam / 2 >= kBeams) beam = kBeams - 1;
      SensorAtBeam at;
      at.beam = beam;
      turns.push_back(beam == 0 ? 0.0 : test::uniform(&rng, -1, 1));
      if (beam > 0) at.X_SB.translation() = test::random_pose(&rng, 0.1).translation();
      at.X_SB.linear() =
          Eigen::AngleAxisd(turns.back(), Eigen::Vector3d::UnitZ()).toRotationMatrix();
      moved = std::max(moved, at.X_SB.translation().norm());
      sensor.push_back(at);
    }
    std::vector<float> ranges(kBeams);
    std::vector<Eigen::Vector3d> truth(kBeams);
    for (std::size_t i = 0, k = 0; i < kBeams; ++i) {
      if (i > sensor[k + 1].beam) ++k;
      const SensorAtBeam &a = sensor[k], &b = sensor[k + 1];
      const double t = static_cast<double>(i - a.beam) / static_cast<double>(b.beam - a.beam);
      const double angle = -1.5 + 3.0 * static_cast<double>(i) / (kBeams - 1);
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      X.translation() = (1 - t) * a.X_SB.translation() + t * b.X_SB.translation();
      X.linear() =
          Eigen::AngleAxisd((1 - t) * turns[k] + t * turns[k + 1], Eigen::Vector3d::UnitZ())
              .toRotationMatrix();
      X = X_start * X;
      const double range = test::uniform(&rng, 0.2, 3.0);
      ranges[i] = static_cast<float>(range);
      truth[i] = X * Eigen::Vector3d(range * std::cos(angle), range * std::sin(angle), 0);
    }
    LaserScan scan = scan_of(ranges);
    scan.time_increment = 1e-4;
    ScanPoints placed;
    to_points(scan, 0.0, 5.0, sensor, &placed);
    EXPECT_EQ(placed.sensor_moved, moved);
    const auto points = by_beam(ingested(scan, 0.0, 5.0, X_start, sensor), kBeams);
    for (std::size_t i = 0; i < kBeams; ++i) ASSERT_LT((points[i] - truth[i]).norm(), 1e-6);
    // The pose is the same for all beams when there is no time between them.
    scan.time_increment = 0.0;
    to_points(scan, 0.0, 5.0, sensor, &placed);
    EXPECT_EQ(placed.sensor_moved, 0.0);
    const auto still = by_beam(ingested(scan, 0.0, 5.0, X_start, sensor), kBeams);
    const double angle = 1.5, r = static_cast<double>(ranges.back());
    EXPECT_LT(
        (still.back() - X_start * Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), 0))
            .norm(),
        1e-6);
  }
}

// Range limits apply to the length of a beam, not to the distance from the sensor's first pose.
TEST(LaserScan, RangeLimitsApplyToTheBeam) {
  const std::vector<float> ranges(11, 1.0F);
  LaserScan scan = scan_of(ranges);
  scan.time_increment = 0.01;
  SensorAtBeam first, last;
  last.beam = 10;
  last.X_SB.translation().x() = 0.8;
  const auto snapshot = ingested(scan, 0.9, 1.1, Eigen::Isometry3d::Identity(), {first, last});
  EXPECT_EQ(snapshot.counts.used, 11U);
}

// A robot of a sphere, and a scan of a half circle about the sensor.
class SelfFilterOfAScan : public ::testing::Test {
 protected:
  static constexpr std::size_t kBeams = 101;

  SelfFilterOfAScan() {
    config_.self_filter = true;
    to_points(scan_of(ranges_), 0.0, 5.0, {}, &points_);
  }
  PosedSolid robot_at(const Eigen::Vector3d& p) const {
    return {&model_->links[0].tree, &model_->links[0].solid,
            Eigen::Isometry3d(Eigen::Translation3d(p))};
  }
  CloudSnapshot filtered(const RawCloud& cloud, const std::vector<PosedSolid>& robot) const {
    CloudSnapshot snapshot;
    Ingest(config_).run(cloud, Eigen::Isometry3d::Identity(), robot, 0.0, &snapshot);
    return snapshot;
  }
  static bool is_on(const Eigen::Vector3d& robot, std::size_t beam) {
    const double angle = -1.5 + 0.03 * static_cast<double>(beam);
    return (Eigen::Vector3d(std::cos(angle), std::sin(angle), 0) - robot).norm() <= 0.12;
  }

  const std::shared_ptr<const RobotModel> model_ = test::make_model({Sphere{0.1}}, 0.005);
  const std::vector<float> ranges_ = std::vector<float>(kBeams, 1.0F);
  const Eigen::Vector3d ahead_ = Eigen::Vector3d::UnitX(), aside_ = Eigen::Vector3d::UnitY();
  IngestConfig config_ = test::whole_cloud();
  ScanPoints points_;
};

TEST_F(SelfFilterOfAScan, KnowsTheRobotAtEveryInstant) {
  const CloudSnapshot first = filtered(points_.raw(), {robot_at(ahead_)}),
                      both = filtered(points_.raw(), {robot_at(ahead_), robot_at(aside_)});
  const auto kept = by_beam(both, kBeams);
  std::uint32_t on_robot = 0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const bool expected = is_on(ahead_, i) || is_on(aside_, i);
    EXPECT_EQ(kept[i].array().isNaN().all(), expected) << i;
    on_robot += expected ? 1 : 0;
  }
  EXPECT_EQ(both.counts.on_robot, on_robot);
  EXPECT_GT(both.counts.on_robot, first.counts.on_robot);
}

// A beam is compared with where the robot was when it was measured. An obstacle is no point on the
// robot because a link is there at another time of the scan.
TEST_F(SelfFilterOfAScan, ComparesABeamWithTheRobotOfItsTime) {
  PosedSolid solid = robot_at(ahead_);
  using Beams = std::pair<std::uint32_t, std::uint32_t>;
  for (const auto& [first, last] : {Beams{0, 100}, {0, 50}, {51, 100}, {48, 49}}) {
    solid.first_point = first;
    solid.last_point = last;
    const auto kept = by_beam(filtered(points_.raw(), {solid}), kBeams);
    for (std::size_t i = 0; i < kBeams; ++i) {
      EXPECT_EQ(kept[i].array().isNaN().all(), is_on(ahead_, i) && i >= first && i <= last) << i;
    }
  }
}

// Points of one tile, all of them deep inside where the link was, for half of them at another time.
TEST_F(SelfFilterOfAScan, DividesATileByTime) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 16; ++i) points.emplace_back(1.0F + 1e-4F * i, 0.0F, 0.0F);
  const RawCloud raw = packed_cloud(points.data()->data(), points.size(), 1);
  PosedSolid solid = robot_at(ahead_);
  for (const int last : {0, 7, 14, 15}) {
    solid.last_point = static_cast<std::uint32_t>(last);
    const CloudSnapshot snapshot = filtered(raw, {solid});
    EXPECT_EQ(snapshot.counts.on_robot, static_cast<std::uint32_t>(last + 1));
    EXPECT_EQ(snapshot.index.size(), points.size() - static_cast<std::size_t>(last + 1));
  }
}

TEST(CheckScan, NamesTheFaultyMember) {
  const std::vector<float> ranges(5, 1.0F);
  const LaserScan good = scan_of(ranges);
  EXPECT_EQ(check_scan(good), "");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const auto expect_fault = [&](const char* member, auto&& change) {
    LaserScan scan = good;
    change(&scan);
    EXPECT_EQ(check_scan(scan).rfind(member, 0), 0U) << member << ": " << check_scan(scan);
  };
  expect_fault("ranges", [](LaserScan* s) { s->count = 0; });
  expect_fault("ranges", [](LaserScan* s) { s->ranges = nullptr; });
  for (const double bad : {nan, inf, 1e9}) {
    expect_fault("angle_min", [=](LaserScan* s) { s->angle_min = bad; });
    expect_fault("angle_increment", [=](LaserScan* s) { s->angle_increment = bad; });
  }
  expect_fault("angle_increment", [](LaserScan* s) { s->angle_increment = 0.0; });
  for (const double bad : {nan, inf, -0.1}) {
    expect_fault("range_min", [=](LaserScan* s) { s->range_min = bad; });
  }
  for (const double bad : {nan, -inf, -1.0, 0.1}) {
    expect_fault("range_max", [=](LaserScan* s) { s->range_max = bad; });
  }
  for (const double bad : {nan, inf, 3.0}) {
    expect_fault("time_increment", [=](LaserScan* s) { s->time_increment = bad; });
  }
  LaserScan many = good;  // a million beams over 9.9 s took 41 s with the self-filter
  const std::vector<float> million(1000000, 1.0F);
  many.ranges = million.data();
  many.count = million.size();
  many.angle_increment = 1e-6;
  many.time_increment = 9.9e-6;
  EXPECT_EQ(check_scan(many), "ranges holds 1000000 beams, allowed are at most 50000 (max_beams).");
  ScanLimits limits;
  limits.max_beams = million.size();
  EXPECT_EQ(check_scan(many, limits), "");
  LaserScan unlimited_range = good;
  unlimited_range.range_max = inf;
  EXPECT_EQ(check_scan(unlimited_range), "");
  const std::vector<float> single(1, 1.0F);
  EXPECT_EQ(check_scan(scan_of(single)), "") << "one beam needs no increment";
}

}  // namespace
}  // namespace ist
