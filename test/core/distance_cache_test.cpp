// Lower bounds of the distances of points, used after the points have moved in the link's frame.

#include "proximity/coherence/distance_cache.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/solid_queries.h"
#include "proximity/coherence/box_distance_cache.h"
#include "support/meshes.h"
#include "support/scene.h"

namespace ist {
namespace {

using Quantity = DistanceCache::Quantity;

TEST(DistanceCache, FindsTheSameQuantityUnderTheSameKey) {
  DistanceCache cache;
  const Eigen::Vector3d p(0.1, 0.2, 0.3), q(0.1, 0.2, 0.34);
  EXPECT_TRUE(std::isinf(cache.find(Quantity::kSigned, 7, p)));
  cache.store(Quantity::kSigned, 7, p, 0.5);
  EXPECT_EQ(cache.find(Quantity::kSigned, 7, p), 0.5);
  EXPECT_LE(cache.find(Quantity::kSigned, 7, q), 0.46);
  EXPECT_NEAR(cache.find(Quantity::kSigned, 7, q), 0.46, 1e-12);
  EXPECT_EQ(cache.find(Quantity::kSigned, 7, p), 0.5) << "displacements do not add up";
  for (const double other :
       {cache.find(Quantity::kUnsigned, 7, p), cache.find(Quantity::kSigned, 8, p)}) {
    EXPECT_EQ(other, -std::numeric_limits<double>::infinity());
  }
  const Eigen::Vector3d none(0, std::numeric_limits<double>::quiet_NaN(), 0);
  EXPECT_TRUE(std::isinf(cache.find(Quantity::kSigned, 7, none)));
  cache.store(Quantity::kSigned, 7, none, 0.5);
  EXPECT_TRUE(std::isinf(cache.find(Quantity::kSigned, 7, p)));
}

// Points share the entries of the cache; none is given what another has stored.
TEST(DistanceCache, TellsPointsOfOneEntryApart) {
  DistanceCache cache;
  const Eigen::Vector3d p(0.1, 0.2, 0.3);
  cache.store(Quantity::kSigned, 7, p, 0.5);
  for (std::uint32_t key = 0; key < 100000; ++key) {
    for (const Quantity quantity : {Quantity::kUnsigned, Quantity::kSigned, Quantity::kOutside}) {
      const bool is_it = key == 7 && quantity == Quantity::kSigned;
      ASSERT_EQ(std::isfinite(cache.find(quantity, key, p)), is_it) << key;
    }
  }
}

// The points of many images under the keys of the first: the bound is that of the place, whatever
// point is there.
TEST(DistanceCache, HoldsForOtherPointsUnderTheSameKey) {
  test::Rng rng(92);
  const Solid solid({GeometryElement{test::l_shape(0.2, 0.05), Eigen::Isometry3d::Identity(), ""}});
  DistanceCache cache;
  int found = 0;
  for (int image = 0; image < 40; ++image) {
    const double noise = std::pow(10.0, test::uniform(&rng, -5, -1));
    for (std::uint32_t key = 0; key < 200; ++key) {
      const auto at = static_cast<double>(key);
      const Eigen::Vector3d place(0.3 * std::sin(at), 0.3 * std::cos(2.0 * at), 0.2);
      const Eigen::Vector3d p = place + test::random_vector(&rng, noise);
      const double kept = cache.find(Quantity::kSigned, key, p);
      const PointDepth depth = point_depth(solid, p, -1.0);
      ASSERT_LE(kept, depth.exact.distance + 1e-12) << "image " << image << ", key " << key;
      found += kept > 0.0 ? 1 : 0;
      cache.store(Quantity::kSigned, key, p, depth.floor);
    }
  }
  EXPECT_GT(found, 1000);
}

// More points than the cache has entries move in and out of a link.
TEST(DistanceCache, BoundsAreNeverAboveTheTruth) {
  test::Rng rng(91);
  const Solid solid({GeometryElement{test::l_shape(0.2, 0.05), Eigen::Isometry3d::Identity(), ""}});
  DistanceCache cache;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 800; ++i) points.push_back(test::random_vector(&rng, 0.2));
  int found = 0;
  for (int step = 0; step < 20000; ++step) {
    const auto i = static_cast<std::uint32_t>(rng() % points.size());
    Eigen::Vector3d& p = points[i];
    p += test::random_vector(&rng, std::pow(10.0, test::uniform(&rng, -6, -2)));
    const double floor = cache.find(Quantity::kSigned, i, p);
    const PointDepth depth = point_depth(solid, p, -1.0);
    ASSERT_LE(floor, depth.exact.distance + 1e-12);
    found += std::isfinite(floor) ? 1 : 0;
    if (step % 3 == 0) cache.store(Quantity::kSigned, i, p, depth.floor);
  }
  EXPECT_GT(found, 1000);
}

// Boxes move past a link, turn, and are replaced by others of other sizes under the same keys.
TEST(BoxDistanceCache, BoundsAreNeverAboveTheTruth) {
  test::Rng rng(93);
  const std::vector<Solid> solids = {
      Solid({GeometryElement{test::l_shape(0.2, 0.05), Eigen::Isometry3d::Identity(), ""}}),
      Solid({GeometryElement{Cylinder{0.06, 0.3}, Eigen::Isometry3d::Identity(), ""}}),
      Solid({GeometryElement{Box{{0.1, 0.2, 0.3}}, Eigen::Isometry3d::Identity(), ""}})};
  int found = 0, tight = 0, outside = 0;
  for (const Solid& solid : solids) {
    BoxDistanceCache cache;
    Eigen::Isometry3d X_LO = Eigen::Isometry3d::Identity();
    for (int step = 0; step < 200; ++step) {
      const double size = std::pow(10.0, test::uniform(&rng, -5, -1));
      X_LO.translation() += test::random_vector(&rng, size);
      X_LO.rotate(Eigen::AngleAxisd(size, test::random_vector(&rng, 1.0).normalized()));
      for (std::uint32_t key = 0; key < 40; ++key) {
        const auto at = static_cast<double>(key);
        const Eigen::Vector3d center(0.3 * std::sin(at), 0.3 * std::cos(2.0 * at), 0.2);
        const double grown = key % 4 == 0 ? test::uniform(&rng, 0.0, 0.01) : 0.0;
        const Eigen::Vector3d half = Eigen::Vector3d(0.01, 0.02, 0.04).array() + grown;
        const Eigen::AlignedBox3d box(center - half, center + half);
        const PlacedBox placed(box, X_LO);
        const auto [kept, is_outside] = cache.find(key, placed);
        const BoxDistance truth =
            distance_to_box(solid, box, X_LO.inverse(), std::numeric_limits<double>::infinity());
        ASSERT_LE(kept, truth.distance + 1e-12) << "step " << step << ", key " << key;
        found += kept > 0.0 ? 1 : 0;
        outside += is_outside ? 1 : 0;
        const bool is_whole = truth.distance > 1e-6 && !solid.is_inside(X_LO * center);
        ASSERT_TRUE(is_whole || !is_outside) << "step " << step << ", key " << key;
        tight += kept > truth.distance - 0.002 ? 1 : 0;
        if (step % 3 == 0) cache.store(key, placed, {truth.lower_bound, is_whole});
      }
    }
  }
  EXPECT_GT(found, 5000);
  EXPECT_GT(tight, 5000);
  EXPECT_GT(outside, 3000);
}

}  // namespace
}  // namespace ist
