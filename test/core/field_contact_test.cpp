// Contact found by a distance field where links are large, of several elements, or nowhere.

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <vector>

#include "support/distance_fields.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/trial.h"

namespace ist {
namespace {

// A box of points may be kilometres deep.
TEST(FieldContact, ALargeLinkHasDeepPoints) {
  constexpr double kSize = 5000.0;
  test::Rng rng(1);
  for (const TriangleMesh& mesh :
       {test::box({kSize, kSize, kSize}), test::open_box({kSize, kSize, kSize})}) {
    const LinkGeometry link = test::one(mesh);
    const auto model = test::with_fields(test::model_of({link}, 100.0));
    for (int round = 0; round < 10; ++round) {
      std::vector<Eigen::Vector3d> points;
      for (int k = 0; k < 300; ++k) points.push_back(test::random_vector(&rng, 0.499 * kSize));
      const CloudSnapshot cloud = test::make_snapshot(points);
      const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      ProximityQuery query(model, {});
      LinkProximity result;
      ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
      EXPECT_LT(result.distance, -1000.0);
      test::expect_truth(result, test::truth_of(link, X_FL, points, cloud), query.config(), X_FL,
                         1e-6 * kSize, kSize);
      if (HasFailure()) return;
    }
  }
}

// Another link in contact is no reason for a wide interval.
TEST(FieldContact, TheMinimumOfSeveralElementsIsAsExactAsAsked) {
  Eigen::Isometry3d X_LE = Eigen::Isometry3d::Identity();
  X_LE.translation().x() = 0.1;
  const LinkGeometry two = {
      GeometryElement{test::open_box({0.1, 0.1, 0.1}), Eigen::Isometry3d::Identity(), "open box"},
      GeometryElement{test::box({0.1, 0.05, 0.05}), X_LE, "box"}};
  const auto model =
      test::with_fields(test::model_of({test::one(Box{{0.1, 0.1, 0.1}}), two}, 0.02));
  QueryConfig config;
  config.tolerance = 0.0;
  test::Rng rng(1);
  int contacts = 0;
  for (int round = 0; round < 200; ++round) {
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k < 30; ++k) points.push_back(test::random_vector(&rng, 0.15));
    const CloudSnapshot cloud = test::make_snapshot(points);
    std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
    X_FL[1].translation() = test::random_vector(&rng, 0.15);
    ProximityQuery query(model, config);
    RobotProximity result;
    ASSERT_TRUE(query.run_minimum(X_FL, {true, true}, {&cloud}, &result));
    if (result.nearest.state != LinkState::kContact) continue;
    ++contacts;
    ASSERT_LT(result.nearest.distance - result.nearest.lower_bound, 1e-6) << round;
  }
  EXPECT_GT(contacts, 100);
}

// What is asked for a pose that is not finite is not known, with a field and without.
TEST(FieldContact, APoseThatIsNotFiniteIsUnknown) {
  const std::vector<LinkGeometry> links = {test::one(test::box({0.1, 0.1, 0.1})),
                                           test::one(test::open_box({0.1, 0.1, 0.1}))};
  test::Rng rng(1);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 300; ++k) points.push_back(test::random_vector(&rng, 0.2));
  const CloudSnapshot cloud = test::make_snapshot(points);
  for (const auto& model :
       {test::model_of(links, 0.01), test::with_fields(test::model_of(links, 0.01))}) {
    ProximityQuery query(model, {});
    std::vector<LinkProximity> results;
    RobotProximity minimum;
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      for (int at = 0; at < 12; ++at) {
        std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
        X_FL[0].matrix()(at / 4, at % 4) = bad;
        query.run(X_FL, {true, true}, {&cloud}, &results);
        EXPECT_EQ(results[0].state, LinkState::kUnknown) << bad << " at " << at;
        EXPECT_EQ(results[1].state, LinkState::kContact) << bad << " at " << at;
        query.run_minimum(X_FL, {true, true}, {&cloud}, &minimum);
        EXPECT_FALSE(minimum.all_known);
        query.run_link(0, X_FL[0], {&cloud}, &results[0]);
        EXPECT_EQ(results[0].state, LinkState::kUnknown) << bad << " at " << at;
      }
    }
  }
}

}  // namespace
}  // namespace ist
