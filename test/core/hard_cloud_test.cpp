// Clouds that are hard for an index: many equal points, any order, NaN and infinity, far origins.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;
using Points = std::vector<Eigen::Vector3d>;

const test::Trial& common_links() {
  static const test::Trial trial(
      {Box{{0.2, 0.1, 0.3}}, Cylinder{0.08, 0.25}, Sphere{0.1}, test::l_shape(0.2, 0.05)});
  return trial;
}

std::vector<LinkProximity> query(SnapshotSpan clouds, const Eigen::Isometry3d& X_FL,
                                 const QueryConfig& config) {
  const std::size_t count = common_links().model().links.size();
  std::vector<LinkProximity> results;
  ProximityQuery(common_links().shared_model(), config)
      .run(std::vector<Eigen::Isometry3d>(count, X_FL), std::vector<bool>(count, true), clouds,
           &results);
  return results;
}

QueryConfig exact() {
  QueryConfig config;
  config.tolerance = 0.0;
  return config;
}

// The cloud has millions of equal points with IST_PROXIMITY_LARGE_TESTS set, and as many as a depth
// image otherwise.
TEST(HardCloud, ManyPointsInOnePlace) {
  const bool large = std::getenv("IST_PROXIMITY_LARGE_TESTS") != nullptr;
  const std::size_t count = large ? 5000000 : test::kSanitized ? 30000 : 300000;
  for (const Point& p : {Point(0.3, 0.2, 0.1), Point(0.02, 0.03, 0.04), Point(0.1, 0.05, 0.15)}) {
    const CloudSnapshot many = test::make_snapshot(Points(count, p));
    const CloudSnapshot one = test::make_snapshot({p});
    ASSERT_EQ(many.index.size(), count);
    for (const double tolerance : {0.0, 0.001}) {
      QueryConfig config;
      config.tolerance = tolerance;
      const auto a = query({&many}, Eigen::Isometry3d::Identity(), config);
      const auto b = query({&one}, Eigen::Isometry3d::Identity(), config);
      for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].state, b[i].state);
        EXPECT_NEAR(a[i].distance, b[i].distance, 1e-12);
        EXPECT_LE(a[i].lower_bound, b[i].distance);
        test::expect_witness(a[i], Eigen::Isometry3d::Identity());
      }
    }
  }
}

TEST(HardCloud, OrderAndDuplicatesDoNotMatter) {
  test::Rng rng(61);
  for (int scene = 0; scene < test::scaled(60); ++scene) {
    Points points;
    for (int i = 0; i < 3000; ++i) points.push_back(test::random_vector(&rng, 0.5));
    // A tenth of the points are equal, and a third lie in a plane.
    for (int i = 0; i < 300; ++i) points[static_cast<std::size_t>(i)] = points[0];
    for (std::size_t i = 300; i < 1300; ++i) points[i].z() = -0.31;
    std::vector<Points> orders(6, points);
    const auto by_x = [](const Point& a, const Point& b) { return a.x() < b.x(); };
    std::sort(orders[1].begin(), orders[1].end(), by_x);
    std::reverse_copy(orders[1].begin(), orders[1].end(), orders[2].begin());
    std::shuffle(orders[3].begin(), orders[3].end(), rng);
    // This order alternates between both ends: neighbours in the message are as far apart as
    // possible.
    for (std::size_t i = 0; i < points.size(); ++i) {
      orders[4][i] = orders[1][i % 2 == 0 ? i / 2 : points.size() - 1 - i / 2];
    }
    orders[5].insert(orders[5].end(), points.begin(), points.end());
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.4);
    std::vector<LinkProximity> first;
    for (std::size_t k = 0; k < orders.size(); ++k) {
      SCOPED_TRACE("order " + std::to_string(k));
      const CloudSnapshot cloud = test::make_snapshot(orders[k]);
      const auto results = query({&cloud}, X_FL, exact());
      const auto coarse = query({&cloud}, X_FL, {});
      if (k == 0) first = results;
      for (std::size_t i = 0; i < results.size(); ++i) {
        ASSERT_EQ(results[i].state, first[i].state);
        ASSERT_EQ(coarse[i].state, first[i].state);
        if (first[i].state == LinkState::kClear) continue;
        ASSERT_NEAR(results[i].distance, first[i].distance, 1e-12);
        ASSERT_LE(coarse[i].lower_bound, first[i].distance);
        ASSERT_GE(coarse[i].distance, first[i].distance - 1e-12);
      }
    }
  }
}

// Of walls and rows in which every point stands three times, tiles begin where a point of another
// tile was measured: that they hold others is not forgotten.
TEST(HardCloud, WallsAndRowsOfDuplicates) {
  test::Rng rng(62);
  for (int scene = 0; scene < test::scaled(300); ++scene) {
    const int axis = scene % 3, other = (axis + 1) % 3;
    const bool is_row = scene % 2 == 0;
    Points points;
    for (int i = 0; i < 900; ++i) {
      const int grid = i / 3;
      Point p = 0.02 * (is_row ? Point(grid, grid, grid) : Point(grid % 20, grid % 20, grid / 20));
      p[axis] = 0.3;
      if (!is_row) p[other] = 0.02 * (grid / 20);
      if (is_row) p[other] = 0.1;
      points.push_back(p - Point(0.2, 0.2, 0.2));
    }
    std::shuffle(points.begin(), points.end(), rng);
    common_links().expect(points, test::random_pose(&rng, 0.4));
  }
}

template <typename Scalar>
RawCloud raw(const std::vector<Scalar>& xyz) {
  return packed_cloud(xyz.data(), xyz.size() / 3, 1);
}

template <typename Scalar>
CloudSnapshot ingest(const Points& points_S, const Eigen::Isometry3d& X_FS, double max_range) {
  std::vector<Scalar> xyz;
  for (const Point& p : points_S) {
    for (int i = 0; i < 3; ++i) xyz.push_back(static_cast<Scalar>(p[i]));
  }
  IngestConfig config;
  config.min_range = 0.0;
  config.max_range = max_range;
  CloudSnapshot snapshot;
  Ingest(config).run(raw(xyz), X_FS, {}, 0.0, &snapshot);
  return snapshot;
}

// Each odd number is put into each coordinate of a point among good points. Points with numbers in
// `dropped` must not count, and those with numbers in `kept` must.
template <typename Scalar>
void expect_odd_numbers_dropped() {
  using Limits = std::numeric_limits<Scalar>;
  const std::vector<Scalar> dropped = {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(),
                                       Scalar(1e30),        Scalar(-1e30),      Limits::max(),
                                       Limits::lowest()};
  const std::vector<Scalar> kept = {Limits::denorm_min(), -Limits::denorm_min(), Limits::min(),
                                    Scalar(-0.0)};
  const Points good = {{0.5, 0.1, 0.2}, {0.3, 0.4, -0.2}};
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<Scalar> xyz;
    const auto append = [&xyz](const Point& p) {
      for (int i = 0; i < 3; ++i) xyz.push_back(static_cast<Scalar>(p[i]));
    };
    const auto append_with = [&](const Point& p, Scalar odd) {
      append(p);
      xyz[xyz.size() - 3 + static_cast<std::size_t>(axis)] = odd;
    };
    for (const Point& p : good) append(p);
    for (const Scalar odd : dropped) append_with({0.05, 0.05, 0.05}, odd);
    for (const Scalar odd : kept) append_with({0.6, 0.6, 0.6}, odd);
    CloudSnapshot cloud;
    Ingest({}).run(raw(xyz), Eigen::Isometry3d::Identity(), {}, 0.0, &cloud);
    EXPECT_EQ(cloud.counts.used, good.size() + kept.size());
    EXPECT_EQ(cloud.counts.not_a_number, 1U);
    EXPECT_EQ(cloud.counts.infinite, 2U);
    EXPECT_EQ(cloud.counts.out_of_range, 4U);
    Points expected = good;
    Point zero(0.6, 0.6, 0.6);
    zero[axis] = 0.0;
    expected.push_back(zero);
    const auto results = query({&cloud}, Eigen::Isometry3d::Identity(), exact());
    for (std::size_t i = 0; i < results.size(); ++i) {
      test::expect_truth(
          results[i],
          test::truth_of(common_links().link(i), Eigen::Isometry3d::Identity(), expected, cloud),
          exact(), Eigen::Isometry3d::Identity(), 1e-7);
    }
  }
}

TEST(HardCloud, OddNumbersInEachCoordinate) {
  expect_odd_numbers_dropped<float>();
  expect_odd_numbers_dropped<double>();
}

// Points whose coordinates float holds exactly.
Points random_float_points(test::Rng* rng, int count) {
  Points points;
  for (int i = 0; i < count; ++i) {
    const Point p = test::random_vector(rng, 0.8);
    points.push_back(p.cast<float>().cast<double>());
  }
  return points;
}

// Expects the answers of two scenes, of which one is the other moved by `far` [m].
void expect_same_answers(const std::vector<LinkProximity>& here,
                         const std::vector<LinkProximity>& there, const Point& far) {
  for (std::size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(here[i].state, there[i].state);
    if (here[i].state < LinkState::kNear) continue;
    EXPECT_NEAR(here[i].distance, there[i].distance, 1e-6);
    EXPECT_NEAR(here[i].lower_bound, there[i].lower_bound, 1e-5);
    EXPECT_LT((here[i].p_FCo + far - there[i].p_FCo).norm(), 1e-5);
  }
}

void expect_same_distances(const std::vector<LinkProximity>& here,
                           const std::vector<LinkProximity>& there) {
  for (std::size_t i = 0; i < here.size(); ++i) {
    if (here[i].state < LinkState::kNear) continue;
    EXPECT_NEAR(here[i].distance, there[i].distance, 1e-6);
  }
}

// The same scene at the origin and 1e6 m away, where either the sensor's pose or the points' own
// coordinates are large.
TEST(HardCloud, FarFromTheOrigin) {
  test::Rng rng(62);
  for (const Point& far : {Point(1e6, -2e6, 5e5), Point(1e6 + 0.3, 1e6 - 0.7, 0.1)}) {
    for (int scene = 0; scene < test::scaled(100); ++scene) {
      const Points points = random_float_points(&rng, 200);
      const Eigen::Isometry3d X_FS = test::random_pose(&rng, 0.5),
                              X_FL = test::random_pose(&rng, 0.5);
      const Eigen::Translation3d move(far);
      Points near_map_points, map_points;
      for (const Point& p : points) {
        near_map_points.push_back(X_FS * p);
        map_points.push_back(far + X_FS * p);
      }
      const CloudSnapshot here = ingest<float>(points, X_FS, 3.0);
      const CloudSnapshot there = ingest<float>(points, Eigen::Isometry3d(move * X_FS), 3.0);
      const CloudSnapshot map = ingest<double>(map_points, Eigen::Isometry3d::Identity(),
                                               std::numeric_limits<double>::infinity());
      ASSERT_EQ(there.index.size(), here.index.size());
      ASSERT_EQ(map.index.size(), points.size());
      const CloudSnapshot near_map =
          ingest<double>(near_map_points, Eigen::Isometry3d::Identity(), 100.0);
      const auto a = query({&here}, X_FL, exact());
      const auto b = query({&there}, Eigen::Isometry3d(move * X_FL), exact());
      const auto c = query({&near_map}, X_FL, exact());
      const auto d = query({&map}, Eigen::Isometry3d(move * X_FL), exact());
      expect_same_answers(a, b, far);
      expect_same_distances(c, d);
    }
  }
}

// Points near a link among points of huge finite coordinates, up to the largest of each type. Those
// beyond 10^9 m are dropped as out of range. None changes the nearest obstacle, nor makes a bound
// wrong.
template <typename Scalar>
void expect_huge_coordinates_are_sound(const std::vector<double>& sizes) {
  test::Rng rng(63);
  for (const double size : sizes) {
    SCOPED_TRACE(size);
    Points points;
    for (int i = 0; i < 100; ++i) {
      points.push_back(test::random_vector(&rng, 0.8).cast<float>().cast<double>());
    }
    const CloudSnapshot near = ingest<Scalar>(points, Eigen::Isometry3d::Identity(), 10.0);
    for (int axis = 0; axis < 3; ++axis) {
      points.emplace_back(size * Point::Unit(axis));
      points.emplace_back(-size * Point::Unit(axis));
    }
    const CloudSnapshot all = ingest<Scalar>(points, Eigen::Isometry3d::Identity(),
                                             std::numeric_limits<double>::infinity());
    EXPECT_EQ(all.counts.used, size <= 1e9 ? points.size() : points.size() - 6);
    EXPECT_EQ(all.counts.out_of_range, size <= 1e9 ? 0U : 6U);
    EXPECT_EQ(all.counts.infinite + all.counts.not_a_number, 0U);
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.5);
    const auto truth = query({&near}, X_FL, exact());
    const auto results = query({&all}, X_FL, exact());
    for (std::size_t i = 0; i < results.size(); ++i) {
      ASSERT_LE(results[i].lower_bound, truth[i].distance + 1e-12);
      if (truth[i].state < LinkState::kNear) continue;
      ASSERT_GE(results[i].state, LinkState::kNear);
      ASSERT_NEAR(results[i].distance, truth[i].distance, 1e-6);
      ASSERT_GE(results[i].lower_bound, truth[i].lower_bound - 1e-5);
    }
  }
}

TEST(HardCloud, HugeFiniteCoordinates) {
  expect_huge_coordinates_are_sound<float>({1e4, 1e6, 9e8, 2e9, 1e13, 1e15, 1e19, 1e20, 3.4e38});
  expect_huge_coordinates_are_sound<double>(
      {1e4, 1e6, 9e8, 2e9, 1e15, 1e20, 1e40, 1e150, 1e160, 1e300});
}

// A pose at any finite place ends a query: links and clouds that are far apart are clear, and no
// traversal runs over (boxes whose distances are NaN or infinite in float must not be visited for
// ever).
TEST(HardCloud, HugePosesOfLinks) {
  test::Rng rng(64);
  Points points;
  for (int i = 0; i < 5000; ++i) points.push_back(test::random_vector(&rng, 0.8));
  const CloudSnapshot cloud = test::make_snapshot(points);
  CloudSnapshot map;
  auto boxes = std::make_shared<BoxIndex>();
  std::vector<Eigen::AlignedBox3d> leaves;
  for (const Point& p : points) leaves.emplace_back(p, p + Point::Constant(0.05));
  boxes->build(leaves);
  map.boxes = boxes;
  for (const double size : {1e4, 1e9, 1e16, 1e19, 1e20, 1e38, 1e39, 1e154, 1e155, 1e300}) {
    SCOPED_TRACE(size);
    Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.5);
    X_FL.translation() += size * Point(1.0, -1.0, 0.5);
    map.X_FM = Eigen::Isometry3d::Identity();
    for (const bool map_is_far : {false, true}) {
      if (map_is_far) {
        map.X_FM.translation() = X_FL.translation();
        X_FL.translation().setZero();
      }
      for (const LinkProximity& result : query({&map}, X_FL, exact())) {
        ASSERT_LT(result.state, LinkState::kNear);
        ASSERT_LE(result.lower_bound, size);
      }
    }
    X_FL.translation() = map.X_FM.translation();
    for (const LinkProximity& result : query({&cloud}, X_FL, exact())) {
      ASSERT_LT(result.state, LinkState::kNear);
    }
  }
}

}  // namespace
}  // namespace ist
