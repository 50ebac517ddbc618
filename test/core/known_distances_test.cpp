// What is known about places in a link's frame, carried to where points have moved since.

#include "proximity/known_distances.h"
#include "internal/geometry/solid_queries.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "support/meshes.h"
#include "support/scene.h"

namespace ist {
namespace {

using Kind = KnownDistances::Kind;

TEST(KnownDistances, TellOfTheSamePointOfTheSameIndex) {
  KnownDistances known;
  const Eigen::Vector3d p(0.1, 0.2, 0.3), q(0.1, 0.2, 0.34);
  EXPECT_TRUE(std::isinf(known.at(1, Kind::kPoint, 7, p)));
  known.keep(1, Kind::kPoint, 7, p, 0.5);
  EXPECT_EQ(known.at(1, Kind::kPoint, 7, p), 0.5);
  EXPECT_LE(known.at(1, Kind::kPoint, 7, q), 0.46);
  EXPECT_NEAR(known.at(1, Kind::kPoint, 7, q), 0.46, 1e-12);
  EXPECT_EQ(known.at(1, Kind::kPoint, 7, p), 0.5) << "ways do not add up";
  for (const double other : {known.at(2, Kind::kPoint, 7, p), known.at(1, Kind::kOutside, 7, p),
                             known.at(1, Kind::kPoint, 8, p)}) {
    EXPECT_EQ(other, -std::numeric_limits<double>::infinity());
  }
  const Eigen::Vector3d none(0, std::numeric_limits<double>::quiet_NaN(), 0);
  EXPECT_TRUE(std::isinf(known.at(1, Kind::kPoint, 7, none)));
  known.keep(1, Kind::kPoint, 7, none, 0.5);
  EXPECT_TRUE(std::isinf(known.at(1, Kind::kPoint, 7, p)));
}

// Of more points than there is room for, which wander in and out of a link.
TEST(KnownDistances, AreNeverAboveTheTruth) {
  test::Rng rng(91);
  const Solid solid({GeometryElement{test::l_shape(0.2, 0.05), Eigen::Isometry3d::Identity(), ""}});
  KnownDistances known;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 800; ++i) points.push_back(test::random_vector(&rng, 0.2));
  int told = 0;
  for (int step = 0; step < 20000; ++step) {
    const auto i = static_cast<std::uint32_t>(rng() % points.size());
    Eigen::Vector3d& p = points[i];
    p += test::random_vector(&rng, std::pow(10.0, test::uniform(&rng, -6, -2)));
    const double floor = known.at(1, Kind::kPoint, i, p);
    const PointDepth depth = point_depth(solid, p, -1.0);
    ASSERT_LE(floor, depth.exact.distance + 1e-12);
    told += std::isfinite(floor) ? 1 : 0;
    if (step % 3 == 0) known.keep(1, Kind::kPoint, i, p, depth.floor);
  }
  EXPECT_GT(told, 1000);
}

}  // namespace
}  // namespace ist
