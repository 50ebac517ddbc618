// Queries as the README writes them allocate nothing, from the first call on.

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/allocations.h"
#include "support/demo_arm.h"

namespace ist {
namespace {

constexpr std::size_t kWidth = 64, kHeight = 48;

// A wall that the camera looks at, `depth` [m] away.
std::shared_ptr<std::vector<float>> wall(float depth) {
  auto xyz = std::make_shared<std::vector<float>>();
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    xyz->push_back(depth);
    xyz->push_back(0.02F * static_cast<float>(i % kWidth) - 0.64F);
    xyz->push_back(0.02F * static_cast<float>(i / kWidth));
  }
  return xyz;
}

RawCloud raw_cloud(const std::shared_ptr<std::vector<float>>& xyz, bool is_organized) {
  RawCloud cloud = is_organized ? packed_cloud(xyz->data(), kWidth, kHeight)
                                : packed_cloud(xyz->data(), kWidth * kHeight, 1);
  cloud.owner = xyz;
  return cloud;
}

// The parameters: whether clouds are organized, and whether they are thinned. The points of an
// organized cloud that is not thinned are read from the message by the queries.
class AllocationsOfQueries : public ::testing::TestWithParam<std::pair<bool, bool>> {};

TEST_P(AllocationsOfQueries, AreNoneFromTheFirstCallOn) {
  const auto [is_organized, is_thinned] = GetParam();
  const std::shared_ptr<const RobotModel> robot = test::demo_model();
  const Kinematics kinematics(test::demo_robot());
  std::vector<double> q(kinematics.joints().size(), 0.0);
  LinkPoses poses = link_poses(*robot, kinematics, q);

  IngestConfig config;
  config.thin = is_thinned;
  Ingest ingest(config);
  CloudSnapshot snapshot;
  ProximityQuery query(robot, {});
  std::vector<LinkProximity> results(robot->links.size());
  RobotProximity nearest;
  // The last wall passes through the arm.
  for (const float depth : {0.8F, 0.5F, 0.1F}) {
    ingest.run(raw_cloud(wall(depth), is_organized), Eigen::Isometry3d::Identity(), {}, 0.0,
               &snapshot);
    for (int step = 0; step < 5; ++step) {
      for (double& position : q) position += 0.01;
      poses = link_poses(*robot, kinematics, q);
      long before = test::allocations;
      query.run(poses.X_FL, poses.known, {&snapshot}, &results);
      EXPECT_EQ(test::allocations - before, 0) << "run, wall at " << depth << ", step " << step;
      before = test::allocations;
      query.run_minimum(poses.X_FL, poses.known, {&snapshot}, &nearest);
      EXPECT_EQ(test::allocations - before, 0) << "run_minimum, wall at " << depth;
      ASSERT_TRUE(nearest.all_known);
      ASSERT_GE(nearest.link, 0);
    }
  }
  EXPECT_EQ(nearest.nearest.state, LinkState::kContact);
}

TEST_P(AllocationsOfQueries, AreNoneWhenTheNumberOfCloudsChanges) {
  const auto [is_organized, is_thinned] = GetParam();
  const std::shared_ptr<const RobotModel> robot = test::demo_model();
  const Kinematics kinematics(test::demo_robot());
  const std::vector<double> q(kinematics.joints().size(), 0.0);
  const LinkPoses poses = link_poses(*robot, kinematics, q);

  IngestConfig config;
  config.thin = is_thinned;
  Ingest ingest(config);
  CloudSnapshot far, near;
  const Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  ingest.run(raw_cloud(wall(0.8F), is_organized), X_FS, {}, 0.0, &far);
  ingest.run(raw_cloud(wall(0.5F), is_organized), X_FS, {}, 0.0, &near);
  ProximityQuery query(robot, {});
  std::vector<LinkProximity> results(robot->links.size());
  RobotProximity nearest;
  const long before = test::allocations;
  query.run(poses.X_FL, poses.known, {&far}, &results);
  query.run(poses.X_FL, poses.known, {&far, &near}, &results);
  query.run_minimum(poses.X_FL, poses.known, {&far, &near}, &nearest);
  query.run_minimum(poses.X_FL, poses.known, {&near}, &nearest);
  query.run(poses.X_FL, poses.known, {}, &results);
  EXPECT_EQ(test::allocations - before, 0);
}

// A query's memory is what its documentation says, about 90 kB a link and 33 kB more where a mesh
// has holes, and does not grow with its history.
TEST(MemoryOfQueries, IsWhatItWasAtFirst) {
  const std::shared_ptr<const RobotModel> robot = test::demo_model();
  const Kinematics kinematics(test::demo_robot());
  Ingest ingest(IngestConfig{});
  CloudSnapshot snapshot;
  ingest.run(raw_cloud(wall(0.5F), true), Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot);
  EXPECT_GE(snapshot.index.memory(), snapshot.index.size() * 3 * sizeof(float));
  ProximityQuery query(robot, {});
  const std::size_t first = query.memory();
  const auto links = static_cast<double>(robot->links.size());
  EXPECT_GT(static_cast<double>(first), 70e3 * links);
  EXPECT_LT(static_cast<double>(first), 125e3 * links);
  std::vector<LinkProximity> results;
  for (int i = 0; i < 100; ++i) {
    const std::vector<double> q(kinematics.joints().size(), 0.01 * i);
    const LinkPoses poses = link_poses(*robot, kinematics, q);
    query.run(poses.X_FL, poses.known, {&snapshot}, &results);
  }
  EXPECT_EQ(query.memory(), first);
}

// Link against link: near, far and in contact, after jumps and along motions.
TEST(AllocationsOfSelfQueries, AreNone) {
  const std::shared_ptr<const RobotModel> robot = test::demo_model();
  const Kinematics kinematics(test::demo_robot());
  const std::vector<bool> all(robot->links.size(), true);
  const std::vector<LinkPair> pairs = self_collision_pairs(*robot, kinematics, all, {});
  std::vector<PairProximity> results(pairs.size());
  QueryConfig config;
  for (const double tolerance : {0.001, 0.0}) {
    config.tolerance = tolerance;
    SelfQuery query(robot, pairs, config);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> angle(-3.0, 3.0);
    std::vector<double> q(kinematics.joints().size(), 0.0);
    int contacts = 0;
    for (int i = 0; i < 200; ++i) {
      for (double& position : q) position = i % 10 == 0 ? angle(random) : position + 1e-3;
      const LinkPoses poses = link_poses(*robot, kinematics, q);
      const long before = test::allocations;
      query.run(poses.X_FL, poses.known, &results);
      ASSERT_EQ(test::allocations - before, 0) << i;
      for (const PairProximity& result : results) {
        contacts += result.state == LinkState::kContact ? 1 : 0;
      }
    }
    EXPECT_GT(contacts, 20);
  }
}

INSTANTIATE_TEST_SUITE_P(Clouds, AllocationsOfQueries,
                         ::testing::Values(std::pair{true, false}, std::pair{true, true},
                                           std::pair{false, false}, std::pair{false, true}));

}  // namespace
}  // namespace ist
