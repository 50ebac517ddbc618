// Bounds of links that a deadline leaves unfinished: whatever is told of a link whose state is
// known is a number, and no point is deeper than it says.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/distance_fields.h"
#include "support/hostile_meshes.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/trial.h"

namespace ist {
namespace {

// The model without a field, with a coarse one and with a fine one.
std::vector<std::shared_ptr<const RobotModel>> models_of(const LinkGeometry& link) {
  const auto without = test::model_of({link}, 0.01);
  return {without, test::with_fields(without, 1), test::with_fields(without)};
}

// The winding number of many copies of a triangle is large in all of the box about them, also at
// its corner, which is farther from them than the radius of the sphere about them.
TEST(StoppedBounds, WhatAMeshWithHolesEnclosesMayBeDeeperThanItsSphere) {
  const TriangleMesh triangle{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}}};
  TriangleMesh copies = triangle;
  for (int i = 1; i < 20; ++i) copies = test::joined(copies, triangle);
  const LinkGeometry link = test::one(copies);
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  const std::vector<bool> known = {true};
  std::vector<Eigen::Vector3d> points = {Eigen::Vector3d::Constant(0.9995)};
  int inside = 0;
  for (const auto& model : models_of(link)) {
    const LinkModel& packed = model->links.front();
    const double depth = -packed.solid.signed_distance(points.front()).distance;
    ASSERT_GT(depth, packed.tree.radius());
    for (const std::size_t others : {0U, 2U, 2000U}) {
      points.resize(1);
      for (std::size_t k = 0; k < others; ++k) {
        points.push_back(Eigen::Vector3d::Constant(0.5 + 0.48 * static_cast<double>(k) /
                                                             static_cast<double>(others)));
      }
      const CloudSnapshot cloud = test::make_snapshot(points);
      for (const double deadline : {1e-12, 1e-5, 0.0}) {
        QueryConfig config;
        config.max_distance = 10.0;
        config.deadline = deadline;
        ProximityQuery query(model, config);
        std::vector<LinkProximity> results;
        query.run({X_FL}, known, {&cloud}, &results);
        if (results.front().state == LinkState::kUnknown) continue;
        ++inside;
        ASSERT_LE(results.front().lower_bound, -depth + 2e-7) << others << ", " << deadline;
      }
    }
  }
  EXPECT_GT(inside, 9);
}

TEST(StoppedBounds, AKnownLinkHasAFiniteBound) {
  test::Rng rng(21);
  int known_links = 0, unfinished = 0;
  for (const TriangleMesh& mesh :
       {test::moebius_strip(0.1, 0.04, 20), test::open_box({0.1, 0.1, 0.1})}) {
    const LinkGeometry link = test::one(mesh);
    for (const auto& model : models_of(link)) {
      for (const bool has_extent : {false, true}) {
        ProximityQuery query(model, {});
        Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
        for (int round = 0; round < test::scaled(40); ++round) {
          std::vector<Eigen::Vector3d> points;
          for (int k = 0; k < 400; ++k) points.push_back(test::random_vector(&rng, 0.12));
          CloudSnapshot cloud = test::make_snapshot(points);
          if (has_extent) {
            cloud.extent.constant = cloud.extent.linear = 0.01;
            cloud.extent.max_range = 5.0;
            cloud.extent.p_FS = Eigen::Vector3d::UnitX();
          }
          for (int step = 0; step < 8; ++step) {
            QueryConfig config;
            config.deadline = std::pow(10.0, test::uniform(&rng, -5.5, -3.5));
            query.set_config(config);
            std::vector<LinkProximity> results;
            query.run({X_FL}, {true}, {&cloud}, &results);
            const LinkProximity& result = results.front();
            if (result.state >= LinkState::kNear) {
              ++known_links;
              ASSERT_TRUE(std::isfinite(result.lower_bound)) << "round " << round;
              ASSERT_TRUE(std::isfinite(result.sensor_width)) << "round " << round;
              const test::Truth truth = test::truth_of(link, X_FL, points, cloud);
              ASSERT_LE(result.lower_bound, std::max(truth.measured, truth.stored) + 2e-8);
              const double width = result.distance - result.lower_bound - result.sensor_width;
              if (width > config.tolerance + 1e-6) {
                ++unfinished;
                ASSERT_EQ(query.statistics().unfinished, 1U);
                ASSERT_GE(query.statistics().widest, width - 1e-12);
              }
            }
            X_FL = X_FL * test::random_pose(&rng, 0.001);
            X_FL.translation() *= 0.9;
          }
        }
      }
    }
  }
  EXPECT_GT(known_links, test::scaled(1000));
  EXPECT_GT(unfinished, 10);
}

}  // namespace
}  // namespace ist
