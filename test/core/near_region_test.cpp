#include "cloud/index/near_region.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/random_links.h"
#include "support/scene.h"
#include "support/tiles.h"
#include "support/trial.h"

namespace ist {
namespace {

using Points = std::vector<Eigen::Vector3f>;
using Poses = std::vector<Eigen::Isometry3d>;

constexpr double kPadding = 0.02;
constexpr double kRounding = 1e-6;

// A robot of random links side by side, and the exact distance of points from it.
struct Robot {
  std::vector<LinkGeometry> links;
  std::shared_ptr<const RobotModel> model;
  std::vector<bool> known;
  Poses X_FL;

  explicit Robot(test::Rng* rng) : links(test::random_links(rng)) {
    model = test::model_of(links, 0.01);
    known.assign(links.size(), true);
    for (std::size_t i = 0; i < links.size(); ++i) {
      X_FL.push_back(test::random_pose(rng, 0.3));
      X_FL.back().pretranslate(Eigen::Vector3d(0.0, 0.4 * static_cast<double>(i % 4), 0.0));
    }
  }

  double distance(std::size_t link, const Eigen::Vector3f& p_F) const {
    const Eigen::Vector3d p_L = X_FL[link].inverse() * p_F.cast<double>();
    return model->links[link].solid.signed_distance(p_L).distance;
  }
  double distance(const Eigen::Vector3f& p_F) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < links.size(); ++i) nearest = std::min(nearest, distance(i, p_F));
    return nearest;
  }
  Poses moved(const Eigen::Vector3d& by) const {
    Poses poses = X_FL;
    for (Eigen::Isometry3d& X : poses) X.pretranslate(by);
    return poses;
  }
};

// Points all over a room, in patches of 5 cm.
Points room(test::Rng* rng, std::size_t n, double size) {
  Points points;
  constexpr std::size_t kPatch = 20;
  while (points.size() < n) {
    const Eigen::Vector3d patch = test::random_vector(rng, size);
    for (std::size_t k = 0; k < kPatch; ++k) {
      points.push_back((patch + test::random_vector(rng, 0.05)).cast<float>());
    }
  }
  return points;
}

constexpr double kPeriod = 0.033;  // [s] of the clouds
constexpr double kSearchDistance = 1.0;

CloudSnapshot ingest(const Robot& robot, const Points& points) {
  IngestConfig config;
  config.min_range = 0.0;
  config.max_range = 100.0;
  config.self_filter_padding = kPadding;
  config.search_distance = kSearchDistance;
  CloudSnapshot snapshot;
  Ingest ingest(config);
  for (const double stamp : {7.0, 7.0 + kPeriod}) {
    ingest.run(packed_cloud(points[0].data(), points.size(), 1), Eigen::Isometry3d::Identity(),
               posed_solids(*robot.model, robot.X_FL, robot.known), stamp, &snapshot);
  }
  return snapshot;
}

// The points that are kept, which are exactly those off the robot.
std::vector<Eigen::Vector3d> kept_points(const Robot& robot, const Points& points,
                                         const CloudSnapshot& snapshot) {
  const std::set<std::uint32_t> ids = test::ids_of(snapshot.index);
  std::vector<Eigen::Vector3d> kept;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const bool is_kept = ids.count(i) > 0;
    if (is_kept) kept.push_back(points[i].cast<double>());
    const double off = robot.distance(points[i]) - kPadding;
    if (std::abs(off) > kRounding) {
      EXPECT_EQ(is_kept, off > 0.0);
    }
  }
  EXPECT_EQ(ids.size(), kept.size());
  EXPECT_EQ(snapshot.index.size(), kept.size());
  return kept;
}

// Boxes as large as a cell cost time and change no answer: also not when the robot goes where no
// query was expected.
TEST(NearRegion, answersAreExactWhereverTheRobotGoes) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    test::Rng rng(seed);
    const Robot robot(&rng);
    const Points points = room(&rng, 4000, test::uniform(&rng, 1.0, 3.0));
    const CloudSnapshot cloud = ingest(robot, points);
    const std::vector<Eigen::Vector3d> kept = kept_points(robot, points, cloud);
    ProximityQuery query(robot.model, {});
    std::vector<LinkProximity> results;
    for (const double way : {0.0, 0.05, 0.5, 2.0}) {
      const Poses X_FL = robot.moved(way * test::random_vector(&rng, 1.0));
      for (const double tolerance : {0.0, 0.001}) {
        SCOPED_TRACE("seed " + std::to_string(seed) + ", after " + std::to_string(way) + " m, to " +
                     std::to_string(tolerance) + " m");
        QueryConfig config;
        config.tolerance = tolerance;
        query.set_config(config);
        ASSERT_TRUE(query.run(X_FL, robot.known, {&cloud}, &results));
        for (std::size_t i = 0; i < robot.links.size(); ++i) {
          SCOPED_TRACE(robot.model->links[i].name);
          expect_truth(results[i], test::truth_of(robot.links[i], X_FL[i], kept, cloud), config,
                       X_FL[i], 1e-6);
        }
      }
    }
  }
}

// The region holds all points of the robot: those beyond it are kept without a look.
TEST(NearRegion, holdsAllPointsOfALargeLink) {
  test::Rng rng(3);
  Robot robot(&rng);
  const Eigen::Vector3d size(2.0, 0.8, 0.5);
  GeometryElement box;
  box.shape = Box{size};
  robot.links = {{box}};
  robot.model = test::model_of(robot.links, 0.01);
  robot.known = {true};
  robot.X_FL = {Eigen::Isometry3d::Identity()};
  Points points = room(&rng, 20000, 1.5);
  for (int i = 0; i < 100000; ++i) {
    Eigen::Vector3d p = 0.5 * size.cwiseProduct(test::random_vector(&rng, 1.0));
    p[i % 3] = std::copysign(0.5 * size[i % 3], p[i % 3]);
    points.push_back(p.cast<float>());
  }
  kept_points(robot, points, ingest(robot, points));
}

// What is thinned does not depend on how points are brought together.
TEST(NearRegion, leavesTheThinnedPointsAsTheyAre) {
  test::Rng rng(7);
  Robot robot(&rng);
  Points points = room(&rng, 20000, 2.0);
  points.erase(std::remove_if(points.begin(), points.end(),
                              [&](const auto& p) { return robot.distance(p) < 2.0 * kPadding; }),
               points.end());
  const CloudSnapshot in_part = ingest(robot, points);
  robot.known.assign(robot.known.size(), false);
  const CloudSnapshot sliced = ingest(robot, points);
  ASSERT_EQ(in_part.index.size(), points.size());
  ASSERT_EQ(sliced.index.size(), points.size());
  const auto thinned = test::thinned_points_of(sliced.index);
  EXPECT_EQ(test::thinned_points_of(in_part.index), thinned);
  EXPECT_LT(thinned.size(), points.size());
}

}  // namespace
}  // namespace ist
