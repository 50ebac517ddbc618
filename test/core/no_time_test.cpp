// What a query knows when there is next to no time.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/distance_fields.h"
#include "support/hostile_meshes.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// Three links, and clouds that no query has met before.
class NoTime : public ::testing::Test {
 protected:
  NoTime() {
    meshes_ = {test::torus(0.1, 0.03, 12, 6), test::open_box({0.1, 0.1, 0.15}),
               test::l_shape(0.2, 0.05)};
    std::vector<Shape> shapes(meshes_.begin(), meshes_.end());
    model_ = test::make_model(shapes, 0.005);
    known_.assign(meshes_.size(), true);
  }

  // A wall, and in a second cloud points near one link.
  void next_scene() {
    X_FL_.assign(meshes_.size(), Eigen::Isometry3d());
    for (Eigen::Isometry3d& X : X_FL_) X = test::random_pose(&rng_, 0.5);
    Points points;
    for (int i = 0; i < 200; ++i) {
      points.emplace_back(1.0, test::uniform(&rng_, -1.0, 1.0), test::uniform(&rng_, -1.0, 1.0));
    }
    wall_ = test::make_snapshot(points);
    points.clear();
    for (int i = 0; i < 10; ++i) {
      points.push_back(X_FL_[0].translation() + test::random_vector(&rng_, 0.02));
    }
    near_ = test::make_snapshot(points);
  }

  double truth(std::size_t link) const {
    const LinkGeometry geometry = test::one(meshes_[link]);
    return std::min(test::oracle_minimum(geometry, X_FL_[link], test::stored_points(wall_.index)),
                    test::oracle_minimum(geometry, X_FL_[link], test::stored_points(near_.index)));
  }

  test::Rng rng_{163};
  std::vector<TriangleMesh> meshes_;
  std::shared_ptr<RobotModel> model_;
  std::vector<bool> known_;
  std::vector<Eigen::Isometry3d> X_FL_;
  CloudSnapshot wall_, near_;
};

// A deadline that is over at once: before, only a link whose last obstacle was still there got an
// answer, and its bound was minus the link's size. Now all of them are measured, and nearly all
// that are free of contact are known to be.
TEST_F(NoTime, EveryLinkHasAnObstacleAndABound) {
  int free = 0, proven = 0, links = 0;
  QueryConfig config;
  config.max_distance = 5.0;
  config.deadline = 1e-9;
  for (int i = 0; i < test::scaled(100); ++i) {
    next_scene();
    ProximityQuery query(model_, config);
    std::vector<LinkProximity> results;
    // What is made late is made, as where no other process takes the processor.
    Deadline::late_for_test = 0.0;
    EXPECT_FALSE(query.run(X_FL_, known_, {&wall_, &near_}, &results));
    Deadline::late_for_test = -1.0;
    for (std::size_t k = 0; k < results.size(); ++k) {
      ++links;
      ASSERT_NE(results[k].state, LinkState::kUnknown);
      const double exact = truth(k);
      ASSERT_LE(results[k].lower_bound, exact + 1e-9);
      ASSERT_GE(results[k].distance, exact - 1e-6);
      free += exact > 0.1 ? 1 : 0;
      proven += exact > 0.1 && results[k].lower_bound > 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(free, test::kSanitized ? -1 : links / 5);
  EXPECT_GE(proven, 0.9 * free);
}

// A link in range of nothing is CLEAR, though there is no time to measure anything.
TEST_F(NoTime, ClearLinksAreClear) {
  QueryConfig config;
  config.max_distance = 0.2;
  config.deadline = 1e3;
  int clear = 0;
  for (int i = 0; i < test::scaled(50); ++i) {
    next_scene();
    ProximityQuery query(model_, config);
    std::vector<LinkProximity> results;
    Deadline::asks_left_for_test = 0;
    query.run(X_FL_, known_, {&wall_, &near_}, &results);
    Deadline::asks_left_for_test = -1;
    for (std::size_t k = 0; k < results.size(); ++k) {
      if (results[k].state != LinkState::kClear) continue;
      ++clear;
      ASSERT_GT(truth(k), config.max_distance - 1e-6);
    }
  }
  EXPECT_GT(clear, test::kSanitized ? -1 : 20);
}

// A box slides 0.1 mm above a plane of points. Wherever a query is stopped, in its first steps or
// in a later one, a supporting plane still proves that the box is free.
TEST(WithoutTime, IsMadeUpForWhereverAQueryIsStopped) {
  const auto model = test::make_model({Shape(Box{{0.2, 0.16, 0.1}})}, 0.005);
  Points points;
  for (int i = 0; i < 60; ++i) {
    for (int k = 0; k < 60; ++k) points.emplace_back(0.01 * i - 0.3, 0.01 * k - 0.3, 0.0);
  }
  const CloudSnapshot plane = test::make_snapshot(points);
  QueryConfig config;
  config.tolerance = 0.001;
  config.deadline = 1e3;
  int proven = 0, answers = 0;
  for (int asks = 0; asks < 40; ++asks) {
    ProximityQuery query(model, config);
    std::vector<LinkProximity> results;
    for (int step = 0; step < 10; ++step) {
      Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      X_FL.translation() = Eigen::Vector3d(2.5e-4 * step, 0.0, 0.0501);
      Deadline::asks_left_for_test = step == 0 ? -1 : asks;
      query.run({&X_FL, 1}, {true}, {&plane}, &results);
      Deadline::asks_left_for_test = -1;
      ASSERT_LE(results[0].lower_bound, 1e-4 + 1e-9);
      ++answers;
      proven += results[0].lower_bound > 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(proven, test::kSanitized ? -1 : 98 * answers / 100);
}

// Bounds of links that a deadline leaves unfinished: whatever is told of a link whose state is
// known is a number, and no point is deeper than it says.

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

// A link that moves among points, asked with deadlines that mostly leave it unfinished.
struct StoppedLink {
  LinkGeometry link;
  ProximityQuery query;
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  int known = 0, unfinished = 0;

  void expect_bound(const LinkProximity& result, const Points& points, const CloudSnapshot& cloud) {
    if (result.state < LinkState::kNear) return;
    ++known;
    ASSERT_TRUE(std::isfinite(result.lower_bound));
    ASSERT_TRUE(std::isfinite(result.sensor_width));
    const test::Truth truth = test::truth_of(link, X_FL, points, cloud);
    ASSERT_LE(result.lower_bound, std::max(truth.measured, truth.stored) + 2e-8);
    const double width = result.distance - result.lower_bound - result.sensor_width;
    if (width <= query.config().tolerance + 1e-6) return;
    ++unfinished;
    ASSERT_EQ(query.statistics().unfinished, 1U);
    ASSERT_GE(query.statistics().widest, width - 1e-12);
  }

  void expect_round(bool has_extent, test::Rng* rng) {
    Points points;
    for (int k = 0; k < 400; ++k) points.push_back(test::random_vector(rng, 0.12));
    CloudSnapshot cloud = test::make_snapshot(points);
    if (has_extent) {
      cloud.extent.constant = cloud.extent.linear = 0.01;
      cloud.extent.max_range = 5.0;
      cloud.extent.p_FS = Eigen::Vector3d::UnitX();
    }
    for (int step = 0; step < 8; ++step) {
      QueryConfig config;
      config.deadline = test::power_of_ten(rng, -5.5, -3.5);
      query.set_config(config);
      std::vector<LinkProximity> results;
      query.run({X_FL}, {true}, {&cloud}, &results);
      expect_bound(results.front(), points, cloud);
      if (testing::Test::HasFatalFailure()) return;
      X_FL = X_FL * test::random_pose(rng, 0.001);
      X_FL.translation() *= 0.9;
    }
  }
};

TEST(StoppedBounds, AKnownLinkHasAFiniteBound) {
  test::Rng rng(21);
  int known = 0, unfinished = 0;
  for (const TriangleMesh& mesh :
       {test::moebius_strip(0.1, 0.04, 20), test::open_box({0.1, 0.1, 0.1})}) {
    const LinkGeometry link = test::one(mesh);
    for (const auto& model : models_of(link)) {
      for (const bool has_extent : {false, true}) {
        StoppedLink stopped{link, ProximityQuery(model, {})};
        for (int round = 0; round < test::scaled(40); ++round) {
          SCOPED_TRACE(testing::Message() << "round " << round);
          stopped.expect_round(has_extent, &rng);
          if (HasFatalFailure()) return;
        }
        known += stopped.known;
        unfinished += stopped.unfinished;
      }
    }
  }
  EXPECT_GT(known, test::scaled(1000));
  EXPECT_GT(unfinished, 10);
}

}  // namespace
}  // namespace ist
