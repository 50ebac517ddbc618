// What a query knows when there is next to no time.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

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
    Points points_L;
    for (const CloudSnapshot* cloud : {&wall_, &near_}) {
      const PointBvh& bvh = cloud->index.bvh();
      const Eigen::Isometry3d X_LO = X_FL_[link].inverse() * bvh.X_FO();
      for (std::size_t tile = 0; tile < bvh.tile_count(); ++tile) {
        PointTile scratch;
        const PointTile& points = bvh.tile(tile, &scratch);
        for (int k = 0; k < points.count; ++k) points_L.push_back(X_LO * points.point(k));
      }
    }
    return test::oracle_minimum(meshes_[link], points_L);
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

// A bound that was proven for one cloud is not taken for another, nor for a pose far away.
TEST_F(NoTime, BoundsBelongToTheirScene) {
  QueryConfig config;
  config.max_distance = 5.0;
  config.deadline = 1e3;
  ProximityQuery query(model_, config);
  for (int i = 0; i < test::scaled(100); ++i) {
    next_scene();
    for (int step = 0; step < 3; ++step) {
      std::vector<LinkProximity> results;
      Deadline::asks_left_for_test = (i + step) % 4;
      query.run(X_FL_, known_, {&wall_, &near_}, &results);
      Deadline::asks_left_for_test = -1;
      for (std::size_t k = 0; k < results.size(); ++k) {
        ASSERT_LE(results[k].lower_bound, truth(k) + 1e-9) << "scene " << i;
      }
      for (Eigen::Isometry3d& X : X_FL_) {
        X.translation() += test::random_vector(&rng_, step == 0 ? 0.01 : 0.5);
      }
    }
  }
}

// A box 0.1 mm above a plane of points, on a motion without any time: no sphere is so fine. The
// plane across the obstacle that was measured proves that the box is free, at each pose again.
TEST(WithoutTime, ABoxJustAboveAPlaneIsFreeWithoutTime) {
  const auto model = test::make_model({Box{{0.2, 0.2, 0.1}}}, 0.005);
  Points plane;
  for (int i = 0; i < 100; ++i) {
    for (int k = 0; k < 100; ++k) plane.emplace_back(0.01 * i - 0.5, 0.01 * k - 0.5, 0.0);
  }
  const CloudSnapshot cloud = test::make_snapshot(plane);
  QueryConfig config;
  config.deadline = 1e-9;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  for (int step = 0; step < 100; ++step) {
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = Eigen::Vector3d(1e-3 * step, 0.0, 0.0501);
    // What is made late is made, as where no other process takes the processor.
    Deadline::late_for_test = 0.0;
    query.run({X_FL}, {true}, {&cloud}, &results);
    Deadline::late_for_test = -1.0;
    ASSERT_EQ(results[0].state, LinkState::kNear);
    ASSERT_LE(results[0].lower_bound, 1e-4 + 1e-9);
    EXPECT_GT(results[0].lower_bound, 0.0);
  }
}

// A share of a deadline passes no later than the whole one, and not before its time.
TEST(WithoutTime, SharesOfADeadline) {
  Deadline never(0.0);
  EXPECT_FALSE(Deadline(&never, 10).passed());
  Deadline whole(1000.0);
  EXPECT_FALSE(Deadline(&whole, 1).passed());
  EXPECT_FALSE(Deadline(&whole, 10).passed());
  Deadline small(&whole, 1000000000);
  while (!small.passed()) {
  }
  EXPECT_FALSE(whole.has_passed());
  EXPECT_FALSE(small.passed_by(100.0));
  Deadline over(1e-9);
  Deadline rest(&over, 2);
  EXPECT_TRUE(rest.passed());
  EXPECT_TRUE(rest.passed_by(0.0));
  EXPECT_TRUE(over.has_passed());
}

}  // namespace
}  // namespace ist
